use crate::Recordable;

/// Recent size of a filter's innovations against the stated one: the mean of their normalised squares.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovations<T> {
    pub(crate) mean: T,
}

impl<T: Recordable> Innovations<T> {
    /// Cap on a normalised innovation squared: a single outlier is not a law that does not fit.
    pub const MOST: f64 = 30.0;

    /// Starts before any innovation.
    #[must_use]
    pub fn none() -> Self {
        Self { mean: T::zero() }
    }

    /// Takes a normalised innovation squared, where `left` is the share of what was known before that is left.
    pub fn see(&mut self, left: T, nis: T) {
        self.mean += (T::one() - left) * (nis.min(T::of(Self::MOST)) - self.mean);
    }

    /// Returns the factor on the filter's variance, as of a weighted mean (Birge, *Phys. Rev.* 40 (1932) 207); never less than
    /// one.
    #[must_use]
    pub fn birge(&self) -> T {
        self.mean.max(T::one())
    }
}
