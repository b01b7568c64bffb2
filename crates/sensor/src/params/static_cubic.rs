use ohmstrain_ekf::live::StaticCurve;
use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

/// Strain as a cubic polynomial of the reading, clipped to the range on which it was fitted: the usual method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticCubic {
    /// Centre of the readings on which it was fitted.
    pub reading_centre: f64,
    /// Half the range of those readings.
    pub reading_scale: f64,
    /// Coefficients of 1, z, z², z³ with `z = (reading - centre)/scale`.
    pub coefficients: [f64; 4],
    /// Range of strains on which it was fitted.
    pub range: StrainRange<f64>,
    /// Standard deviation of its error on the rows to which it was fitted; `None` in sensors that were calibrated before it could be an
    /// estimator.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_sd: Option<f64>,
}

impl StaticCubic {
    /// Returns the strain for a reading.
    #[must_use]
    pub fn strain(&self, reading: f64) -> f64 {
        self.scaled(self.reading_centre, self.reading_scale, 0.0).strain(reading).mean
    }

    /// Returns it as a function of `R/R₀ - 1`, with this R₀ and its error; `None` if the error is unknown.
    #[must_use]
    pub fn curve(&self, rest_reading: f64) -> Option<StaticCurve<f64>> {
        let (centre, half_range) = (self.reading_centre / rest_reading - 1.0, self.reading_scale / rest_reading);
        self.error_sd.map(|sd| self.scaled(centre, half_range, sd * sd))
    }

    fn scaled(&self, centre: f64, half_range: f64, variance: f64) -> StaticCurve<f64> {
        StaticCurve { centre, half_range, coefficients: self.coefficients, range: self.range, variance }
    }
}
