use std::collections::VecDeque;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use ohmstrain_ekf::Gaussian;
use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

/// Number of known strains used for a row: the last ones for a filter, half before and half after the row for a
/// smoother.
pub const MOST_KNOWN: usize = 16;
/// Correlation time of errors that vary with the motion, s.
const FAST_S: f64 = 3.0;
/// Correlation time of a day's offset and gain, s.
const SLOW_S: f64 = 3600.0;
/// Variance of the error of the gain, relative to that of the offset, for a strain that may be anywhere in the limits: a
/// known strain near one end says little about the other end.
const GAIN: f64 = 1.0;
/// Distance from the middle of the limits, in spans, beyond which an error of the gain grows no further.
const FARTHEST: f64 = 0.6;

/// Size of lasting errors, in stated variances: almost nothing within a recording, many times the stated variance on
/// another day. The known strains determine which one applies.
#[derive(Clone, Copy, Debug)]
struct Size {
    /// Probability before any strain is known.
    probability: f64,
    fast: f64,
    slow: f64,
    /// Share of the doubts' variance that lasts: all of it on another day.
    doubted: f64,
}

/// `docs/notes/2026-11-24-known-strains-figures.md` documents their choice.
const SIZES: [Size; 4] = [
    Size { probability: 0.85, fast: 0.97, slow: 0.03, doubted: 0.0 },
    Size { probability: 0.08, fast: 0.7, slow: 0.3, doubted: 0.0 },
    Size { probability: 0.04, fast: 1.0, slow: 3.0, doubted: 1.0 },
    Size { probability: 0.03, fast: 1.0, slow: 30.0, doubted: 1.0 },
];

/// A strain known at one time, and its estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnownStrain {
    /// Time, s.
    pub time_s: f64,
    /// The known strain, with its variance.
    pub known: Gaussian<f64>,
    /// Estimate of the strain, without the effect of earlier known strains.
    pub estimated: Stated,
}

/// Estimate of a strain, and the part of its variance that doubts have added.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stated {
    /// Estimate, with the variance stated by the filter.
    pub strain: Gaussian<f64>,
    /// Variance added by doubts.
    pub doubted: f64,
}

impl Stated {
    /// Returns the estimate with its whole variance.
    #[must_use]
    pub const fn widened(&self) -> Gaussian<f64> {
        Gaussian { mean: self.strain.mean, variance: self.strain.variance + self.doubted }
    }
}

/// Errors of a filter at other times, inferred from strains known at single times.
///
/// The error is a Gaussian process in time. One part lasts for seconds, in units of the stated standard deviation. An offset and
/// an error of the gain last for an hour, in units of the mean stated deviation where strains are known. Their magnitude is one of
/// a few sizes, each weighted by the likelihood of the known strains (a mixture of Gaussian processes). The variance that doubts add lasts
/// with the large sizes, as a wrong R₀ does; with the small ones a known strain reduces it for seconds.
#[derive(Clone, Debug)]
pub struct KnownErrors {
    limits: StrainRange<f64>,
    strains: VecDeque<KnownStrain>,
    /// Mean of the stated variances of the known strains.
    usual: f64,
    /// One for each size.
    sizes: Vec<ErrorSize>,
}

/// Errors of one size, conditioned on the known strains.
#[derive(Clone, Debug)]
struct ErrorSize {
    size: Size,
    /// Posterior probability of this size.
    weight: f64,
    covariance: Cholesky<f64, Dyn>,
    /// Inverse covariance times known errors.
    weighted: DVector<f64>,
}

/// Time, standard deviations and lever of an estimate, which determine the covariance of its error with that of another.
#[derive(Clone, Copy)]
struct EstimatePoint {
    time_s: f64,
    sd: f64,
    /// Standard deviation of the error due to doubts.
    doubted_sd: f64,
    /// Distance from the middle of the limits, of variance one if the strain may be anywhere in them.
    lever: f64,
}

