use ohmstrain_sensor::TemperatureParams;

use crate::Sensor;

/// Conversion of one stream of readings to a sensor's reference temperature. A missing temperature is that of the reading before.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// use ohmstrain::Thermometer;
///
/// let (mut thermometer, mut filter) = (Thermometer::new(&sensor), sensor.filter().build()?);
/// let (time_s, ohm, celsius) = (0.0, 1612.0, 31.5);
/// filter.step(time_s, thermometer.at_reference(ohm, celsius))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Thermometer {
    effect: Option<TemperatureParams>,
    rest_reading: f64,
    last_c: f64,
    /// Number of temperatures that counted as not measured.
    implausible: usize,
}

/// Smallest distance from the calibrated temperatures at which one is implausible, K; more if these cover a wider range.
const FAR_K: f64 = 10.0;

impl Thermometer {
    /// Creates the conversion for readings of a sensor; it changes nothing if the sensor's calibration has no effect of temperature.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut thermometer = ohmstrain::Thermometer::new(&sensor);
    /// assert_eq!(thermometer.at_reference(1612.0, 31.5), 1612.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new(sensor: &Sensor) -> Self {
        let params = sensor.params();
        Self { effect: params.temperature, rest_reading: params.rest_reading, last_c: f64::NAN, implausible: 0 }
    }

    /// Returns the last temperature, °C; `None` before the first.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(ohmstrain::Thermometer::new(&sensor).last_c(), None);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn last_c(&self) -> Option<f64> {
        Some(self.last_c).filter(|last_c| last_c.is_finite())
    }

    /// Continues from the last temperature of an earlier stream.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(ohmstrain::Thermometer::new(&sensor).after(Some(21.5)).last_c(), Some(21.5));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn after(self, last_c: Option<f64>) -> Self {
        Self { last_c: last_c.unwrap_or(f64::NAN), ..self }
    }

    /// Returns the number of implausible temperatures: farther beyond those of the calibration than their range, and than 10 K. They come
    /// from a probe that is disconnected, for instance.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(ohmstrain::Thermometer::new(&sensor).implausible(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn implausible(&self) -> usize {
        self.implausible
    }

    /// Converts a reading at `temperature_c`, °C, which is NaN where it was not measured, to that of the same sensor at the reference
    /// temperature. An implausible temperature counts as not measured.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// use ohmstrain::{Sensor, TemperatureParams, Thermometer};
    ///
    /// let mut params = Sensor::from_toml(&text)?.params().clone();
    /// params.temperature = Some(TemperatureParams {
    ///     reference_c: 25.0,
    ///     lower_c: 10.0,
    ///     upper_c: 40.0,
    ///     rest_per_k: 0.003,
    ///     rest_per_k_sd: 0.0001,
    ///     gain_per_k: 0.0,
    ///     gain_per_k_sd: 0.0,
    /// });
    /// let mut thermometer = Thermometer::new(&Sensor::from_params(params)?);
    /// assert!((thermometer.at_reference(1030.0, 35.0) - 1000.0).abs() < 1e-9);
    /// assert!((thermometer.at_reference(1030.0, f64::NAN) - 1000.0).abs() < 1e-9);
    /// // A disconnected probe.
    /// assert!((thermometer.at_reference(1030.0, -127.0) - 1000.0).abs() < 1e-9);
    /// assert_eq!(thermometer.implausible(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn at_reference(&mut self, reading: f64, temperature_c: f64) -> f64 {
        let Some(effect) = &self.effect else { return reading };
        let far_k = (effect.upper_c - effect.lower_c).max(FAR_K);
        if (effect.lower_c - far_k..=effect.upper_c + far_k).contains(&temperature_c) {
            self.last_c = temperature_c;
        } else if temperature_c.is_finite() {
            self.implausible += 1;
        }
        effect.at_reference(self.rest_reading, reading, self.last_c)
    }
}
