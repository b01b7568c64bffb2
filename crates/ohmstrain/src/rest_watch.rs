//! Whether the sensor still rests where it rested in calibration.

use ohmstrain_calib::SensorParams;
use ohmstrain_ekf::Real;

/// By what share a rested sensor may read something else than in calibration: half of what is to be noticed, a tenth.
const TOLERANCE: f64 = 0.05;
/// For how long readings must stay where they are to say something of R₀, s: twice as long as a doubt of a start lasts.
const LASTS_S: f64 = 10.0;
/// What a sensor reads at rest is an end of what it reads at all if it is no farther from it than this share of the range.
const AT_END: f64 = 0.25;
/// A strain within this share of the span of zero is zero.
pub(crate) const ZERO: f64 = 0.01;

/// What calibration has seen of the sensor at rest, as R/R₀ - 1: for programs that write a filter in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestSeen {
    /// What the rested, unstretched sensor read.
    pub rested: f64,
    /// How far from there it may read at rest.
    pub tolerance: f64,
    /// For how long readings must stay where they are to say something, s.
    pub lasts_s: f64,
    /// 1 where readings grow from rest on, -1 where they fall, 0 where rest is in their midst.
    pub sign: f64,
    /// The last of calibration's readings on that side.
    pub end: f64,
}

impl RestSeen {
    /// `None` where no recording of the calibration begins at rest.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let seen = ohmstrain::RestSeen::of(sensor.params()).unwrap();
    /// assert!(seen.sign == 1.0 && seen.end <= seen.rested);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn of(params: &SensorParams) -> Option<Self> {
        let relative = |reading: f64| reading / params.rest_reading - 1.0;
        let rested = relative(params.measured_rest?);
        let (low, high) = (relative(params.validity.reading_lower), relative(params.validity.reading_upper));
        let (sign, end) = match AT_END * (high - low) {
            near if rested - low <= near => (1.0, low.min(rested)),
            near if high - rested <= near => (-1.0, high.max(rested)),
            _ => (0.0, rested),
        };
        Some(Self { rested, tolerance: TOLERANCE * (1.0 + rested), lasts_s: LASTS_S, sign, end })
    }
}

/// Watches readings for an R₀ that is not calibration's. Two things say so: a sensor that is known to rest and reads something
/// else, and readings that stay where no strain leads, beyond those at rest. An R₀ that has grown is not told from a strain that
/// is held. A sensor that rests for a while where it rested in calibration ends it.
#[derive(Clone, Copy, Debug)]
pub struct RestWatch<T> {
    seen: RestSeen,
    /// Whether the next reading is one at rest.
    rests: bool,
    /// For how long readings have been beyond those at rest, and near them, s.
    beyond_s: T,
    near_s: T,
    /// How far they have been beyond all that time.
    least: T,
    /// How far R₀ is off, as a share of it.
    off: T,
}

impl<T: Real> RestWatch<T> {
    /// Before any reading; `rests` if the sensor is known to rest then.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen::of(sensor.params()).unwrap();
    /// let mut watch = RestWatch::<f64>::new(seen, true);
    /// assert!((watch.see(0.0, seen.rested + 0.1) - 0.1).abs() < 1e-12);
    /// assert_eq!(RestWatch::<f64>::new(seen, false).see(0.0, seen.rested + 0.1), 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new(seen: RestSeen, rests: bool) -> Self {
        Self { seen, rests, beyond_s: T::zero(), near_s: T::zero(), least: T::zero(), off: T::zero() }
    }

    /// Takes a reading R/R₀ - 1, `dt_s` seconds after the row before; tells how far R₀ is off, as a share of it: 0 where
    /// nothing speaks against it.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen::of(sensor.params()).unwrap();
    /// let mut watch = RestWatch::<f64>::new(seen, false);
    /// let off: Vec<f64> = (0..12).map(|_| watch.see(1.0, seen.end - 0.1)).collect();
    /// assert_eq!(off[..9], [0.0; 9]);
    /// assert!((off[9] - 0.1).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn see(&mut self, dt_s: T, rho: T) -> T {
        let tolerance = T::of(self.seen.tolerance);
        let from_rest = (rho - T::of(self.seen.rested)).abs();
        if self.rests {
            self.rests = false;
            self.off = if from_rest > tolerance { from_rest } else { T::zero() };
        }
        let beyond = T::of(self.seen.sign) * (T::of(self.seen.end) - rho);
        if beyond > tolerance {
            self.least = if self.beyond_s > T::zero() { self.least.min(beyond) } else { beyond };
            self.beyond_s += dt_s;
        } else {
            self.beyond_s = T::zero();
        }
        self.near_s = if from_rest > tolerance { T::zero() } else { self.near_s + dt_s };
        if self.beyond_s >= T::of(self.seen.lasts_s) {
            self.off = self.off.max(self.least);
        } else if self.near_s >= T::of(self.seen.lasts_s) {
            self.off = T::zero();
        }
        self.off
    }

    /// R₀ of today has been told: what spoke against calibration's is gone.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen::of(sensor.params()).unwrap();
    /// let mut watch = RestWatch::<f64>::new(seen, true);
    /// watch.see(0.0, seen.rested + 0.1);
    /// watch.told();
    /// assert_eq!(watch.off(), 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn told(&mut self) {
        *self = Self::new(self.seen, self.rests);
    }

    /// How far R₀ is off, as a share of it; 0 where nothing speaks against it.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::{RestSeen, RestWatch};
    ///
    /// let seen = RestSeen::of(sensor.params()).unwrap();
    /// assert_eq!(RestWatch::<f64>::new(seen, true).off(), 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn off(&self) -> T
    where
        T: Copy,
    {
        self.off
    }
}
