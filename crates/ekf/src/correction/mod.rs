//! The learned correction: strain from a filter's outputs and the readings' recent past, by two Gaussian processes.
//!
//! The law's error is systematic, and what it leaves of the strain can be learned from the rows that a sensor was
//! calibrated on. A *direct* process says strain from features of the readings alone; a *residual* process says what the
//! filter's strain lacks, from what the filter says and the same features. A smoother has two more direct processes, one
//! of the readings' past and one of their future: neither is as easily led astray by a motion that begins as a known one
//! and ends as none. The result is the [`mixture`] of all. Far from the training rows the residual process says what the
//! filter says, its variance is no smaller than the filter's, and the result's grows.
//!
//! # Policy
//! - Configuration, borrowed as slices that may lie in flash, is apart from state ([`ReadingFeatures`]); no heap, no panic.
//! - Inputs are moved into the range of the training rows; how far they were outside makes the variance grow. Numbers that
//!   are not finite come from nowhere but a filter that has failed, and give a result that is not finite.
//! - With n rows of D inputs, m inducing rows and p processes a correction costs about n (3 D + p exp) + p m²/2
//!   multiplications.

mod features;
mod low_pass;
mod process;

use ohmstrain_model::StrainRange;

use crate::{Gaussian, Real};
pub use features::{
    FARTHEST, FEATURES, FeatureScale, PASSED_OVER, RATE_GAIN, ReadingFeatures, Starts, TIME_CONSTANTS_S, settled,
};
pub use low_pass::LowPass;
use process::{Kernels, Said};
pub use process::{LINEAR, Process, kernel};

/// Number of a filter's outputs that a correction sees: strain, its rate, relaxation, baseline, and the probabilities of
/// stretching and releasing.
pub const OUTPUTS: usize = 6;
/// Most inducing rows.
pub const INDUCING: usize = 48;

/// Variance per square of a standardised input's distance from the training range, in variances of the strain.
pub const FAR: f64 = 0.03;
/// Variance of a result whose inputs are nothing like the training rows, in variances of the strain, on top of all else.
pub const NOVEL: f64 = 0.06;
/// Squared distance from the training range beyond which an input is new, in squared standard deviations.
pub const NEW: f64 = 5.0;

/// Where an input lay in the training rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputScale<T> {
    /// Mean.
    pub mean: T,
    /// Standard deviation, positive.
    pub sd: T,
    /// Smallest.
    pub lower: T,
    /// Largest.
    pub upper: T,
}

/// A learned correction with D inputs: the filter's [`OUTPUTS`], then features of the readings, those of their future last.
/// S is 2 if it has one-sided processes, a smoother's, and 0 otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, T, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first are the inducing rows, at most [`INDUCING`].
    pub rows: &'a [[T; D]],
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// Strain from all features.
    pub direct: Process<'a, T>,
    /// Strain from the features of the past, and strain from the reading and the features of the future.
    pub one_sided: [Process<'a, T>; S],
    /// Strain minus the filter's strain, from all inputs.
    pub residual: Process<'a, T>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance, from training rows left out.
    pub variance_factor: T,
}

/// A corrected strain and what it was made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected<T, const S: usize = 0> {
    /// The result.
    pub strain: Gaussian<T>,
    /// What the direct process says.
    pub direct: Gaussian<T>,
    /// What the one-sided processes say.
    pub one_sided: [Gaussian<T>; S],
    /// What filter and residual process say together.
    pub residual: Gaussian<T>,
    /// How little the inputs resemble the training rows, 0 to 1.
    pub novelty: T,
}

/// An input on the scale of the training rows.
struct Standardised<T, const D: usize> {
    inputs: [T; D],
    /// From the training range.
    outside: SquaredDistance<T>,
}

/// A squared distance of inputs, in parts.
struct SquaredDistance<T> {
    outputs: T,
    reading: T,
    /// With the reading.
    past: T,
    /// Without it.
    future: T,
}

impl<T: Real> SquaredDistance<T> {
    fn new(mut squares: impl Iterator<Item = T>) -> Self {
        let sum = |sum: T, square: T| sum + square;
        let outputs = squares.by_ref().take(OUTPUTS).fold(T::zero(), sum);
        let reading = squares.next().unwrap_or(T::zero());
        let past = squares.by_ref().take(FEATURES - 1).fold(reading, sum);
        Self { outputs, reading, past, future: squares.fold(T::zero(), sum) }
    }

    fn of_features(&self) -> T {
        self.past + self.future
    }

    fn of_all(&self) -> T {
        self.outputs + self.of_features()
    }

    /// Of what the one-sided processes see.
    fn of_sides(&self) -> [T; 2] {
        [self.past, self.reading + self.future]
    }
}

