//! Errors that an estimator does not state.

use ohmstrain_sensor::Unstated;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::calibrate::scores::ScoredRow;

/// Share of the rows that an interval should cover.
const LEVEL: f64 = 0.95;

/// Returns the least standard deviation that, added in quadrature to those of filter and smoother, makes their 95 % intervals cover 95 % of
/// the rows. Rows without a true strain are skipped.
#[must_use]
pub fn unstated(filter: &[ScoredRow], smoother: &[ScoredRow]) -> Unstated {
    Unstated { filter_sd: unstated_sd(filter), smoother_sd: unstated_sd(smoother) }
}

fn unstated_sd(rows: &[ScoredRow]) -> f64 {
    let deviations = Normal::standard().inverse_cdf(0.5 + 0.5 * LEVEL);
    let lacks = |row: &ScoredRow| {
        let needed = (row.strain - row.truth) / deviations;
        row.sd.map(|sd| needed * needed - sd * sd).filter(|lacks| lacks.is_finite())
    };
    let mut lacking: Vec<f64> = rows.iter().filter_map(lacks).collect();
    lacking.sort_unstable_by(f64::total_cmp);
    let held = (LEVEL * lacking.len() as f64).ceil() as usize;
    let variance = held.checked_sub(1).and_then(|last| lacking.get(last)).copied().unwrap_or(0.0);
    variance.max(0.0).sqrt()
}

impl ScoredRow {
    /// Returns the row with a standard deviation added in quadrature to that of its strain.
    #[must_use]
    pub fn with_unstated(self, sd: f64) -> Self {
        Self { sd: self.sd.map(|stated| stated.hypot(sd)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::{ScoredRow, unstated};

    /// Nineteen of twenty errors lie within 1.96 deviations of 0.05 and 0.12 combined, one far beyond.
    #[test]
    fn intervals_hold_nineteen_rows_of_twenty() {
        let row =
            |k: u32, error: f64| ScoredRow { time_s: f64::from(k), truth: 0.1, strain: 0.1 + error, sd: Some(0.05) };
        let rows: Vec<ScoredRow> = (0..20).map(|k| row(k, if k == 7 { 9.0 } else { 1.959_964 * 0.13 })).collect();
        let found = unstated(&rows, &[]);
        assert!((found.filter_sd - 0.12).abs() < 1e-6 && found.smoother_sd == 0.0, "{found:?}");
        let widened: Vec<ScoredRow> = rows.iter().map(|row| row.with_unstated(found.filter_sd + 1e-9)).collect();
        assert_eq!(crate::score(&widened).unwrap().coverage_95, Some(0.95));
        assert!(unstated(&widened, &widened).is_none());
    }
}
