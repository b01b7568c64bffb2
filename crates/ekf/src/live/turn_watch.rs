//! Watch for readings that turn less often than in calibration.

use crate::Recordable;

/// Turns of the readings in calibration, as R/R₀ - 1; public for programs that generate a filter in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TurnSeen<T> {
    /// Smallest reversal of the readings that counts as a turn.
    pub turn: T,
    /// Longest time between two turns, s.
    pub longest_s: T,
}

impl TurnSeen<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> TurnSeen<T> {
        TurnSeen { turn: T::of(self.turn), longest_s: T::of(self.longest_s) }
    }
}

/// Multiples of the longest time without a turn in calibration: doubt begins at the first, and is complete at the second.
const DOUBTED: (f64, f64) = (1.2, 1.5);

/// Watch for holds, rests and slow motions longer than those of the calibration. Readings then creep or stand still for longer than
/// the calibration shows, and their relaxation, unknown from calibration, is easily mistaken for motion.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TurnWatch<T> {
    seen: TurnSeen<T>,
    /// 1 while readings rise, -1 while they fall.
    pub(crate) direction: T,
    /// The extreme reading since the last turn; `None` before the first reading.
    pub(crate) farthest: Option<T>,
    /// Times since that reading, and since the last turn, s.
    pub(crate) since_farthest_s: T,
    pub(crate) since_turn_s: T,
}

impl<T: Recordable> TurnWatch<T> {
    /// Starts before any reading.
    #[must_use]
    pub fn new(seen: TurnSeen<T>) -> Self {
        let zero = T::zero();
        Self { seen, direction: T::one(), farthest: None, since_farthest_s: zero, since_turn_s: zero }
    }

    /// Takes a reading R/R₀ - 1, `dt_s` seconds after the previous one. Returns true if readings have turned, at the extreme
    /// reading before.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{TurnSeen, TurnWatch};
    ///
    /// let mut watch = TurnWatch::<f64>::new(TurnSeen { turn: 0.1, longest_s: 4.0 });
    /// let turned: Vec<bool> = [0.0, 0.5, 0.8, 0.75, 0.5, 0.2].map(|rho| watch.see(1.0, rho)).to_vec();
    /// assert_eq!(turned, [false, false, false, false, true, false]);
    /// // Three seconds since 0.8.
    /// assert_eq!(watch.since_turn_s(), 3.0);
    /// ```
    pub fn see(&mut self, dt_s: T, rho: T) -> bool {
        let Some(farthest) = self.farthest.filter(|_| dt_s <= self.seen.longest_s) else {
            *self = Self { farthest: Some(rho), ..Self::new(self.seen) };
            return false;
        };
        self.since_turn_s += dt_s;
        self.since_farthest_s += dt_s;
        let back = self.direction * (farthest - rho);
        let turns = back > self.seen.turn;
        if turns {
            self.direction = -self.direction;
            self.since_turn_s = self.since_farthest_s;
        }
        if turns || back <= T::zero() {
            (self.farthest, self.since_farthest_s) = (Some(rho), T::zero());
        }
        turns
    }

    /// Returns the time since the last turn, or since the first reading, s.
    #[must_use]
    pub const fn since_turn_s(&self) -> T
    where
        T: Copy,
    {
        self.since_turn_s
    }

    /// Returns the time since the extreme reading after the last turn, s.
    #[must_use]
    pub const fn since_farthest_s(&self) -> T
    where
        T: Copy,
    {
        self.since_farthest_s
    }

    /// Sets the time between turns, s, if later readings are known, too.
    pub fn lasts(&mut self, time_s: T) {
        self.since_turn_s = time_s;
    }

    /// Restarts the watch, because the strain is now known.
    pub fn settle(&mut self) {
        *self = Self::new(self.seen);
    }

    /// Returns the doubt about the readings' information, from 0 as in calibration to 1 if they carry none.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{TurnSeen, TurnWatch};
    ///
    /// let mut watch = TurnWatch::<f64>::new(TurnSeen { turn: 0.1, longest_s: 10.0 });
    /// let doubted: Vec<f64> = (0..20).map(|_| { watch.see(1.0, 0.3); watch.doubted() }).collect();
    /// assert_eq!(doubted[..13], [0.0; 13]);
    /// assert!((doubted[13] - 1.0 / 3.0).abs() < 1e-12 && doubted[15..] == [1.0; 5]);
    /// ```
    #[must_use]
    pub fn doubted(&self) -> T {
        let (first, last) = DOUBTED;
        let times = self.since_turn_s / self.seen.longest_s;
        ((times - T::of(first)) / T::of(last - first)).max(T::zero()).min(T::one())
    }
}
