//! Faults that begin and end with a jump of the readings: a loose contact, a wrong gain or polarity.

use super::Sieve;
use crate::Recordable;

/// Longest time from one jump to the jump back, s, for which the readings in between are a fault.
const LONGEST_S: f64 = 30.0;
/// Shortest such time, s. Readings that jump back earlier are noise or spikes.
const SHORTEST_S: f64 = 1.0;
/// Time after which the kept state is renewed, s.
const RENEWED_S: f64 = 0.5;
/// Largest age of the kept state at the beginning of a fault, s. It is older where readings surprise for longer.
const OLDEST_S: f64 = 2.0;
/// Smallest jump back, as a fraction of the first jump.
const LEAST_BACK: f64 = 0.25;
/// Time since a fault began, and since the state was kept, s, if there is none.
const NEVER_S: f64 = 1e9;

/// Watch for a fault that ends. The filter keeps a copy of its state, renewed every half second while readings do not surprise. If
/// readings jump, and jump back after 1 to 30 s, it continues from the copy, as if the readings in between were missing. Times count
/// from the second reading after the jump, when the filter notices it.
///
/// R₀ does not follow readings during a fault.
///
/// ```
/// use ohmstrain_ekf::live::{FaultWatch, Sieve};
///
/// let sieve = Sieve { jump: 0.1, ..Sieve::open() };
/// let mut watch = FaultWatch::<f64>::new();
/// // Readings every 0.5 s, and a jump of 2 that a filter notices at the second reading.
/// for (reading, jumped) in [(0.5, None), (2.5, None), (2.6, Some(2.1)), (2.55, None)] {
///     assert!(!watch.is_over(0.5, reading, &sieve));
///     watch.pass(0.5);
///     watch.see(reading, jumped, true, sieve.jump);
///     assert_eq!(reading == 0.5, jumped.is_none() && reading < 1.0 && watch.is_due());
/// }
/// assert!(watch.is_fault() && watch.is_over(0.5, 0.6, &sieve));
/// // No jump, one in the same direction, a small one, and one too late.
/// for (dt_s, reading) in [(0.5, 2.45), (0.5, 4.5), (0.5, 2.2), (30.0, 0.6)] {
///     assert!(!watch.is_over(dt_s, reading, &sieve), "{dt_s} {reading}");
/// }
/// ```
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultWatch<T> {
    /// The last reading that was used, R/R₀ - 1 with the calibrated R₀, and its difference from the one before.
    pub(crate) last: Option<T>,
    pub(crate) moved: T,
    /// The jump with which a fault began, zero for an implausible reading or none.
    pub(crate) jump: T,
    /// Time since a fault began, s.
    pub(crate) began_s: T,
    /// Time since the filter's state was kept, s.
    pub(crate) kept_s: T,
}

impl<T: Recordable> FaultWatch<T> {
    /// Starts before any reading.
    #[must_use]
    pub fn new() -> Self {
        Self { last: None, moved: T::zero(), jump: T::zero(), began_s: T::of(NEVER_S), kept_s: T::of(NEVER_S) }
    }

    /// Advances by `dt_s` seconds.
    pub fn pass(&mut self, dt_s: T) {
        self.kept_s += dt_s;
        self.began_s += dt_s;
    }

    /// True for 30 s after a fault began, unless it has ended.
    #[must_use]
    pub fn is_fault(&self) -> bool {
        self.began_s <= T::of(LONGEST_S)
    }

    /// True if a fault ends with the reading `dt_s` seconds from now: it is plausible, and readings jump back to it.
    #[must_use]
    pub fn is_over(&self, dt_s: T, reading: T, sieve: &Sieve<T>) -> bool {
        let (lasted_s, age_s, (lower, upper)) = (self.began_s + dt_s, self.kept_s - self.began_s, sieve.plausible);
        self.last.is_some_and(|last| self.is_back(reading - last, sieve.jump))
            && (T::of(SHORTEST_S) <= lasted_s && lasted_s <= T::of(LONGEST_S) && age_s <= T::of(OLDEST_S))
            && (lower <= reading && reading <= upper)
    }

    /// Takes a reading that was used; `jumped` by how much readings have jumped, if they have, `is_within` if it is within the
    /// calibrated range. A jump that was not abrupt, with a difference of two readings of at most `farthest`, is no fault.
    pub fn see(&mut self, reading: T, jumped: Option<T>, is_within: bool, farthest: T) {
        let moved = self.last.replace(reading).map_or(T::zero(), |last| reading - last);
        let is_back = self.is_back(moved, farthest);
        if is_back || (is_within && self.jump == T::zero()) {
            (self.jump, self.began_s) = (T::zero(), T::of(NEVER_S));
        }
        if let Some(jump) = jumped.filter(|_| self.moved.abs() > farthest && !self.is_fault()) {
            (self.jump, self.began_s) = (jump, T::zero());
        }
        // What jumps back is no fault that begins.
        self.moved = if is_back { T::zero() } else { moved };
    }

    /// Takes an implausible reading. It begins a fault if the reading before was within the calibrated range.
    pub fn see_implausible(&mut self, was_within: bool) {
        if was_within && !self.is_fault() {
            (self.jump, self.began_s) = (T::zero(), T::zero());
        }
    }

    /// True if the filter is to keep its state; it then does.
    pub fn is_due(&mut self) -> bool {
        let is_due = !self.is_fault() && self.kept_s >= T::of(RENEWED_S);
        if is_due {
            self.kept_s = T::zero();
        }
        is_due
    }

    /// True if readings have moved back, by more than `farthest` and a quarter of the jump with which a fault began.
    fn is_back(&self, moved: T, farthest: T) -> bool {
        moved * self.jump < T::zero() && moved.abs() > farthest && moved.abs() > T::of(LEAST_BACK) * self.jump.abs()
    }
}

impl<T: Recordable> Default for FaultWatch<T> {
    fn default() -> Self {
        Self::new()
    }
}
