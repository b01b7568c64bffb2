//! R₀ of a session, estimated from readings alone, in any precision.

use crate::{Reading, Recordable};

/// Constants of an R₀ that follows the readings.
struct Following {
    /// Time constant with which R₀ moves away from the calibrated one, s.
    leaves_s: f64,
    /// Time constant if a whole recording is processed for a single R₀, s.
    settles_s: f64,
    /// Time constant with which it returns, s.
    returns_s: f64,
    /// Longest time that one reading counts for, s, even after a longer gap.
    longest_s: f64,
    /// Largest factor between a tracked R₀ and the calibrated one; a reading that would need a larger one is ignored.
    farthest: f64,
}

/// `docs/notes/2026-11-23-following-r0-figures.md` documents their choice. A shorter `leaves_s` follows a changed R₀ sooner,
/// but also a fault of 10 s farther.
const FOLLOWING: Following =
    Following { leaves_s: 40.0, settles_s: 10.0, returns_s: 1.0, longest_s: 2.0, farthest: 2.0 };

/// Largest factor between a given R₀ and the rested sensor's reading in calibration, either way. Beyond it, the given R₀ has
/// another unit, or belongs to another sensor.
///
/// ```
/// assert_eq!(ohmstrain_ekf::live::FARTHEST_REST, 4.0);
/// ```
pub const FARTHEST_REST: f64 = 4.0;

/// Bounds of the readings, R/R₀ - 1, of a sensor with its calibrated R₀ and a strain within its limits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestBounds<T> {
    /// The smallest; `None` if unknown.
    pub low: Option<T>,
    /// The largest; `None` if unknown.
    pub high: Option<T>,
    /// Estimate of R₀ from the first reading of a session; `None` for a calibration on one recording.
    pub start: Option<SessionStart<T>>,
}

/// Estimate of R₀ from the first reading of a session, based on the differences between recordings of the calibration.
///
/// R₀ differs from session to session: `ln R₀` has the standard deviation s between sessions. A session begins at rest. The
/// logarithm of its first reading is `ln R₀` plus a constant, with the standard deviation f. The best linear estimate of `ln R₀` is
/// `s²/(s² + f²)` of the way from the calibrated value to the one that the reading alone suggests.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SessionStart<T> {
    /// Typical first reading, R/R₀ - 1.
    pub reading: T,
    /// Weight of the first reading, `s²/(s² + f²)`, 0 to 1.
    pub weight: T,
}

impl RestBounds<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> RestBounds<T> {
        RestBounds {
            low: self.low.map(T::of),
            high: self.high.map(T::of),
            start: self.start.map(|start| SessionStart { reading: T::of(start.reading), weight: T::of(start.weight) }),
        }
    }
}

/// R₀ that follows the readings. It keeps its calibrated value as long as they stay in the calibrated range. A reading beyond the
/// range slowly moves it, and one beyond the other end quickly moves it back (backlash as wide as the calibrated readings, with a
/// lag). If sessions are known to begin at rest, the estimate from the first reading ([`SessionStart`]) replaces the calibrated
/// value. Following is correct if the sensor moves between the same strains as in calibration, on another day. If it is stretched
/// farther, the strain is at its limit anyway.
///
/// ```
/// use ohmstrain_ekf::live::{RestBounds, RestFollower};
///
/// let mut follower = RestFollower::<f64>::new(RestBounds { low: Some(-0.05), high: Some(1.5), start: None });
/// for k in 0..6000 {
///     follower.see(0.05, 2.0 - 1e-9 * f64::from(k % 2));
/// }
/// // 3 R₀ are to be the 2.5 R₀ of calibration.
/// assert!((follower.off() - 0.2).abs() < 1e-3);
/// assert!((follower.relative(2.0.into()).value - 1.5).abs() < 3e-3);
/// ```
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestFollower<T> {
    bounds: RestBounds<T>,
    /// Relative deviation of R₀ from the calibrated one.
    pub(crate) off: T,
    /// Relative deviation of R₀ at the start of the session.
    pub(crate) home: T,
    /// True once the initial R₀ of the session is set.
    pub(crate) has_begun: bool,
    /// The last reading, `None` before the first one; `since_s` is the time since then, s.
    pub(crate) last: Option<T>,
    pub(crate) since_s: T,
}

