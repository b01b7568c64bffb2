use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

/// An interval of strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeParams {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

impl RangeParams {
    /// Converts it to the model's range.
    #[must_use]
    pub const fn to_model(self) -> StrainRange<f64> {
        StrainRange { lower: self.lower, upper: self.upper }
    }

    /// Length.
    #[must_use]
    pub fn span(self) -> f64 {
        self.upper - self.lower
    }
}
