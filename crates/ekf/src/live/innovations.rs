use crate::Recordable;

/// Recent size of a filter's innovations relative to the stated one: the mean of their normalised squares.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Innovations<T> {
    pub(crate) mean: T,
}

impl<T: Recordable> Innovations<T> {
    /// Cap on a normalised innovation squared, so that a single outlier does not count as a misfit of the law.
    pub const MOST: f64 = 30.0;

    /// Starts before any innovation.
    #[must_use]
    pub fn none() -> Self {
        Self { mean: T::zero() }
    }

    /// Takes a normalised innovation squared; `left` is the remaining weight of the previous mean.
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