impl<T: Recordable> RestFollower<T> {
    /// Starts before any reading, with the calibrated R₀.
    ///
    /// ```
    /// let bounds = ohmstrain_ekf::live::RestBounds { low: None, high: Some(1.5), start: None };
    /// assert_eq!(ohmstrain_ekf::live::RestFollower::<f64>::new(bounds).off(), 0.0);
    /// ```
    #[must_use]
    pub fn new(bounds: RestBounds<T>) -> Self {
        Self { bounds, off: T::zero(), home: T::zero(), has_begun: false, last: None, since_s: T::zero() }
    }

    /// Starts a session with a stretched sensor, whose first reading carries no information on R₀.
    ///
    /// ```
    /// let start = Some(ohmstrain_ekf::live::SessionStart { reading: 0.0, weight: 0.5 });
    /// let bounds = ohmstrain_ekf::live::RestBounds { low: None, high: None, start };
    /// let mut follower = ohmstrain_ekf::live::RestFollower::<f64>::new(bounds).stretched();
    /// follower.see(0.0, 0.2);
    /// assert_eq!(follower.off(), 0.0);
    /// ```
    #[must_use]
    pub fn stretched(self) -> Self {
        Self { has_begun: true, ..self }
    }

    /// Returns the relative deviation of R₀ from the calibrated one.
    ///
    /// ```
    /// let mut follower = ohmstrain_ekf::live::RestFollower::<f64>::new(ohmstrain_ekf::live::RestBounds { low: None, high: None, start: None });
    /// follower.see(1.0, 2.0);
    /// assert_eq!(follower.off(), 0.0);
    /// ```
    #[must_use]
    pub fn off(&self) -> T {
        self.off
    }

    /// Converts a reading relative to the calibrated R₀ to one relative to the tracked R₀.
    ///
    /// ```
    /// let follower = ohmstrain_ekf::live::RestFollower::<f64>::new(ohmstrain_ekf::live::RestBounds { low: None, high: None, start: None });
    /// assert_eq!(follower.relative(0.5.into()).value, 0.5);
    /// ```
    #[must_use]
    pub fn relative(&self, reading: Reading<T>) -> Reading<T> {
        let off = if self.has_begun { self.off } else { self.start(reading.value) };
        let rest = T::one() + off;
        let extra_variance = reading.extra_variance / (rest * rest);
        Reading { value: (reading.value - off) / rest, extra_variance }
    }

