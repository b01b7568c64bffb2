//! The learned correction: strain from a filter's outputs and the readings' recent past, by two Gaussian processes.
//!
//! The law's error is systematic, and what it leaves of the strain can be learned from the rows that a sensor was
//! calibrated on. A *direct* process says strain from features of the readings alone; a *residual* process says what the
//! filter's strain lacks, from what the filter says and the same features. The result is their mixture, each weighted by
//! its variance to the power −3/4. Far from the training rows the residual process says what the filter says, its variance
//! is no smaller than the filter's, and the result's grows.
//!
//! # Policy
//! - Configuration, borrowed as slices that may lie in flash, is apart from state ([`ReadingFeatures`]); no heap, no panic.
//! - Inputs are moved into the range of the training rows; how far they were outside makes the variance grow. Numbers that
//!   are not finite come from nowhere but a filter that has failed, and give a result that is not finite.
//! - With n rows of D inputs and m inducing rows a correction costs about n (3 D + 2 exp) + m² multiplications.

mod features;
mod low_pass;
mod process;

use ohmstrain_model::StrainRange;

use crate::{Gaussian, Real};
pub use features::{FARTHEST, FEATURES, FeatureScale, RATE_GAIN, ReadingFeatures, Starts, TIME_CONSTANTS_S, settled};
pub use low_pass::LowPass;
use process::{Kernels, Said};
pub use process::{LINEAR, Process};

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

/// A learned correction with D inputs: the filter's [`OUTPUTS`], then features of the readings.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, T, const D: usize> {
    /// Standardised inputs of the training rows; the first are the inducing rows, at most [`INDUCING`].
    pub rows: &'a [[T; D]],
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// Strain from the features.
    pub direct: Process<'a, T>,
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
pub struct Corrected<T> {
    /// The result.
    pub strain: Gaussian<T>,
    /// What the direct process says.
    pub direct: Gaussian<T>,
    /// What filter and residual process say together.
    pub residual: Gaussian<T>,
    /// How little the inputs resemble the training rows, 0 to 1.
    pub novelty: T,
}

/// An input on the scale of the training rows.
struct Standardised<T, const D: usize> {
    inputs: [T; D],
    /// Squared distance from the training range of the filter's outputs, and of the features.
    outside: [T; 2],
}

impl<T: Real, const D: usize> Correction<'_, T, D> {
    /// Corrects the strain of a filter. `inputs` are the filter's outputs, the strain first, and the features of the
    /// readings; `filtered` is the filter's strain with its deviation.
    #[must_use]
    pub fn correct(&self, inputs: &[T; D], filtered: Gaussian<T>) -> Corrected<T> {
        let Standardised { inputs: x, outside: [of_outputs, of_features] } = self.standardised(inputs);
        let (mut direct, mut residual) = (Kernels::new(&self.direct), Kernels::new(&self.residual));
        let of_residual =
            Process { least_variance: self.residual.least_variance.max(filtered.variance), ..self.residual };
        let (reading, strain) = (x.get(OUTPUTS).copied().unwrap_or(T::zero()), x[0]);
        for row in self.rows {
            let squared = |(a, b): (&T, &T)| (*a - *b) * (*a - *b);
            let mut squares = x.iter().zip(row).map(squared);
            let outputs = squares.by_ref().take(OUTPUTS).fold(T::zero(), |sum, square| sum + square);
            let features = squares.fold(T::zero(), |sum, square| sum + square);
            direct.add(&self.direct, features, reading * row.get(OUTPUTS).copied().unwrap_or(T::zero()));
            residual.add(&self.residual, outputs + features, strain * row[0]);
        }
        let direct = self.widened(direct.said(&self.direct, reading), &self.direct, of_features, T::zero());
        let said = residual.said(&of_residual, strain);
        let outside = of_outputs + of_features;
        let novelty = T::one() - (T::one() - said.unknown) * (-outside / T::of(NEW)).exp();
        let residual = self.widened(said, &self.residual, outside, filtered.mean);
        let mixed = mixture(direct, residual);
        let variance = mixed.variance * self.variance_factor + T::of(NOVEL) * self.strain_variance * novelty;
        Corrected { strain: Gaussian { mean: mixed.mean, variance }, direct, residual, novelty }
    }

    fn standardised(&self, inputs: &[T; D]) -> Standardised<T, D> {
        let (mut x, mut outside) = ([T::zero(); D], [T::zero(); 2]);
        for (place, ((x, input), scale)) in x.iter_mut().zip(inputs).zip(self.scales).enumerate() {
            let inside = input.max(scale.lower).min(scale.upper);
            *x = (inside - scale.mean) / scale.sd;
            let excess = (*input - inside) / scale.sd;
            outside[usize::from(place >= OUTPUTS)] += excess * excess;
        }
        Standardised { inputs: x, outside }
    }

    /// A process' strain on top of `base`, within the limits, with all that its variance gets.
    fn widened(&self, said: Said<T>, process: &Process<'_, T>, outside: T, base: T) -> Gaussian<T> {
        let variance = said.strain.variance * process.widening + T::of(FAR) * self.strain_variance * outside;
        Gaussian { mean: self.limits.clamp(base + said.strain.mean), variance }
    }
}

/// Mean and variance of the mixture of two Gaussians, each weighted by its variance to the power −3/4: less than the
/// inverse variance that is due to independent voices, since the two are wrong together at times.
#[must_use]
pub fn mixture<T: Real>(a: Gaussian<T>, b: Gaussian<T>) -> Gaussian<T> {
    if a.variance <= T::zero() || b.variance <= T::zero() {
        return if a.variance <= b.variance { a } else { b };
    }
    let ratio = (a.variance / b.variance).sqrt();
    let odds = ratio * ratio.sqrt();
    let of_b = if odds > T::one() { T::one() / (T::one() + T::one() / odds) } else { odds / (T::one() + odds) };
    let of_a = T::one() - of_b;
    let mean = of_a * a.mean + of_b * b.mean;
    let spread = |voice: Gaussian<T>| voice.variance + (voice.mean - mean) * (voice.mean - mean);
    Gaussian { mean, variance: of_a * spread(a) + of_b * spread(b) }
}