impl Size {
    /// Returns the covariance of errors at two points; `usual` is the variance to which the slow part is relative.
    fn covariance(self, usual: f64, a: EstimatePoint, b: EstimatePoint) -> f64 {
        let apart_s = (a.time_s - b.time_s).abs();
        let fast = self.fast * a.sd * b.sd * (-apart_s / FAST_S).exp();
        let lasts = (-apart_s / SLOW_S).exp() * (1.0 + GAIN * a.lever * b.lever);
        // The mean of its last factor is 1 + GAIN.
        fast + (self.slow * usual + self.doubted * a.doubted_sd * b.doubted_sd / (1.0 + GAIN)) * lasts
    }
}

impl KnownErrors {
    /// Starts before any strain is known.
    #[must_use]
    pub const fn new(limits: StrainRange<f64>) -> Self {
        Self { limits, strains: VecDeque::new(), usual: 0.0, sizes: Vec::new() }
    }

    /// Conditions the errors on known strains, the last [`MOST_KNOWN`] of them.
    #[must_use]
    pub fn of(limits: StrainRange<f64>, strains: &[KnownStrain]) -> Self {
        let last = strains.len().saturating_sub(MOST_KNOWN);
        let mut errors = Self { strains: strains[last..].iter().copied().collect(), ..Self::new(limits) };
        errors.condition();
        errors
    }

    /// Adds a known strain. The oldest of more than [`MOST_KNOWN`] is dropped.
    pub fn tell(&mut self, strain: KnownStrain) {
        if self.strains.len() == MOST_KNOWN {
            self.strains.pop_front();
        }
        self.strains.push_back(strain);
        self.condition();
    }

    /// Replaces the estimate at the time of a known strain, if it has changed since, for example after a lag.
    pub fn restate(&mut self, time_s: f64, estimated: Stated) {
        let mut is_new = false;
        for strain in self.strains.iter_mut().filter(|strain| strain.time_s == time_s) {
            (strain.estimated, is_new) = (estimated, true);
        }
        if is_new {
            self.condition();
        }
    }

    /// Returns the known strains, oldest first.
    pub fn strains(&self) -> impl Iterator<Item = &KnownStrain> {
        self.strains.iter()
    }

    /// True if no strain is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.strains.is_empty()
    }

    /// Corrects an estimate at a time by its expected error.
    #[must_use]
    pub fn correct(&self, time_s: f64, estimated: Stated) -> Gaussian<f64> {
        if self.sizes.is_empty() {
            return estimated.widened();
        }
        let here = self.place(time_s, &estimated);
        let errors = self.sizes.iter().map(|size| (size.weight, size.error(self.usual, here, self.places())));
        let errors: Vec<(f64, Gaussian<f64>)> = errors.collect();
        let mean = errors.iter().map(|(weight, error)| weight * error.mean).sum::<f64>();
        let spread = |error: &Gaussian<f64>| error.variance + (error.mean - mean).powi(2);
        let variance = errors.iter().map(|(weight, error)| weight * spread(error)).sum();
        Gaussian { mean: self.limits.clamp(estimated.strain.mean + mean), variance }
    }

    fn place(&self, time_s: f64, Stated { strain, doubted }: &Stated) -> EstimatePoint {
        let StrainRange { lower, upper } = self.limits;
        let off = (strain.mean - 0.5 * (lower + upper)) / (upper - lower);
        let lever = 12.0_f64.sqrt() * off.clamp(-FARTHEST, FARTHEST);
        EstimatePoint { time_s, sd: strain.sd(), doubted_sd: doubted.sqrt(), lever }
    }

    fn places(&self) -> impl Iterator<Item = EstimatePoint> {
        self.strains.iter().map(|strain| self.place(strain.time_s, &strain.estimated))
    }

    fn condition(&mut self) {
        if self.strains.is_empty() {
            return;
        }
        let places: Vec<EstimatePoint> = self.places().collect();
        let errors = self.strains.iter().map(|strain| strain.known.mean - strain.estimated.strain.mean);
        let errors = DVector::from_iterator(places.len(), errors);
        let usual =
            self.strains.iter().map(|strain| strain.estimated.strain.variance).sum::<f64>() / places.len() as f64;
        let given = |size: Size| {
            let noise = |row: usize| self.strains[row].known.variance;
            let of =
                |i: usize, j: usize| size.covariance(usual, places[i], places[j]) + if i == j { noise(i) } else { 0.0 };
            let covariance = Cholesky::new(DMatrix::from_fn(places.len(), places.len(), of))?;
            let weighted = covariance.solve(&errors);
            let log_determinant: f64 = covariance.l_dirty().diagonal().iter().map(|root| root.ln()).sum();
            let log_weight = size.probability.ln() - 0.5 * errors.dot(&weighted) - log_determinant;
            Some(ErrorSize { size, weight: log_weight, covariance, weighted })
        };
        let mut sizes: Vec<ErrorSize> = SIZES.into_iter().filter_map(given).collect();
        let largest = sizes.iter().map(|size| size.weight).fold(f64::NEG_INFINITY, f64::max);
        sizes.iter_mut().for_each(|size| size.weight = (size.weight - largest).exp());
        let total: f64 = sizes.iter().map(|size| size.weight).sum();
        sizes.iter_mut().for_each(|size| size.weight /= total);
        (self.usual, self.sizes) = (usual, sizes);
    }
}

