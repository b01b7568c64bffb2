use crate::Recordable;

/// How much larger a filter's innovations have been of late than it states them: the mean of their normalised squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovations<T> {
    pub(crate) mean: T,
}

impl<T: Recordable> Innovations<T> {
    /// For how long they count, s: after so long 37 % of the mean are left.
    pub const LAST_S: f64 = 20.0;
    /// As much as a normalised innovation squared counts: one alone is an outlier, not a law that does not fit.
    pub const MOST: f64 = 30.0;

    /// Before any.
    #[must_use]
    pub fn none() -> Self {
        Self { mean: T::zero() }
    }

    /// Takes the normalised innovation squared of a reading, `dt_s` seconds after the reading before.
    pub fn step(&mut self, dt_s: T, nis: T) {
        self.see((-dt_s / T::of(Self::LAST_S)).exp(), nis);
    }

    /// Takes a normalised innovation squared, where `left` is the share of what was known before that is left.
    pub fn see(&mut self, left: T, nis: T) {
        self.mean += (T::one() - left) * (nis.min(T::of(Self::MOST)) - self.mean);
    }

    /// By how much what the filter states is multiplied, as of a weighted mean (Birge, *Phys. Rev.* 40 (1932) 207); never less than
    /// one.
    #[must_use]
    pub fn birge(&self) -> T {
        self.mean.max(T::one())
    }
}
