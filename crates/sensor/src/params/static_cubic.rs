use serde::{Deserialize, Serialize};

use crate::params::range::RangeParams;

/// Strain as a cubic polynomial of the reading, clipped to the range it was fitted on: what people use today.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticCubic {
    /// Centre of the readings it was fitted on.
    pub reading_centre: f64,
    /// Half their range.
    pub reading_scale: f64,
    /// Coefficients of 1, z, z², z³ with `z = (reading - centre)/scale`.
    pub coefficients: [f64; 4],
    /// The strains it was fitted on.
    pub range: RangeParams,
}

impl StaticCubic {
    /// The strain that a reading stands for.
    #[must_use]
    pub fn strain(&self, reading: f64) -> f64 {
        let z = (reading - self.reading_centre) / self.reading_scale;
        let [a, b, c, d] = self.coefficients;
        self.range.to_model().clamp(a + z * (b + z * (c + z * d)))
    }
}
