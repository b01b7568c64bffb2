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
}

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
        Self { effect: params.temperature, rest_reading: params.rest_reading, last_c: f64::NAN }
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

    /// Converts a reading at `temperature_c`, °C, which is NaN where it was not measured, to that of the same sensor at the reference
    /// temperature.
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
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn at_reference(&mut self, reading: f64, temperature_c: f64) -> f64 {
        let Some(effect) = &self.effect else { return reading };
        if temperature_c.is_finite() {
            self.last_c = temperature_c;
        }
        effect.at_reference(self.rest_reading, reading, self.last_c)
    }
}
