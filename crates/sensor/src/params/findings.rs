//! Findings of a calibration, kept with the sensor. Nothing computes with them.

use serde::{Deserialize, Serialize};

use crate::params::range::RangeParams;
use crate::params::summary::{Limit, Summary};

/// Tenths of a range.
pub const TENTHS: usize = 10;

/// Scores of a calibration, and what it rests on.
///
/// Every quarter of the recordings is estimated by a law and a correction that were fitted to the other three, and scored;
/// the static cubic likewise. Structure, ridge, noise and motion were chosen with all quarters in view, so that a
/// recording of another day may be estimated somewhat worse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Findings {
    /// The default estimator's filter on the quarters left out.
    pub filter: Scores,
    /// Its smoother, which sees the whole recording; `None` if it has none.
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
    pub range: RangeParams,
    /// Share of the rows, 0 to 1, in each tenth of that range, lowest first.
    pub tenths: [f64; TENTHS],
    /// Speeds that a quarter of the moving rows is below, and above, per second.
    pub quartile_speeds: (f64, f64),
    /// 99th percentile of the speed, per second.
    pub fastest_rate: f64,
    /// Longest hold, s; zero if the body never rests.
    pub longest_hold_s: f64,
    /// Longest recording, s.
    pub longest_s: f64,
    /// Rows with reading and reference.
    pub rows: usize,
}

/// Contributions to the error of a calibrated filter, from parts of the recordings that its law was not fitted to.
///
/// Law, drift and noise are what the law leaves of the readings where the true strain drives it, in percent of the readings'
/// range: what is the same throughout a part is drift, what differs from row to row is noise, the rest is the law's. The
/// direction is the filter's affair: the squared error of rows in which it takes stretching for releasing, or the reverse.
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
    /// Share of all squared error, 0 to 1, in those rows.
    pub wrong_error: f64,
}

/// Scores of estimates against a known strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Rows scored.
    pub n: usize,
    /// Root mean squared error, in the unit of strain.
    pub rmse: f64,
    /// Root mean squared error in percent of full scale: the reference's range in the rows scored.
    pub rmse_percent_fs: f64,
    /// Mean absolute error, in the unit of strain.
    pub mae: f64,
    /// Mean error.
    pub bias: f64,
    /// Share of rows whose 50 % interval holds the truth; empty for estimates without a deviation.
    pub coverage_50: Option<f64>,
    /// Share of rows whose 90 % interval holds the truth.
    pub coverage_90: Option<f64>,
    /// Share of rows whose 95 % interval holds the truth.
    pub coverage_95: Option<f64>,
    /// Mean width of the 95 % interval, in the unit of strain: what the coverage was bought with.
    pub width_95: Option<f64>,
    /// Mean width of the 95 % interval in percent of full scale.
    pub width_95_percent_fs: Option<f64>,
    /// Mean continuous ranked probability score, in the unit of strain: of a normal distribution with the estimate as its
    /// mean, as reported (within the limits), and its deviation. Less is better, whether an error is too large or an
    /// interval too wide; without a deviation it is the absolute error, so that estimates with and without one compare.
    ///
    /// Source: Gneiting & Raftery, *J. Am. Stat. Assoc.* 102 (2007) 359, eq. 21.
    pub crps: f64,
    /// Mean continuous ranked probability score in percent of full scale.
    pub crps_percent_fs: f64,
    /// Mean log density of the truth, strain in units of full scale; a reference is given a deviation of 0.5 % of it.
    pub log_score: Option<f64>,
    /// Share of the time on the wrong branch: the error is above 20 % of full scale for 2 s or longer.
    pub wrong_branch: f64,
}

/// Parts of a filter's squared error, each 0 to 1; together they are 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorShares {
    /// Share of the law's form and parameters.
    pub law: f64,
    /// Share of rows in which the direction is wrong.
    pub direction: f64,
    /// Share of slow changes.
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
    /// Returns the shares of the squared error of the strain: of the rows where the direction is wrong; and of the other rows, divided
    /// among law, drift and noise by the squares of their contributions to the readings.
    #[must_use]
    pub fn shares(&self) -> ErrorShares {
        let squares = [self.law_percent, self.drift_percent, self.noise_percent].map(|percent| percent * percent);
        let sum: f64 = squares.iter().sum();
        // Where the law leaves nothing, what there is of error is not told apart, and counted as the law's.
        let [law, drift, noise] = if sum > 0.0 { squares.map(|square| square / sum) } else { [1.0, 0.0, 0.0] };
        let others = 1.0 - self.wrong_error;
        ErrorShares { law: others * law, direction: self.wrong_error, drift: others * drift, noise: others * noise }
    }

    /// Largest contribution to the error, of [`ErrorBudget::shares`].
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
