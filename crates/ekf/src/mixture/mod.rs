mod children;
mod estimator;
pub(crate) mod evidence;
mod hypotheses;
mod imm;
mod imm_smoother;
mod lineage;
mod mixing;
pub(crate) mod pair;
mod pause;
mod predicted;
mod retry;
pub(crate) mod sign_split;
pub(crate) mod spawn;
mod state;
mod switching;

pub use evidence::{Evidence, MixtureResidual};
pub use hypotheses::Hypotheses;
pub use imm::Imm;
pub use sign_split::SignSplit;
pub use state::{Mixture, PhaseMixture, Share};
pub use switching::Dwell;

use nalgebra::SVector;
use ohmstrain_model::{Scalar, Symmetric};

use crate::{Belief, Gaussian};

/// Place of a hypothesis after it was added.
#[derive(Clone, Copy)]
pub(crate) enum Added {
    /// This place, alone or merged with its previous content.
    To(usize),
    /// The first place; its previous content was merged into the second, or dropped because it is negligible or no
    /// other is of its phase.
    InsteadOf(usize, Option<usize>),
    /// No place: it is not heavier than any kept hypothesis, and it is negligible or none of those is of its phase.
    Nowhere,
}

/// Threshold below which two hypotheses of one phase are merged: squared distance of their strains plus that of their rates,
/// each in units of the larger variance.
pub(crate) const ALIKE: f64 = 0.5;
/// Fraction of the heaviest weight, e⁻¹², below which hypotheses are dropped.
pub(crate) const LEAST_WEIGHT: f64 = 6.144_212_353_328_21e-6;
/// Relative difference of two weights up to which neither hypothesis counts as lighter: directions after a hold are
/// equally likely, and rounding must not decide.
pub(crate) const LIGHTER: f64 = 1e-4;
/// Smallest probability of the limits, for a hypothesis far outside.
pub(crate) const LEAST_INSIDE: f64 = 1e-9;

/// Returns mean and covariance of a mixture of Gaussians whose weights sum to one.
pub(crate) fn moment_match<'a, T: Scalar, const N: usize, const L: usize>(
    weighted: impl Iterator<Item = (T, &'a Belief<T, N, L>)> + Clone,
) -> Belief<T, N, L> {
    let mean = weighted.clone().fold(SVector::zeros(), |sum, (weight, belief)| sum + belief.mean * weight);
    let mut covariance = Symmetric::zeros();
    for (weight, belief) in weighted {
        covariance = covariance.plus(&belief.covariance.scaled(weight));
        covariance.add_outer(&(belief.mean - mean), weight);
    }
    Belief { mean, covariance }
}

/// Returns mean and variance of one component of the state.
pub(crate) fn marginal_match<'a, T: Scalar, const N: usize, const L: usize>(
    weighted: impl Iterator<Item = (T, &'a Belief<T, N, L>)> + Clone,
    index: usize,
) -> Gaussian<T> {
    let mean = weighted.clone().fold(T::zero(), |sum, (weight, belief)| sum + weight * belief.mean[index]);
    let mut variance = T::zero();
    for (weight, belief) in weighted {
        let apart = belief.mean[index] - mean;
        variance += weight * (belief.covariance[(index, index)] + apart * apart);
    }
    Gaussian { mean, variance }
}

#[cfg(test)]
mod tests;
