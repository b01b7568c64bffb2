//! Findings of a calibration, stored with the sensor. No computation uses them.

use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

use crate::params::summary::{Limit, Summary};

/// Number of tenths of a range.
pub const TENTHS: usize = 10;

/// Scores of a calibration, and a summary of its recordings.
///
/// Every quarter of the recordings is estimated with a law and a correction fitted to the other three, and scored; so is
/// the static cubic. Structure, ridge, noise and motion were chosen on all quarters, so estimates of a recording of
/// another day may be somewhat worse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Findings {
    /// The default estimator's filter on the held-out quarters.
    pub filter: Scores,
    /// Its smoother, which uses the whole recording; `None` if it has none.
    pub smoother: Option<Scores>,
    /// The static cubic.
    pub static_cubic: Scores,
    /// Contributions to the error.
    pub budget: ErrorBudget,
    /// Content of the recordings.
    pub seen: RecordingSummary,
    /// Advice on the next recording, most important first; empty if nothing stands out.
    pub advice: Vec<String>,
}

/// Content of the recordings of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingSummary {
    /// Range of the reference.
    pub range: StrainRange<f64>,
    /// Share of the rows, 0 to 1, in each tenth of that range, lowest first.
    pub tenths: [f64; TENTHS],
    /// Lower and upper quartile of the speed in moving rows, 1/s.
    pub quartile_speeds: (f64, f64),
    /// 99th percentile of the speed, per second.
    pub fastest_rate: f64,
    /// Longest hold, s; zero if the body never rests.
    pub longest_hold_s: f64,
    /// Longest recording, s.
    pub longest_s: f64,
    /// Number of rows with reading and reference.
    pub rows: usize,
}

/// Contributions to the error of a calibrated filter, from held-out parts of the recordings.
///
/// Law, drift and noise are parts of the residual of the readings when the true strain drives the law, in percent of the
/// readings' range. The part that is constant over a held-out part is drift, the part that differs from row to row is noise,
/// and the rest is the law's. Direction is the filter's contribution: the squared error of rows in which it takes stretching
/// for releasing, or the reverse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorBudget {
    /// Error of the law's form and parameters, percent of the readings' range.
    pub law_percent: f64,
    /// Offset of whole parts, percent of the readings' range.
    pub drift_percent: f64,
    /// White noise of single readings, percent of the readings' range.
    pub noise_percent: f64,
    /// Share of the moving rows, 0 to 1, in which the direction is wrong.
    pub wrong_rows: f64,
    /// Share of the total squared error, 0 to 1, in those rows.
    pub wrong_error: f64,
}

/// Scores of estimates against a known strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Number of rows scored.
    pub n: usize,
    /// Root mean squared error, in the unit of strain.
    pub rmse: f64,
    /// Root mean squared error in percent of full scale: the reference's range in the rows scored.
    pub rmse_percent_fs: f64,
    /// Mean absolute error, in the unit of strain.
    pub mae: f64,
    /// Mean error, in the unit of strain.
    pub bias: f64,
    /// Share of rows whose 50 % interval contains the truth; `None` for estimates without a standard deviation.
    pub coverage_50: Option<f64>,
    /// Share of rows whose 90 % interval contains the truth.
    pub coverage_90: Option<f64>,
    /// Share of rows whose 95 % interval contains the truth.
    pub coverage_95: Option<f64>,
    /// Mean width of the 95 % interval, in the unit of strain: the price of the coverage.
    pub width_95: Option<f64>,
    /// Mean width of the 95 % interval in percent of full scale.
    pub width_95_percent_fs: Option<f64>,
    /// Mean continuous ranked probability score, in the unit of strain, of a normal distribution with the reported
    /// estimate (within the limits) as its mean, and its standard deviation. Smaller is better: both large errors and
    /// wide intervals increase it. Without a standard deviation it is the absolute error, so that estimates with and
    /// without one are comparable.
    ///
    /// Source: Gneiting & Raftery, *J. Am. Stat. Assoc.* 102 (2007) 359, eq. 21.
    pub crps: f64,
    /// Mean continuous ranked probability score in percent of full scale.
    pub crps_percent_fs: f64,
    /// Mean log density of the truth, strain in units of full scale; the reference is assumed to have a standard
    /// deviation of 0.5 % of it.
    pub log_score: Option<f64>,
    /// Share of the time in which the error is above 20 % of full scale for 2 s or longer.
    pub wrong_branch: f64,
}

/// Parts of a filter's squared error, each 0 to 1; they sum to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorShares {
    /// Share of the law's form and parameters.
    pub law: f64,
    /// Share of rows in which the direction is wrong.
    pub direction: f64,
    /// Share of slow changes that strain does not explain.
    pub drift: f64,
    /// Share of single readings' noise.
    pub noise: f64,
}

impl ErrorShares {
    /// Returns the shares with their names, the largest first.
    #[must_use]
    pub fn sorted(&self) -> [(Limit, f64); 4] {
        let mut parts = [
            (Limit::Law, self.law),
            (Limit::Direction, self.direction),
            (Limit::Drift, self.drift),
            (Limit::Noise, self.noise),
        ];
        parts.sort_by(|a, b| b.1.total_cmp(&a.1));
        parts
    }
}

impl ErrorBudget {
    /// Returns the shares of the squared error of the strain: that of the rows with a wrong direction, and that of the other rows,
    /// divided among law, drift and noise in proportion to their squared contributions to the readings.
    #[must_use]
    pub fn shares(&self) -> ErrorShares {
        let squares = [self.law_percent, self.drift_percent, self.noise_percent].map(|percent| percent * percent);
        let sum: f64 = squares.iter().sum();
        // Without any residual, the error cannot be divided and counts as the law's.
        let [law, drift, noise] = if sum > 0.0 { squares.map(|square| square / sum) } else { [1.0, 0.0, 0.0] };
        let others = 1.0 - self.wrong_error;
        ErrorShares { law: others * law, direction: self.wrong_error, drift: others * drift, noise: others * noise }
    }

    /// Returns the largest of [`ErrorBudget::shares`].
    #[must_use]
    pub fn limit(&self) -> Limit {
        self.shares().sorted()[0].0
    }
}

impl From<&Findings> for Summary {
    fn from(found: &Findings) -> Self {
        Self {
            left_out_percent_fs: found.filter.rmse_percent_fs,
            smoothed_percent_fs: found.smoother.map(|scores| scores.rmse_percent_fs),
            static_cubic_percent_fs: found.static_cubic.rmse_percent_fs,
            coverage_95_percent: 100.0 * found.filter.coverage_95.unwrap_or(0.0),
            width_95_percent_fs: found.filter.width_95_percent_fs.unwrap_or(0.0),
            limited_by: found.budget.limit(),
        }
    }
}
