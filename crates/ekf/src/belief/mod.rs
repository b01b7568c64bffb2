mod gaussian;
pub(crate) mod psd;
mod start;

pub use gaussian::Gaussian;
pub use start::{BeliefOf, Start};

use nalgebra::SVector;
use ohmstrain_model::{Scalar, SwitchedModel, Symmetric};

/// Mean and covariance of the state, a Gaussian distribution. `L = N (N + 1) / 2`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "T: Scalar + serde::Serialize", deserialize = "T: Scalar + serde::Deserialize<'de>"))
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Belief<T, const N: usize, const L: usize> {
    /// Mean x̂.
    pub mean: SVector<T, N>,
    /// Covariance P.
    pub covariance: Symmetric<T, N, L>,
}

impl<T: Scalar, const N: usize, const L: usize> Belief<T, N, L> {
    /// Builds a belief of independent components with the given means and variances; a variance of zero means exactly
    /// known.
    #[must_use]
    pub fn independent(mean: SVector<T, N>, variance: &[T; N]) -> Self {
        Self { mean, covariance: Symmetric::from_diagonal(variance) }
    }

    /// Returns the belief before any reading: the model's long-run distribution.
    #[must_use]
    pub fn initial<const B: usize>(model: &SwitchedModel<T, B, N>) -> Self {
        let (mean, variance) = model.initial_distribution();
        Self::independent(mean, &variance)
    }

    /// True if every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.mean.iter().all(|x| x.is_finite()) && self.covariance.is_finite()
    }
}
