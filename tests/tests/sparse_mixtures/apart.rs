//! How far a sparse filter's step is from the generic one's.

use ohmstrain_ekf::{Mixture, MixtureResidual, MixtureStep, Real};
use ohmstrain_model::Phase;

/// The largest differences of a run.
#[derive(Debug, Default)]
pub struct Apart {
    /// Of means in deviations of the prediction in the same phase, of covariances relative to its diagonals.
    belief: f64,
    /// The same of the mixture as a whole.
    whole: f64,
    /// Whether hypotheses are not compared one by one.
    whole_only: bool,
    /// Of probabilities, and of logarithms of the density of the reading.
    weight: f64,
    density: f64,
    /// Of the innovation in deviations, and of its variance relative to itself.
    innovation: f64,
    /// How many hypotheses there were at most.
    pub hypotheses: usize,
}

fn number<T: Real>(x: T) -> f64 {
    x.to_subset().unwrap_or(f64::NAN)
}

fn larger(most: &mut f64, apart: f64) {
    // A NaN must not hide behind `max`.
    *most = if apart.is_nan() || apart > *most { apart } else { *most };
}

/// The largest deviations that a phase predicts; the whole mixture's if none of its hypotheses counts without a reading.
fn deviations<T: Real, const N: usize, const L: usize, const K: usize>(
    prediction: &Mixture<T, N, L, K>,
    phase: Phase,
) -> [f64; N] {
    let all = prediction.moments();
    let mut most = [0.0_f64; N];
    let of_phase = prediction.components().iter().filter(|component| component.phase == phase);
    for belief in of_phase.map(|component| &component.belief).chain([&all]) {
        for (i, most) in most.iter_mut().enumerate() {
            *most = most.max(number(belief.covariance[(i, i)]).sqrt());
        }
    }
    most
}

impl Apart {
    /// Nothing yet; hypotheses are compared one by one, or only what they are together.
    pub fn new(whole_only: bool) -> Self {
        Self { whole_only, ..Self::default() }
    }

    pub fn add<T: Real, const N: usize, const L: usize, const K: usize>(
        &mut self,
        sparse: &Mixture<T, N, L, K>,
        residual: Option<MixtureResidual<T>>,
        generic: &MixtureStep<T, N, L, K>,
        prediction: &Mixture<T, N, L, K>,
    ) {
        let (whole, of_whole) = (sparse.moments(), generic.posterior.moments());
        let all = prediction.moments();
        for i in 0..N {
            let sd = number(all.covariance[(i, i)]).sqrt();
            larger(&mut self.whole, number(whole.mean[i] - of_whole.mean[i]).abs() / sd);
            larger(&mut self.whole, number(whole.covariance[(i, i)] - of_whole.covariance[(i, i)]).abs() / (sd * sd));
        }
        self.add_residual(residual, generic);
        let of_generic = generic.posterior.components();
        self.hypotheses = self.hypotheses.max(of_generic.len());
        if self.whole_only {
            return;
        }
        assert_eq!(sparse.components().len(), of_generic.len());
        for (a, b) in sparse.components().iter().zip(of_generic) {
            assert_eq!(a.phase, b.phase);
            larger(&mut self.weight, number(a.log_weight.exp() - b.log_weight.exp()).abs());
            let sd = deviations(prediction, a.phase);
            for i in 0..N {
                larger(&mut self.belief, number(a.belief.mean[i] - b.belief.mean[i]).abs() / sd[i]);
                for j in 0..=i {
                    let apart = number(a.belief.covariance[(i, j)] - b.belief.covariance[(i, j)]).abs();
                    larger(&mut self.belief, apart / (sd[i] * sd[j]));
                }
            }
        }
    }

    fn add_residual<T: Real, const N: usize, const L: usize, const K: usize>(
        &mut self,
        residual: Option<MixtureResidual<T>>,
        generic: &MixtureStep<T, N, L, K>,
    ) {
        assert_eq!(residual.is_some(), generic.innovation.is_some());
        if let (Some(of_sparse), Some(innovation)) = (residual, generic.innovation) {
            let (residual, variance) = (of_sparse.residual, number(innovation.variance));
            larger(&mut self.innovation, number(residual.innovation - innovation.value).abs() / variance.sqrt());
            larger(&mut self.innovation, (number(residual.variance) / variance - 1.0).abs());
            larger(&mut self.density, number(of_sparse.log_likelihood() - generic.log_likelihood).abs());
        }
    }

    /// `rounding`: of the beliefs. A hypothesis that counts lies within √24 deviations of the reading (e⁻¹² of the best is
    /// dropped), so that half its NIS, and with it its weight, is uncertain by that times the uncertainty of its innovation
    /// in deviations; a variance of several hypotheses contains their squares. A merged hypothesis lies between distant ones
    /// by their weights, and is uncertain by both.
    pub fn check(&self, rounding: f64) {
        let weighed = 24_f64.sqrt() * rounding;
        assert!(self.belief < rounding + weighed && self.whole < rounding + weighed, "{self:?}");
        assert!(self.weight < weighed && self.density < weighed && self.innovation < weighed, "{self:?}");
    }
}
