use serde::{Deserialize, Serialize};

use crate::params::range::RangeParams;

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
    pub range: RangeParams,
}

impl StaticCubic {
    /// Returns the strain for a reading.
    #[must_use]
    pub fn strain(&self, reading: f64) -> f64 {
        let z = (reading - self.reading_centre) / self.reading_scale;
        let [a, b, c, d] = self.coefficients;
        self.range.to_model().clamp(a + z * (b + z * (c + z * d)))
    }
}
