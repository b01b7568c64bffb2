use serde::{Deserialize, Serialize};

use crate::{Estimate, KNOWN_BEYOND, Known, Sensor};

/// Duration for which readings must be quiet before a question is asked, s.
const QUIET_S: f64 = 30.0;
/// Largest range of quiet readings, as a share of the range of the calibration's readings.
const BAND: f64 = 0.02;
/// Largest distance of quiet readings from the rested sensor's reading, or from this run's extreme reading on the side of rest,
/// as the same share.
const NEAR: f64 = 0.1;
/// Travel of the readings from which that extreme counts, and by which they must leave a hold before the next question, as the
/// same share.
const AWAY: f64 = 0.3;
/// Smallest estimated strain, in either direction, that is worth a question, as a share of the limits' span.
const WORTH: f64 = 0.02;
/// Pause of the readings that ends a quiet hold, s.
const PAUSE_S: f64 = 5.0;
/// Largest number of questions in a run.
const MOST: usize = 3;

/// Watch for long holds that may be rests, whose strain the user may know.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let (mut filter, mut watch) = (sensor.filter().build()?, ohmstrain::QuietWatch::new(&sensor, None, &[]));
/// for (time_s, ohm) in [(0.00, 1600.0), (0.05, 1632.0)] {
///     assert_eq!(watch.see(&filter.step(time_s, ohm)?), None);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct QuietWatch {
    /// Reading of the rested sensor.
    rested: f64,
    /// Range of the calibration's readings.
    range: f64,
    /// 1 if readings grow with the strain, -1 if they fall.
    sign: f64,
    /// Smallest strain that is worth a question; `None` if the sensor never reports zero strain.
    worth: Option<f64>,
    pub(crate) known: Vec<Known>,
    seen: QuietSeen,
}

/// Readings that have stayed within a band.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Hold {
    from_s: f64,
    last_s: f64,
    low: f64,
    high: f64,
    asked: bool,
}

/// A hold that may be a rest. If it is, the user can give a known strain of zero at [`Self::now_s`].
///
/// ```
/// let quiet = ohmstrain::Quiet { from_s: 12.0, now_s: 42.1, strain: 0.031 };
/// assert!(quiet.to_string().starts_with("30 s of quiet readings from t = 12 s, which may be a rest"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quiet {
    /// Start of the hold, s.
    pub from_s: f64,
    /// Time of the row at which the question is asked, s.
    pub now_s: f64,
    /// Estimated strain.
    pub strain: f64,
}

/// State of a [`QuietWatch`], to resume from.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuietSeen {
    /// Extreme readings of the run on the side of rest and on the other side, times the sign of [`QuietWatch`].
    ends: (f64, f64),
    hold: Option<Hold>,
    asked: usize,
    /// Reading at the last question, as long as readings stay near it.
    asked_at: Option<f64>,
}

impl QuietWatch {
    /// Returns the state so far.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::QuietWatch;
    ///
    /// let mut watch = QuietWatch::new(&sensor, None, &[]);
    /// watch.go_on(QuietWatch::new(&sensor, None, &[]).seen());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn seen(&self) -> QuietSeen {
        self.seen
    }

    /// Resumes from the state of another watch of the same sensor.
    pub fn go_on(&mut self, seen: QuietSeen) {
        self.seen = seen;
    }

    /// Creates a watch. `rest_resistance` is the reading of the rested sensor, if it differs from that in calibration; `known`
    /// are strains that need no question.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let today = ohmstrain::QuietWatch::new(&sensor, Some(1650.0), &[ohmstrain::Known::new(0.0, 0.0)]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new(sensor: &Sensor, rest_resistance: Option<f64>, known: &[Known]) -> Self {
        let (params, validity) = (sensor.params(), sensor.params().validity);
        let rested = rest_resistance.unwrap_or_else(|| params.rested());
        let moved = rested / params.rested();
        let span = params.limits.span();
        let can_rest = params.limits.lower <= KNOWN_BEYOND * span && params.limits.upper >= 0.0;
        let worth = can_rest.then_some(WORTH * span);
        let range = moved * (validity.reading_upper - validity.reading_lower);
        let strain_at = |reading| params.static_cubic.strain(reading);
        let sign = if strain_at(validity.reading_upper) > strain_at(validity.reading_lower) { 1.0 } else { -1.0 };
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let seen = QuietSeen { ends, hold: None, asked: 0, asked_at: None };
        Self { rested, range, sign, worth, known: known.to_vec(), seen }
    }

    /// Takes a row, and returns the question about its hold, once.
    ///
    /// ```
    /// fn ask(watch: &mut ohmstrain::QuietWatch, row: &ohmstrain::Estimate) {
    ///     if let Some(quiet) = watch.see(row) {
    ///         println!("{quiet}, known strains tell it");
    ///     }
    /// }
    /// ```
    pub fn see(&mut self, row: &Estimate) -> Option<Quiet> {
        let (reading, time_s) = (row.resistance.filter(|reading| reading.is_finite())?, row.time_s);
        let seen = &mut self.seen;
        seen.ends = (seen.ends.0.min(self.sign * reading), seen.ends.1.max(self.sign * reading));
        seen.asked_at = seen.asked_at.filter(|asked_at| (reading - asked_at).abs() <= AWAY * self.range);
        let hold = seen.hold.and_then(|hold| hold.with(time_s, reading, BAND * self.range));
        let new = Hold { from_s: time_s, last_s: time_s, low: reading, high: reading, asked: false };
        let hold = seen.hold.insert(hold.unwrap_or(new));
        let is_long = time_s - hold.from_s >= QUIET_S && hold.high > hold.low;
        if !is_long || hold.asked {
            return None;
        }
        hold.asked = true;
        let held = 0.5 * (hold.low + hold.high);
        let (near, (rest_end, other_end)) = (NEAR * self.range, seen.ends);
        let is_end = other_end - rest_end >= AWAY * self.range && self.sign * held - rest_end <= near;
        let is_near = (held - self.rested).abs() <= near || is_end;
        let is_worth = self.worth.is_some_and(|worth| row.strain.abs() > worth);
        let is_known = self.known.iter().any(|known| (hold.from_s..=time_s).contains(&known.time_s));
        let asks = is_near && is_worth && !is_known && seen.asked < MOST && seen.asked_at.is_none();
        if asks {
            (seen.asked, seen.asked_at) = (seen.asked + 1, Some(held));
        }
        asks.then_some(Quiet { from_s: hold.from_s, now_s: time_s, strain: row.strain })
    }
}

