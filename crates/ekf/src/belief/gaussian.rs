use ohmstrain_model::{Number, StrainRange};

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

impl<T: Number> Gaussian<T> {
    /// Returns the same Gaussian with its mean clamped to a range.
    ///
    /// For reports only. The moments of a truncated Gaussian are pulled away from the limit, which is a bias for a body
    /// at rest on a limit.
    #[must_use]
    pub fn clamped(&self, range: &StrainRange<T>) -> Self {
        Self { mean: range.clamp(self.mean), variance: self.variance }
    }
}
