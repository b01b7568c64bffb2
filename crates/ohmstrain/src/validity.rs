use ohmstrain_ekf::live::RestFollower;
use ohmstrain_sensor::{Quantity, Validity};
use serde::{Deserialize, Serialize};

use crate::Sensor;
use crate::column::reading_column;

/// Watch that reports, once for each kind, the use of a sensor outside its calibrated range.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let mut watch = ohmstrain::ValidityWatch::new(&sensor, None);
/// let messages: Vec<String> = (0..20)
///     .flat_map(|second| watch.see(f64::from(second), 3900.0, 0.0, f64::NAN))
///     .map(|beyond| beyond.to_string())
///     .collect();
/// let expected = "at 10 s: resistance_ohm is outside of the calibration's 1598.9 to 3703.1";
/// assert!(messages[0].starts_with(expected), "{}", messages[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ValidityWatch {
    validity: Validity,
    quantity: Quantity,
    reading: &'static str,
    /// Calibrated range of readings, moved to the given R₀; and true if none is given.
    readings: (f64, f64),
    follows: bool,
    /// R₀ of the calibration.
    rest_reading: f64,
    seen: ValiditySeen,
}

/// A use outside the calibrated range; estimates are extrapolations.
///
/// ```
/// use ohmstrain::{Beyond, Extrapolation};
///
/// let warning = Extrapolation { time_s: 3.0, beyond: Beyond::Duration { longest_s: 2.0 } };
/// assert_eq!(warning.to_string(), "at 3 s: longer than the 2.0 s of the calibration, in which readings drifted; estimates are extrapolations");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extrapolation {
    /// Time of the row at which it was detected, s.
    pub time_s: f64,
    /// Kind of use.
    pub beyond: Beyond,
}

/// Kinds of use of a sensor outside its calibrated range.
///
/// ```
/// assert!(matches!(ohmstrain::Beyond::Duration { longest_s: 2.0 }, ohmstrain::Beyond::Duration { .. }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Beyond {
    /// A run longer than any in calibration.
    Duration {
        /// Longest recording of the calibration, s.
        longest_s: f64,
    },
    /// Rates higher than in calibration.
    Rate {
        /// Quantity whose rate it is.
        quantity: Quantity,
        /// 99th percentile of the calibration, 1/s.
        fastest_per_s: f64,
    },
    /// Readings outside the calibrated range.
    Readings {
        /// Name of their column.
        column: &'static str,
        /// Smallest reading of the calibration, moved to the R₀ in use.
        least: f64,
        /// Largest reading of the calibration, moved to the R₀ in use.
        most: f64,
        /// True if R₀ adapts to them, since it was not given.
        follows: bool,
    },
    /// Strains outside the calibrated range.
    Strain {
        /// Estimated quantity.
        quantity: Quantity,
        /// Smallest strain of the calibration.
        least: f64,
        /// Largest strain of the calibration.
        most: f64,
    },
}

/// Rows outside of a range.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Outside {
    rows: usize,
    outside: usize,
    reported: bool,
}

/// Number and share of rows up to which rows outside are a matter of chance.
const CHANCE: (usize, f64) = (10, 0.02);
/// Factor on the fastest rate, which is a 99th percentile of a reference, whereas estimated rates have errors. On the very rows
/// of their calibrations, filters of eleven public recordings exceed the fastest rate in up to a third of the rows; they exceed
/// this factor times it for a second or two, apart from the first seconds, in which they have yet to find the motion.
const FASTER: f64 = 1.3;
const FAST_BY_CHANCE: (usize, f64) = (20, 0.01);
const FOUND_S: f64 = 10.0;
/// Factor on the longest recording of the calibration above which a run is longer.
const LONGER: f64 = 1.05;

/// Returns the reading that the sensor would have given with the calibration's R₀, `rest_reading`; NaN if it is missing.
fn as_calibrated(follower: &mut RestFollower<f64>, rest_reading: f64, reading: f64) -> f64 {
    let relative = reading / rest_reading - 1.0;
    if relative.is_finite() {
        follower.see(0.0, relative);
    }
    rest_reading * (1.0 + follower.of_session(relative))
}

