//! Watch for a change of the sensor's reading at rest.

use crate::Recordable;

/// Readings of the sensor at rest in calibration, as R/R₀ - 1; public for programs that generate a filter in another
/// language.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestSeen<T> {
    /// Reading of the rested, unstretched sensor.
    pub rested: T,
    /// Tolerance of readings at rest around it.
    pub tolerance: T,
    /// Time for which readings must stay at rest, or beyond it, to count, s.
    pub lasts_s: T,
    /// 1 if readings rise from rest, -1 if they fall, 0 if rest is in the middle of their range.
    pub sign: T,
    /// The outermost reading of the calibration on the side of rest.
    pub end: T,
}

impl RestSeen<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> RestSeen<T> {
        RestSeen {
            rested: T::of(self.rested),
            tolerance: T::of(self.tolerance),
            lasts_s: T::of(self.lasts_s),
            sign: T::of(self.sign),
            end: T::of(self.end),
        }
    }
}

/// Watch for an R₀ that differs from the calibrated one. There are two kinds of evidence: a reading of the sensor at known rest
/// that differs from the calibration's, and readings that stay beyond those at rest, which no strain explains. An increased R₀
/// cannot be distinguished from a held strain. The finding ends when readings stay for a while at the calibrated reading at rest.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestWatch<T> {
    seen: RestSeen<T>,
    /// True if the sensor is known to rest at the next reading.
    pub(crate) rests: bool,
    /// Times, s, for which readings have been beyond those at rest, and near them.
    pub(crate) beyond_s: T,
    pub(crate) near_s: T,
    /// Smallest distance beyond those at rest over `beyond_s`.
    pub(crate) least: T,
    /// Relative deviation of R₀ from the calibrated one.
    pub(crate) off: T,
}

impl<T: Recordable> RestWatch<T> {
    /// Starts before any reading; `rests` if the sensor is known to rest then.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen { rested: 0.05, tolerance: 0.05, lasts_s: 10.0, sign: 1.0, end: 0.02 };
    /// let mut watch = RestWatch::<f64>::new(seen, true);
    /// assert!((watch.see(0.0, seen.rested + 0.1) - 0.1).abs() < 1e-12);
    /// assert_eq!(RestWatch::<f64>::new(seen, false).see(0.0, seen.rested + 0.1), 0.0);
    /// ```
    #[must_use]
    pub fn new(seen: RestSeen<T>, rests: bool) -> Self {
        Self { seen, rests, beyond_s: T::zero(), near_s: T::zero(), least: T::zero(), off: T::zero() }
    }

    /// Takes a reading R/R₀ - 1, `dt_s` seconds after the previous one. Returns the relative deviation of R₀, 0 without
    /// evidence of one.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen { rested: 0.05, tolerance: 0.05, lasts_s: 10.0, sign: 1.0, end: 0.02 };
    /// let mut watch = RestWatch::<f64>::new(seen, false);
    /// let off: Vec<f64> = (0..12).map(|_| watch.see(1.0, seen.end - 0.1)).collect();
    /// assert_eq!(off[..9], [0.0; 9]);
    /// assert!((off[9] - 0.1).abs() < 1e-12);
    /// ```
    pub fn see(&mut self, dt_s: T, rho: T) -> T {
        let tolerance = self.seen.tolerance;
        let from_rest = (rho - self.seen.rested).abs();
        if self.rests {
            self.rests = false;
            self.off = if from_rest > tolerance { from_rest } else { T::zero() };
        }
        let beyond = self.seen.sign * (self.seen.end - rho);
        if beyond > tolerance {
            self.least = if self.beyond_s > T::zero() { self.least.min(beyond) } else { beyond };
            self.beyond_s += dt_s;
        } else {
            self.beyond_s = T::zero();
        }
        self.near_s = if from_rest > tolerance { T::zero() } else { self.near_s + dt_s };
        if self.beyond_s >= self.seen.lasts_s {
            self.off = self.off.max(self.least);
        } else if self.near_s >= self.seen.lasts_s {
            self.off = T::zero();
        }
        self.off
    }

    /// Restarts the watch, because the R₀ of the session is given.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen { rested: 0.05, tolerance: 0.05, lasts_s: 10.0, sign: 1.0, end: 0.02 };
    /// let mut watch = RestWatch::<f64>::new(seen, true);
    /// watch.see(0.0, seen.rested + 0.1);
    /// watch.restart();
    /// assert_eq!(watch.off(), 0.0);
    /// ```
    pub fn restart(&mut self) {
        *self = Self::new(self.seen, self.rests);
    }

    /// Returns the relative deviation of R₀, 0 without evidence of one.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen { rested: 0.05, tolerance: 0.05, lasts_s: 10.0, sign: 1.0, end: 0.02 };
    /// assert_eq!(RestWatch::<f64>::new(seen, true).off(), 0.0);
    /// ```
    #[must_use]
    pub const fn off(&self) -> T
    where
        T: Copy,
    {
        self.off
    }
}
