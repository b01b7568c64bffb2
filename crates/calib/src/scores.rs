use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::left_out::REFERENCE_SD;

/// How good estimates are against a known strain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scores {
    /// Rows scored.
    pub n: usize,
    /// Root mean squared error, in the unit of strain.
    pub rmse: f64,
    /// The same in percent of full scale: the reference's range in the rows scored.
    pub rmse_percent_fs: f64,
    /// Mean error.
    pub bias: f64,
    /// Share of rows whose 50 % interval holds the truth; empty for estimates without a deviation.
    pub coverage_50: Option<f64>,
    /// The same for 90 %.
    pub coverage_90: Option<f64>,
    /// The same for 95 %.
    pub coverage_95: Option<f64>,
    /// Mean log density of the truth, strain in units of full scale; a reference is given a deviation of 0.5 % of it.
    pub log_score: Option<f64>,
}

/// One scored row.
#[derive(Clone, Copy, Debug)]
pub struct ScoredRow {
    /// True strain.
    pub truth: f64,
    /// Estimate.
    pub strain: f64,
    /// Its standard deviation, if it has one.
    pub sd: Option<f64>,
}

impl Scores {
    /// Scores rows; `None` if there is none. Rows with an unknown truth are passed over.
    #[must_use]
    pub fn new(rows: &[ScoredRow]) -> Option<Self> {
        let rows: Vec<&ScoredRow> = rows.iter().filter(|row| row.truth.is_finite()).collect();
        let n = rows.len();
        let count = n as f64;
        let mean = |of: &dyn Fn(&ScoredRow) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() / count;
        let full_scale = rows
            .iter()
            .fold(None, |range, row| {
                let (low, high) = range.unwrap_or((row.truth, row.truth));
                Some((row.truth.min(low), row.truth.max(high)))
            })
            .map(|(low, high)| high - low)?;
        let rmse = mean(&|row| (row.strain - row.truth).powi(2)).sqrt();
        let has_sd = rows.iter().all(|row| row.sd.is_some());
        let covered = |level: f64| has_sd.then(|| mean(&|row| f64::from(u8::from(row.is_covered(level)))));
        Some(Self {
            n,
            rmse,
            rmse_percent_fs: 100.0 * rmse / full_scale,
            bias: mean(&|row| row.strain - row.truth),
            coverage_50: covered(0.5),
            coverage_90: covered(0.9),
            coverage_95: covered(0.95),
            log_score: has_sd.then(|| mean(&|row| row.log_density(full_scale))),
        })
    }
}

impl ScoredRow {
    fn is_covered(&self, level: f64) -> bool {
        let half_width = Normal::standard().inverse_cdf(0.5 + 0.5 * level) * self.sd.unwrap_or(0.0);
        (self.strain - self.truth).abs() <= half_width
    }

    fn log_density(&self, full_scale: f64) -> f64 {
        let variance = (self.sd.unwrap_or(0.0) / full_scale).powi(2) + REFERENCE_SD.powi(2);
        let error = (self.strain - self.truth) / full_scale;
        -0.5 * (error * error / variance + (std::f64::consts::TAU * variance).ln())
    }
}
