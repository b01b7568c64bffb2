//! Prior of a make, learned from calibrated sensors; with it, a short motion suffices to calibrate the next one.
//!
//! Empirical Bayes: mean and spread over the sensors are the prior of one more. The law's regression uses it as further rows. The search
//! for noise and motion starts from it and is pulled toward it. The correction learns from some rows of every sensor, beside the new one's
//! own. R₀ is not shared between sensors.

mod law;
mod learn;
mod noise;
mod population;
mod probe;
mod rows;
mod validate;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use law::LawPrior;
pub(crate) use learn::is_covariance;
pub use noise::EstimatorPrior;
pub use rows::CorrectionPrior;
pub(crate) use rows::ROWS;

use ohmstrain_sensor::{EstimatorKind, Quantity, Validity};

/// Version of the format of a prior's file.
pub const PRIOR_FORMAT: u32 = 2;
/// Least number of sensors from which a spread can be estimated.
pub(crate) const FEWEST_SENSORS: usize = 3;

/// The content of `prior.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// Version of the format, [`PRIOR_FORMAT`].
    pub format: u32,
    /// Program and version that made it.
    pub made_by: String,
    /// Number of sensors from which it was learned.
    pub sensors: usize,
    /// The estimated quantity.
    pub quantity: Quantity,
    /// Calibrated range of the median sensor; its readings over R₀.
    pub validity: Validity,
    /// The law.
    pub law: LawPrior,
    /// Noise and motion, per estimator.
    pub estimators: BTreeMap<EstimatorKind, EstimatorPrior>,
    /// The correction; `None` if too few sensors have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<CorrectionPrior>,
}

impl Prior {
    /// Returns the calibrated range of a sensor with this R₀, joined with that of the others.
    pub(crate) fn joined(&self, own: Validity, rest_reading: f64) -> Validity {
        let of_make = &self.validity;
        Validity {
            lower: own.lower.min(of_make.lower),
            upper: own.upper.max(of_make.upper),
            reading_lower: own.reading_lower.min(of_make.reading_lower * rest_reading),
            reading_upper: own.reading_upper.max(of_make.reading_upper * rest_reading),
            fastest_rate_per_s: own.fastest_rate_per_s.max(of_make.fastest_rate_per_s),
            duration_s: own.duration_s.max(of_make.duration_s),
            drifts: own.drifts || of_make.drifts,
            longest_repeat_s: own.longest_repeat_s.max(of_make.longest_repeat_s),
            longest_unturned_s: own
                .longest_unturned_s
                .map(|own_s| own_s.max(of_make.longest_unturned_s.unwrap_or(own_s))),
            resolution: own.resolution,
        }
    }
}

/// Returns the median; zero without any values.
fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    crate::order::median(values).unwrap_or(0.0)
}

#[cfg(test)]
mod tests;
