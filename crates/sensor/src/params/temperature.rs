use serde::{Deserialize, Serialize};

use crate::params::SensorParams;
use crate::params::unstated::Unstated;

/// Effect of temperature on the readings: `R(T) = R₀ (1 + α_R ΔT) (1 + ρ (1 + α_ρ ΔT))`, where ρ is the change of resistance that the law
/// gives, and ΔT the difference from [`Self::reference_c`], K. All other parameters of the sensor are those at that temperature.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemperatureParams {
    /// Temperature of the calibration, °C: the median of its rows.
    pub reference_c: f64,
    /// Lowest temperature of the calibration, °C.
    pub lower_c: f64,
    /// Highest temperature of the calibration, °C.
    pub upper_c: f64,
    /// Relative change of R₀ per kelvin, α_R.
    pub rest_per_k: f64,
    /// Standard deviation of α_R.
    pub rest_per_k_sd: f64,
    /// Relative change of ρ per kelvin, α_ρ.
    pub gain_per_k: f64,
    /// Standard deviation of α_ρ.
    pub gain_per_k_sd: f64,
}

impl TemperatureParams {
    /// Least value of `1 + α_R ΔT` and `1 + α_ρ ΔT`: temperatures at which a linear effect would be larger are outside of its meaning.
    pub const LEAST_FACTOR: f64 = 0.2;

    /// Converts a reading at `temperature_c` to what the same sensor would read at the reference temperature, given R₀ there. Without a
    /// temperature (NaN) the reading stays as it is.
    #[must_use]
    pub fn at_reference(&self, rest_reading: f64, reading: f64, temperature_c: f64) -> f64 {
        if !temperature_c.is_finite() {
            return reading;
        }
        let above_k = temperature_c - self.reference_c;
        let factor = |per_k: f64| (1.0 + per_k * above_k).max(Self::LEAST_FACTOR);
        rest_reading + (reading / factor(self.rest_per_k) - rest_reading) / factor(self.gain_per_k)
    }

    /// Converts a column of readings, given R₀ at the reference temperature. A missing temperature is that of the row before.
    #[must_use]
    pub fn column_at_reference(&self, rest_reading: f64, readings: &[f64], temperature_c: &[f64]) -> Vec<f64> {
        let mut last_c = f64::NAN;
        let converted = |(reading, value): (&f64, &f64)| {
            last_c = if value.is_finite() { *value } else { last_c };
            self.at_reference(rest_reading, *reading, last_c)
        };
        readings.iter().zip(temperature_c).map(converted).collect()
    }

    /// Returns the variance of a reading over R₀ due to coefficients whose effect is not removed, for readings that are evenly
    /// distributed between `1 + low` and `1 + high`, and temperatures evenly distributed over the calibration's.
    fn variance(&self, rest_per_k: f64, gain_per_k: f64, (low, high): (f64, f64)) -> f64 {
        // By kelvin: rest_per_k (1 + ρ) + gain_per_k ρ.
        let (middle, slope) = (0.5 * (low + high), rest_per_k + gain_per_k);
        let square_per_k = (rest_per_k + slope * middle).powi(2) + slope * slope * (high - low).powi(2) / 12.0;
        square_per_k * (self.upper_c - self.lower_c).powi(2) / 12.0
    }

    /// Returns the variance of a reading over R₀ that the uncertainty of the coefficients leaves.
    pub(crate) fn left_variance(&self, readings: (f64, f64)) -> f64 {
        self.variance(self.rest_per_k_sd, 0.0, readings) + self.variance(0.0, self.gain_per_k_sd, readings)
    }
}

impl SensorParams {
    /// Prepares the parameters for readings whose temperature is not known: intervals are wider by what the calibration's temperatures
    /// do.
    pub fn forget_temperature(&mut self) {
        let Some(temperature) = self.temperature.take() else { return };
        let readings = self.relative_readings();
        let of_effect = temperature.variance(temperature.rest_per_k, temperature.gain_per_k, readings);
        let variance = of_effect + temperature.left_variance(readings);
        let sd = self.strain_per_reading() * variance.sqrt();
        let Unstated { filter_sd, smoother_sd } = self.unstated;
        self.unstated = Unstated { filter_sd: filter_sd.hypot(sd), smoother_sd: smoother_sd.hypot(sd) };
    }
}
