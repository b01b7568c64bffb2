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
        let z = (reading - self.reading_centre) / self.reading_scale;
        let [a, b, c, d] = self.coefficients;
        self.range.clamp(a + z * (b + z * (c + z * d)))
    }

    /// Returns it as a function of `R/R₀ - 1`, with this R₀ and its error; `None` if the error is unknown.
    #[must_use]
    pub fn curve(&self, rest_reading: f64) -> Option<StaticCurve<f64>> {
        self.error_sd.map(|sd| StaticCurve {
            centre: self.reading_centre / rest_reading - 1.0,
            half_range: self.reading_scale / rest_reading,
            coefficients: self.coefficients,
            range: self.range,
            variance: sd * sd,
        })
    }
}