impl Outside {
    /// Counts a row, and returns true if it is time for the report.
    fn see(&mut self, outside: bool, chance: (usize, f64)) -> bool {
        self.rows += 1;
        self.outside += usize::from(outside);
        let many = self.outside > chance.0 && self.outside as f64 > chance.1 * self.rows as f64;
        let now = many && !self.reported;
        self.reported |= now;
        now
    }
}

/// State of a [`ValidityWatch`], to resume from.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValiditySeen {
    start_s: Option<f64>,
    long: bool,
    fast: Outside,
    beyond_readings: Outside,
    beyond_strains: Outside,
    /// R₀ of the session; `None` if calibration knows one session only, or R₀ is given.
    follower: Option<RestFollower<f64>>,
}

impl ValidityWatch {
    /// Returns the state so far.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::ValidityWatch;
    ///
    /// let mut watch = ValidityWatch::new(&sensor, None);
    /// watch.go_on(ValidityWatch::new(&sensor, None).seen());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn seen(&self) -> ValiditySeen {
        self.seen.clone()
    }

    /// Resumes from the state of another watch of the same sensor.
    pub fn go_on(&mut self, seen: ValiditySeen) {
        let follower = self.seen.follower.map(|own| seen.follower.unwrap_or(own));
        self.seen = ValiditySeen { follower, ..seen };
    }

    /// Creates a watch. `rest_resistance` is the present reading of the rested sensor, if it differs from that in calibration.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let watch = ohmstrain::ValidityWatch::new(&sensor, Some(1712.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new(sensor: &Sensor, rest_resistance: Option<f64>) -> Self {
        let (params, validity) = (sensor.params(), sensor.params().validity);
        let moved = sensor.rest_reading(rest_resistance) / params.rest_reading;
        let sessions = params.sessions.filter(|_| rest_resistance.is_none());
        let follower = sessions.map(|_| RestFollower::new(params.rest_bounds()));
        Self {
            validity,
            quantity: params.quantity,
            reading: reading_column(params.reading),
            readings: (moved * validity.reading_lower, moved * validity.reading_upper),
            follows: rest_resistance.is_none(),
            rest_reading: params.rest_reading,
            seen: ValiditySeen { follower, ..ValiditySeen::default() },
        }
    }

    /// Takes a row, and returns new warnings. The row is the reading as recorded, the estimated rate and the true strain; NaN
    /// for missing values. An uncertain rate is estimated near zero, so that a high one is significant.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut watch = ohmstrain::ValidityWatch::new(&sensor, None);
    /// assert_eq!(watch.see(0.0, 1600.0, 0.01, f64::NAN).count(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn see(
        &mut self,
        time_s: f64,
        reading: f64,
        rate: f64,
        truth: f64,
    ) -> impl Iterator<Item = Extrapolation> + use<> {
        let Validity { lower, upper, fastest_rate_per_s: fastest_per_s, duration_s: longest_s, drifts, .. } =
            self.validity;
        let (quantity, column, (least, most)) = (self.quantity, self.reading, self.readings);
        let (seen, follows, rest_reading) = (&mut self.seen, self.follows, self.rest_reading);
        let lasted_s = time_s - *seen.start_s.get_or_insert(time_s);
        let is_long = drifts && !seen.long && lasted_s > LONGER * longest_s;
        seen.long |= is_long;
        let is_fast = lasted_s >= FOUND_S && seen.fast.see(rate.abs() > FASTER * fastest_per_s, FAST_BY_CHANCE);
        let follower = seen.follower.as_mut();
        let reading = follower.map_or(reading, |follower| as_calibrated(follower, rest_reading, reading));
        let is_other = reading.is_finite() && seen.beyond_readings.see(!(least..=most).contains(&reading), CHANCE);
        let is_beyond = truth.is_finite() && seen.beyond_strains.see(!(lower..=upper).contains(&truth), CHANCE);
        let all = [
            (is_long, Beyond::Duration { longest_s }),
            (is_fast, Beyond::Rate { quantity, fastest_per_s }),
            (is_other, Beyond::Readings { column, least, most, follows }),
            (is_beyond, Beyond::Strain { quantity, least: lower, most: upper }),
        ];
        // Mostly there is no warning.
        let found = (is_long || is_fast || is_other || is_beyond).then_some(all);
        found.into_iter().flatten().filter_map(move |(now, beyond)| now.then_some(Extrapolation { time_s, beyond }))
    }
}
