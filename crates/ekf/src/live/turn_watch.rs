//! Watch that readings turn as often as they did in calibration.

use crate::Recordable;

/// Turns of the readings in calibration, as R/R₀ - 1: for programs that write a filter in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TurnSeen<T> {
    /// Way back of a reading that counts as a turn.
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

/// Longest times of calibration without a turn from which on it is doubted what readings tell, and after which nothing is believed.
const DOUBTED: (f64, f64) = (1.2, 1.5);

/// Watch for holds, rests and slow motions that are longer than those of calibration. Readings then creep or stand still for longer than
/// they ever did, and the relaxation of that time, which calibration has not seen, is easily taken for motion.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TurnWatch<T> {
    seen: TurnSeen<T>,
    /// 1 while readings grow, -1 while they fall.
    pub(crate) direction: T,
    /// The farthest reading since the last turn; `None` before the first reading.
    pub(crate) farthest: Option<T>,
    /// Time since that reading, and since the last turn, s.
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

    /// Takes a reading R/R₀ - 1, `dt_s` seconds after the one before. Returns true if readings have turned: at the farthest one before.
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

    /// Time since the last turn, or since the first reading, s.
    #[must_use]
    pub const fn since_turn_s(&self) -> T
    where
        T: Copy,
    {
        self.since_turn_s
    }

    /// Time since the farthest reading after the last turn, s.
    #[must_use]
    pub const fn since_farthest_s(&self) -> T
    where
        T: Copy,
    {
        self.since_farthest_s
    }

    /// States how long readings do not turn, where what comes is known, too.
    pub fn lasts(&mut self, time_s: T) {
        self.since_turn_s = time_s;
    }

    /// The strain is known now: doubts of it begin anew.
    pub fn settle(&mut self) {
        *self = Self::new(self.seen);
    }

    /// Returns how much is doubted of what readings tell: 0 as long as it is as in calibration, 1 if nothing is believed.
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
