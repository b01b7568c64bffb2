use crate::mixture::sign_split::LEAST_MASS;
use crate::mixture::{LEAST_WEIGHT, LIGHTER};
use crate::substeps::GRACE;
use crate::{Curve, Gaussian, Hypotheses, SignSplit, Switch};

/// Numbers of a filter of hypotheses besides those of the kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureNumbers {
    /// Initial rate of each phase.
    pub fresh: [Gaussian<f32>; 3],
    /// Power to which a reading's likelihood enters the weights.
    pub tempering: f32,
    /// Time without a reading, s, after which the direction is open; infinite if it never is.
    pub forgets_direction_s: f32,
}

/// Numbers common to all filters of hypotheses.
pub mod shared {
    use super::{LEAST_MASS, LEAST_WEIGHT, LIGHTER};

    /// Fraction of the heaviest weight below which hypotheses are dropped.
    pub const LEAST_WEIGHT_KEPT: f32 = LEAST_WEIGHT as f32;
    /// Ratio of two weights below which one hypothesis counts as lighter.
    pub const NOT_LIGHTER: f32 = (1.0 - LIGHTER) as f32;
    /// Smallest probability mass left by a truncation.
    pub const LEAST_MASS_LEFT: f32 = LEAST_MASS as f32;
}

impl<const B: usize, const N: usize, const K: usize, S: Switch<f32>, G: Curve<f32>> SignSplit<f32, B, N, K, S, G> {
    /// Returns the numbers besides those of the kernel.
    #[must_use]
    pub fn numbers(&self) -> MixtureNumbers {
        let forgets = self.forgets_direction_s * GRACE as f32;
        MixtureNumbers { fresh: self.fresh, tempering: self.weighing.tempering(), forgets_direction_s: forgets }
    }

    /// Returns the filter of each hypothesis.
    #[must_use]
    pub const fn kernel(&self) -> &crate::SparseEkf<f32, S, B, N, G> {
        &self.kernel
    }
}

impl<const B: usize, const N: usize, const K: usize, S: Switch<f32>, G: Curve<f32>> Hypotheses<f32, B, N, K, S, G> {
    /// Returns the numbers besides those of the kernel.
    #[must_use]
    pub fn numbers(&self) -> MixtureNumbers {
        let tempering = self.weighing.tempering();
        MixtureNumbers { fresh: self.fresh, tempering, forgets_direction_s: f32::INFINITY }
    }

    /// Returns the filter of each history.
    #[must_use]
    pub const fn kernel(&self) -> &crate::SparseEkf<f32, S, B, N, G> {
        &self.kernel
    }
}
