use ohmstrain_model::{Scalar, StrainRange};

pub use crate::belief::tail::Real;
use crate::belief::tail::upper_tail;
use crate::kernel::Lanes;

/// A Gaussian in one dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gaussian<T> {
    /// Mean.
    pub mean: T,
    /// Variance, not negative.
    pub variance: T,
}

impl<T: Scalar> Gaussian<T> {
    /// The same in all lanes, of which there are as many as here.
    #[inline(always)]
    pub(crate) fn in_lanes<V: Lanes<Number = T>>(self, like: V) -> Gaussian<V> {
        Gaussian { mean: like.with(self.mean), variance: like.with(self.variance) }
    }
}

impl<T: Real> Gaussian<T> {
    /// Probability of a value above `x`.
    #[must_use]
    pub fn probability_above(&self, x: T) -> T {
        if self.variance <= T::zero() {
            return if self.mean > x { T::one() } else { T::zero() };
        }
        upper_tail((x - self.mean) / self.variance.sqrt())
    }

    /// The same Gaussian with its mean moved into a range.
    ///
    /// For reports: the moments of the restricted Gaussian are drawn off the limit, which at rest on a limit is a bias.
    #[must_use]
    pub fn clamped(&self, range: &StrainRange<T>) -> Self {
        Self { mean: range.clamp(self.mean), variance: self.variance }
    }
}