    /// Converts a reading relative to the calibrated R₀ to one relative to the R₀ at the start of the session, the
    /// input of doubts.
    ///
    /// ```
    /// let start = Some(ohmstrain_ekf::live::SessionStart { reading: 0.0, weight: 0.5 });
    /// let bounds = ohmstrain_ekf::live::RestBounds { low: None, high: None, start };
    /// let mut follower = ohmstrain_ekf::live::RestFollower::<f64>::new(bounds);
    /// follower.see(0.0, 0.2);
    /// assert!((follower.of_session(0.65) - 0.5).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn of_session(&self, reading: T) -> T {
        let home = if self.has_begun { self.home } else { self.start(reading) };
        (reading - home) / (T::one() + home)
    }

    /// Returns the relative deviation of R₀ from the calibrated one in a session that begins with this reading.
    fn start(&self, reading: T) -> T {
        let Some(start) = self.bounds.start else { return self.off };
        let off = start.weight * (reading - start.reading) / (T::one() + start.reading);
        off.max(T::of(1.0 / FOLLOWING.farthest - 1.0)).min(T::of(FOLLOWING.farthest - 1.0))
    }

    /// Takes a reading R/R₀ - 1, relative to the calibrated R₀, `dt_s` seconds after the previous reading. A repeated
    /// number is ignored until another one comes, because it may be stuck.
    ///
    /// ```
    /// let bounds = ohmstrain_ekf::live::RestBounds { low: None, high: Some(1.5), start: None };
    /// let mut follower = ohmstrain_ekf::live::RestFollower::<f64>::new(bounds);
    /// [1.4, 2.0, 2.0].into_iter().for_each(|reading| follower.see(2.0, reading));
    /// // 0.2, by 2 s of 40.
    /// assert!((follower.off() - 0.2 * 2.0 / 42.0).abs() < 1e-12);
    /// ```
    pub fn see(&mut self, dt_s: T, reading: T) {
        self.begin(reading);
        self.draw(T::of(FOLLOWING.leaves_s), dt_s, reading);
    }

    /// True for a reading, relative to the calibrated R₀, that is within the calibrated range with R₀ as tracked.
    ///
    /// ```
    /// let bounds = ohmstrain_ekf::live::RestBounds { low: Some(-0.05), high: Some(1.5), start: None };
    /// let follower = ohmstrain_ekf::live::RestFollower::<f64>::new(bounds);
    /// assert!(follower.is_within(1.4) && !follower.is_within(1.6) && !follower.is_within(-0.1));
    /// ```
    #[must_use]
    pub fn is_within(&self, reading: T) -> bool {
        self.wanted(reading).is_none()
    }

    /// Returns the relative deviation of R₀ that brings a reading beyond the calibrated range to its end; `None` for a reading within
    /// it.
    fn wanted(&self, reading: T) -> Option<T> {
        let wanted = |bound: T| (reading - bound) / (T::one() + bound);
        let (low, high) = (self.bounds.low.map(wanted), self.bounds.high.map(wanted));
        high.filter(|&high| high > self.off).or(low.filter(|&low| low < self.off))
    }

    /// Takes the first reading of a session.
    fn begin(&mut self, reading: T) {
        if !self.has_begun {
            let off = self.start(reading);
            (self.off, self.home, self.has_begun) = (off, off, true);
        }
    }

    fn draw(&mut self, leaves_s: T, dt_s: T, reading: T) {
        let last = self.last.replace(reading);
        self.since_s = if last.is_none() { T::zero() } else { self.since_s + dt_s };
        if last.is_none_or(|last| last == reading) {
            return;
        }
        let (since_s, longest_s) = (core::mem::replace(&mut self.since_s, T::zero()), T::of(FOLLOWING.longest_s));
        let passed_s = if since_s < longest_s { since_s } else { longest_s };
        let Some(wanted) = self.wanted(reading) else { return };
        if T::of(1.0 / FOLLOWING.farthest - 1.0) < wanted && wanted < T::of(FOLLOWING.farthest - 1.0) {
            let is_leaving = (wanted - self.home).abs() > (self.off - self.home).abs();
            let time_s = if is_leaving { leaves_s } else { T::of(FOLLOWING.returns_s) };
            self.off += passed_s / (time_s + passed_s) * (wanted - self.off);
        }
    }
}

impl RestFollower<f64> {
    /// Settles on a single R₀ for a recording: the result of a pass through its rows, and a second pass from that
    /// result.
    #[must_use]
    pub fn settled(mut self, len: usize, row: impl Fn(usize) -> (f64, Option<Reading<f64>>)) -> Self {
        let first = (0..len).find_map(|k| row(k).1);
        first.into_iter().for_each(|reading| self.begin(reading.value));
        for _ in 0..2 {
            let mut last_s = f64::NAN;
            self.last = None;
            for k in 0..len {
                let (time_s, reading) = row(k);
                if let Some(reading) = reading {
                    self.draw(FOLLOWING.settles_s, time_s - last_s, reading.value);
                    last_s = time_s;
                }
            }
            if self.off == self.home {
                break;
            }
        }
        self
    }
}