impl<T: Real, const D: usize, const S: usize> Correction<'_, T, D, S> {
    /// Corrects the strain of a filter. `inputs` are the filter's outputs, the strain first, and the features of the
    /// readings; `filtered` is the filter's strain with its deviation.
    #[must_use]
    pub fn correct(&self, inputs: &[T; D], filtered: Gaussian<T>) -> Corrected<T, S> {
        let Standardised { inputs: x, outside } = self.standardised(inputs);
        let (mut direct, mut residual) = (Kernels::new(&self.direct), Kernels::new(&self.residual));
        let mut sides = self.one_sided.each_ref().map(Kernels::new);
        let of_residual =
            Process { least_variance: self.residual.least_variance.max(filtered.variance), ..self.residual };
        let (reading, strain) = (x.get(OUTPUTS).copied().unwrap_or(T::zero()), x[0]);
        for row in self.rows {
            let distance = SquaredDistance::new(x.iter().zip(row).map(|(a, b)| (*a - *b) * (*a - *b)));
            let readings = reading * row.get(OUTPUTS).copied().unwrap_or(T::zero());
            direct.add(&self.direct, distance.of_features(), readings);
            for ((kernels, process), square) in sides.iter_mut().zip(&self.one_sided).zip(distance.of_sides()) {
                kernels.add(process, square, readings);
            }
            residual.add(&self.residual, distance.of_all(), strain * row[0]);
        }
        let direct = self.widened(direct.said(&self.direct, reading), &self.direct, outside.of_features(), T::zero());
        let mut of_sides = self.one_sided.iter().zip(outside.of_sides());
        let one_sided = sides.map(|kernels| match of_sides.next() {
            Some((process, outside)) => self.widened(kernels.said(process, reading), process, outside, T::zero()),
            None => direct,
        });
        let said = residual.said(&of_residual, strain);
        let novelty = T::one() - (T::one() - said.unknown) * (-outside.of_all() / T::of(NEW)).exp();
        let residual = self.widened(said, &self.residual, outside.of_all(), filtered.mean);
        let mixed = mixture([direct, residual].into_iter().chain(one_sided));
        let variance = mixed.variance * self.variance_factor + T::of(NOVEL) * self.strain_variance * novelty;
        Corrected { strain: Gaussian { mean: mixed.mean, variance }, direct, one_sided, residual, novelty }
    }

    fn standardised(&self, inputs: &[T; D]) -> Standardised<T, D> {
        let (mut x, mut excess) = ([T::zero(); D], [T::zero(); D]);
        for ((x, excess), (input, scale)) in x.iter_mut().zip(&mut excess).zip(inputs.iter().zip(self.scales)) {
            let inside = input.max(scale.lower).min(scale.upper);
            *x = (inside - scale.mean) / scale.sd;
            *excess = (*input - inside) / scale.sd;
        }
        Standardised { inputs: x, outside: SquaredDistance::new(excess.into_iter().map(|excess| excess * excess)) }
    }

    /// A process' strain on top of `base`, within the limits, with all that its variance gets.
    fn widened(&self, said: Said<T>, process: &Process<'_, T>, outside: T, base: T) -> Gaussian<T> {
        let variance = said.strain.variance * process.widening + T::of(FAR) * self.strain_variance * outside;
        Gaussian { mean: self.limits.clamp(base + said.strain.mean), variance }
    }
}

/// Mean and variance of the mixture of Gaussians, each weighted by its variance to the power −3/2: more than the inverse
/// variance that is due to independent voices, since several may be wrong together, and the surest is the least so. One that is
/// exact is all that counts; nothing mixed is exactly zero.
#[must_use]
pub fn mixture<T: Real>(voices: impl IntoIterator<Item = Gaussian<T>, IntoIter: Clone>) -> Gaussian<T> {
    let voices = voices.into_iter();
    let none = Gaussian { mean: T::zero(), variance: T::zero() };
    let surest = voices.clone().reduce(|a, b| if b.variance < a.variance { b } else { a }).unwrap_or(none);
    if surest.variance <= T::zero() {
        return surest;
    }
    let weighted = |voice: Gaussian<T>| {
        let ratio = surest.variance / voice.variance;
        (ratio * ratio.sqrt(), voice)
    };
    let weighted = voices.map(weighted);
    let total = weighted.clone().fold(T::zero(), |sum, (weight, _)| sum + weight);
    let mean = weighted.clone().fold(T::zero(), |sum, (weight, voice)| sum + weight / total * voice.mean);
    let spread = |voice: Gaussian<T>| voice.variance + (voice.mean - mean) * (voice.mean - mean);
    let variance = weighted.fold(T::zero(), |sum, (weight, voice)| sum + weight / total * spread(voice));
    Gaussian { mean, variance }
}
