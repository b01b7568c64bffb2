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
    /// The same Gaussian with its mean moved into a range.
    ///
    /// For reports: the moments of the restricted Gaussian are drawn off the limit, which at rest on a limit is a bias.
    #[must_use]
    pub fn clamped(&self, range: &StrainRange<T>) -> Self {
        Self { mean: range.clamp(self.mean), variance: self.variance }
    }
}