impl ErrorSize {
    /// Returns the error of an estimate, given that errors are of this size.
    fn error(&self, usual: f64, here: EstimatePoint, known: impl Iterator<Item = EstimatePoint>) -> Gaussian<f64> {
        let mut nearest_s = f64::INFINITY;
        let shared = known.map(|place| {
            nearest_s = nearest_s.min((here.time_s - place.time_s).abs());
            self.size.covariance(usual, here, place)
        });
        let shared = DVector::from_iterator(self.weighted.len(), shared);
        let mean = shared.dot(&self.weighted);
        let explained = self.covariance.l_dirty().solve_lower_triangular(&shared).map_or(0.0, |row| row.norm_squared());
        let passing = (1.0 - self.size.doubted) * here.doubted_sd * here.doubted_sd;
        let passing = passing * -(-2.0 * nearest_s / FAST_S).exp_m1();
        Gaussian { mean, variance: (self.size.covariance(usual, here, here) - explained).max(0.0) + passing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: StrainRange<f64> = StrainRange { lower: 0.0, upper: 0.4 };

    fn strain(time_s: f64, known: f64, estimated: f64) -> KnownStrain {
        KnownStrain { time_s, known: Gaussian { mean: known, variance: 4e-6 }, estimated: estimate(estimated) }
    }

    fn estimate(mean: f64) -> Stated {
        Stated { strain: Gaussian { mean, variance: 4e-4 }, doubted: 0.0 }
    }

    /// Compares with the conditional distribution of two Gaussian variables for each size, and Bayes' rule; without doubts, and with some
    /// that differ between the rows.
    #[test]
    fn one_known_strain_is_conditioned_on() {
        for (doubted, later_doubted) in [(0.0, 0.0), (9e-4, 16e-4)] {
            let mut known = strain(10.0, 0.13, 0.1);
            known.estimated.doubted = doubted;
            conditioned_on(&KnownErrors::of(LIMITS, &[known]), doubted, later_doubted);
        }
    }

    fn conditioned_on(errors: &KnownErrors, doubted: f64, later_doubted: f64) {
        let (lever, later_lever) = ((12.0_f64).sqrt() * -0.25, 12.0_f64.sqrt() * 0.125);
        for later_s in [0.0, 2.0, 60.0, 5000.0] {
            let of_size = |(probability, fast, slow, lasts): (f64, f64, f64, bool)| {
                let [d, later_d, both_d] = [doubted, later_doubted, (doubted * later_doubted).sqrt()];
                let [d, later_d, both_d] =
                    [d, later_d, both_d].map(|variance| if lasts { variance / 2.0 } else { 0.0 });
                let here = 4e-4 * fast + (4e-4 * slow + d) * (1.0 + lever * lever) + 4e-6;
                let there = 1e-4 * fast + (4e-4 * slow + later_d) * (1.0 + later_lever * later_lever);
                let passing = if lasts { 0.0 } else { later_doubted * (1.0 - f64::exp(-2.0 * later_s / 3.0)) };
                let slow_now = (4e-4 * slow + both_d) * f64::exp(-later_s / 3600.0) * (1.0 + lever * later_lever);
                let both = 2e-4 * fast * f64::exp(-later_s / 3.0) + slow_now;
                let density = f64::exp(-0.5 * 0.03 * 0.03 / here) / here.sqrt();
                (probability * density, both / here * 0.03, there - both * both / here + passing)
            };
            let sizes =
                [(0.85, 0.97, 0.03, false), (0.08, 0.7, 0.3, false), (0.04, 1.0, 3.0, true), (0.03, 1.0, 30.0, true)];
            let parts = sizes.map(of_size);
            let total: f64 = parts.iter().map(|part| part.0).sum();
            let mean: f64 = parts.iter().map(|part| part.0 / total * part.1).sum();
            let variance: f64 =
                parts.iter().map(|part| part.0 / total * (part.2 + (part.1 - mean).powi(2))).sum::<f64>();
            let later = Stated { strain: Gaussian { mean: 0.25, variance: 1e-4 }, doubted: later_doubted };
            let found = errors.correct(10.0 + later_s, later);
            assert!((found.mean - 0.25 - mean).abs() < 1e-12, "{later_s} s: {found:?} {mean}");
            assert!((found.variance / variance - 1.0).abs() < 1e-9, "{later_s} s: {found:?} {variance}");
        }
    }

    /// An error as large as stated at one time does not last; the same error at eight times does.
    #[test]
    fn an_error_lasts_if_it_recurs() {
        let off = |count: usize| {
            let strains: Vec<_> = (0..count).map(|k| strain(60.0 * k as f64, 0.23, 0.2)).collect();
            let last_s = 60.0 * (count - 1) as f64;
            KnownErrors::of(LIMITS, &strains).correct(last_s + 30.0, estimate(0.2)).mean - 0.2
        };
        assert!(off(1) < 0.15 * 0.03 && off(8) > 0.7 * 0.03, "{} {}", off(1), off(8));
        // An error ten times as large as stated can only be one of another day.
        let surprising = KnownErrors::of(LIMITS, &[strain(0.0, 0.3, 0.1)]).correct(30.0, estimate(0.1));
        assert!(surprising.mean - 0.1 > 0.8 * 0.2, "{surprising:?}");
    }

    /// A gain of 0.8, inferred from two strains, corrects estimates far from them.
    #[test]
    fn two_strains_tell_the_gain() {
        let strains = [(0.05, 0.1), (0.29, 0.4)].map(|(known, estimated)| strain(1000.0 * known, known, estimated));
        let errors = KnownErrors::of(LIMITS, &strains);
        for mean in [0.15, 0.25, 0.35] {
            let expected = 0.05 + 0.8 * (mean - 0.1);
            let found = errors.correct(600.0, estimate(mean));
            assert!((found.mean - expected).abs() < 0.3 * (mean - expected).abs(), "{mean}: {found:?} {expected}");
        }
    }

    /// Tests that only the last strains count, whether given one by one or all at once.
    #[test]
    fn the_last_ones_count() {
        let strains: Vec<_> = (0..40).map(|k| strain(20.0 * f64::from(k), 0.2, 0.2 + 0.001 * f64::from(k))).collect();
        let mut errors = KnownErrors::new(LIMITS);
        assert!(errors.is_empty() && errors.correct(3.0, estimate(0.1)) == estimate(0.1).widened());
        assert_eq!(KnownErrors::of(LIMITS, &[]).correct(3.0, estimate(0.1)), estimate(0.1).widened());
        strains.iter().for_each(|strain| errors.tell(*strain));
        let at_once = KnownErrors::of(LIMITS, &strains[40 - MOST_KNOWN..]);
        assert_eq!(errors.correct(900.0, estimate(0.3)), at_once.correct(900.0, estimate(0.3)));
        assert_eq!(
            errors.correct(900.0, estimate(0.3)),
            KnownErrors::of(LIMITS, &strains).correct(900.0, estimate(0.3))
        );
        // An estimate is replaced later.
        let mut restated = strains.clone();
        restated[30].estimated.strain.mean = 0.1;
        errors.restate(600.0, estimate(0.1));
        assert_eq!(
            errors.correct(900.0, estimate(0.3)),
            KnownErrors::of(LIMITS, &restated).correct(900.0, estimate(0.3))
        );
    }
}