impl Hold {
    /// Extends the hold by another reading; `None` if that one is not quiet.
    fn with(self, time_s: f64, reading: f64, band: f64) -> Option<Self> {
        let (low, high) = (self.low.min(reading), self.high.max(reading));
        let is_quiet = high - low <= band && time_s - self.last_s <= PAUSE_S;
        is_quiet.then_some(Self { last_s: time_s, low, high, ..self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor() -> Sensor {
        Sensor::from_toml(include_str!("../examples/sensor.toml")).unwrap()
    }

    /// Returns the questions asked about readings every 0.1 s whose estimated strain is `strain`.
    fn asked(known: &[Known], strain: f64, reading: impl Fn(u32) -> f64) -> Vec<Quiet> {
        let sensor = sensor();
        let mut watch = QuietWatch::new(&sensor, None, known);
        let row = |k: u32| {
            let mut row = Estimate::default();
            (row.time_s, row.resistance, row.strain) = (0.1 * f64::from(k), Some(reading(k)), strain);
            row
        };
        (0..12_000).filter_map(|k| watch.see(&row(k))).collect()
    }

    #[test]
    fn a_long_hold_near_rest_is_asked_about_once() {
        let sensor = sensor();
        let (rested, seen) = (sensor.params().rested(), sensor.params().validity);
        let range = seen.reading_upper - seen.reading_lower;
        let noise = |k: u32| 0.005 * range * f64::from(k * 7919 % 11) / 11.0;
        // Twenty minutes of rest form one hold.
        let rest = |k| rested + noise(k);
        let quiet = asked(&[], 0.03, rest);
        assert_eq!(quiet.len(), 1);
        assert!((quiet[0].now_s - quiet[0].from_s - QUIET_S).abs() < 0.11 && quiet[0].strain == 0.03, "{quiet:?}");
        // No question if the strain is estimated as zero or is known, if the number is stuck, or if readings are far from rest.
        assert_eq!(asked(&[], 0.0, rest), []);
        assert_eq!(asked(&[Known::new(12.0, 0.0)], 0.03, rest), []);
        assert_eq!(asked(&[], 0.03, |_| rested), []);
        assert_eq!(asked(&[], 0.03, |k| rested + 0.3 * range + noise(k)), []);
        // Motion, and a drift that never settles.
        assert_eq!(asked(&[], 0.03, |k| rested + 0.05 * range * (0.1 * f64::from(k)).sin()), []);
        assert_eq!(asked(&[], 0.03, |k| rested + range * (1e-4 * f64::from(k) - 0.6)), []);
        // Twenty rests with motion in between, also with another R0: no more than three questions.
        for moved in [0.0, 0.5 * range] {
            let rests = |k: u32| rested + moved + if k % 600 < 50 { 0.5 * range } else { noise(k) };
            assert_eq!(asked(&[], 0.03, rests).len(), MOST);
            // Without motion they form one hold.
            let broken = |k: u32| rested + if k % 600 < 50 { 0.05 * range } else { noise(k) };
            assert_eq!(asked(&[], 0.03, broken).len(), 1);
        }
    }
}
