use crate::Sensor;

/// Number of times whose steps are compared with those of the calibration.
const FIRST_TIMES: usize = 100;
/// Least number of them.
const FEWEST_TIMES: usize = 10;
/// Multiple of the calibration's step beyond which times may be in milliseconds; a recording read less often has smaller ones.
const FARTHER: f64 = 200.0;

/// A doubt about a recording that is unlike those of the calibration.
///
/// ```
/// let doubt = ohmstrain::UseDoubt::Milliseconds { step_s: 500.0, usual_s: 0.5 };
/// assert!(doubt.text(ohmstrain::Interface::Python).starts_with("rows are 500 s apart, 0.5 s in the calibration"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum UseDoubt {
    /// Rows so much farther apart than those of the calibration that their times may be milliseconds.
    Milliseconds {
        /// Mean distance of the rows, s.
        step_s: f64,
        /// Mean distance of the calibration's rows, s.
        usual_s: f64,
    },
    /// Readings without temperatures, for a sensor whose calibration has an effect of temperature.
    NoTemperatures {
        /// Lowest temperature of the calibration, °C.
        lower_c: f64,
        /// Highest temperature of the calibration, °C.
        upper_c: f64,
    },
    /// Temperatures that counted as missing; see [`Thermometer::implausible`](crate::Thermometer::implausible).
    FarTemperatures {
        /// Their number.
        count: usize,
    },
}

impl Sensor {
    /// Returns a doubt whether the times of a recording, s, are in milliseconds.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.clock_doubt((0..20).map(|row| 0.05 * f64::from(row))), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn clock_doubt(&self, times_s: impl Iterator<Item = f64>) -> Option<UseDoubt> {
        let recordings = &self.params().recordings;
        let lasted_s: f64 = recordings.iter().map(|one| one.last_s - one.first_s).sum();
        let rows: usize = recordings.iter().map(|one| one.rows).sum();
        let times: Vec<f64> = times_s.take(FIRST_TIMES).collect();
        let step_s = (times.last()? - times.first()?) / (times.len() - 1).max(1) as f64;
        let usual_s = lasted_s / rows as f64;
        let is_far = times.len() >= FEWEST_TIMES && step_s > FARTHER * usual_s;
        is_far.then_some(UseDoubt::Milliseconds { step_s, usual_s })
    }

    /// Returns a doubt about readings without temperatures, if the calibration has an effect of temperature.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.no_temperatures_doubt(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn no_temperatures_doubt(&self) -> Option<UseDoubt> {
        let effect = self.params().temperature?;
        Some(UseDoubt::NoTemperatures { lower_c: effect.lower_c, upper_c: effect.upper_c })
    }
}
