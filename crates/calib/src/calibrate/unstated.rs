//! Errors that an estimator does not state.

use ohmstrain_sensor::Unstated;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::calibrate::scores::ScoredRow;
use crate::order::sorted;
use crate::sd_scale::Z_95;

/// Share of the rows that an interval should cover.
const LEVEL: f64 = 0.95;

/// Returns the least standard deviation that, added in quadrature to those of filter and smoother, makes their 95 % intervals cover 95 % of
/// the rows, with errors multiplied by `factor`. Rows without a true strain are skipped.
#[must_use]
pub fn unstated(filter: &[ScoredRow], smoother: &[ScoredRow], factor: f64) -> Unstated {
    Unstated { filter_sd: unstated_sd(filter, factor), smoother_sd: unstated_sd(smoother, factor) }
}

/// Returns the factor on errors of held-out quarters for a number of strokes: the 97.5 % quantile of Student's t with 2n - 1 degrees of
/// freedom over that of a normal distribution. Errors within a stroke are correlated: n strokes and the n - 1 turns between them count as
/// 2n - 1 draws (Student, *Biometrika* 6 (1908) 1).
pub(crate) fn error_factor(strokes: f64) -> f64 {
    let freedom = (2.0 * strokes - 1.0).max(1.0);
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |t| t.inverse_cdf(0.5 + 0.5 * LEVEL) / Z_95)
}

fn unstated_sd(rows: &[ScoredRow], factor: f64) -> f64 {
    let lacks = |row: &ScoredRow| {
        let needed = factor * (row.strain - row.truth) / Z_95;
        row.sd.map(|sd| needed * needed - sd * sd).filter(|lacks| lacks.is_finite())
    };
    let lacking = sorted(rows.iter().filter_map(lacks));
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
    use super::{ScoredRow, error_factor, unstated};

    /// Nineteen of twenty errors lie within 1.96 deviations of 0.05 and 0.12 combined, one far beyond.
    #[test]
    fn intervals_hold_nineteen_rows_of_twenty() {
        let row =
            |k: u32, error: f64| ScoredRow { time_s: f64::from(k), truth: 0.1, strain: 0.1 + error, sd: Some(0.05) };
        let rows: Vec<ScoredRow> = (0..20).map(|k| row(k, if k == 7 { 9.0 } else { 1.959_964 * 0.13 })).collect();
        let found = unstated(&rows, &[], 1.0);
        assert!((found.filter_sd - 0.12).abs() < 1e-6 && found.smoother_sd == 0.0, "{found:?}");
        let widened: Vec<ScoredRow> = rows.iter().map(|row| row.with_unstated(found.filter_sd + 1e-9)).collect();
        assert_eq!(crate::score(&widened).unwrap().coverage_95, Some(0.95));
        assert!(unstated(&widened, &widened, 1.0).is_none());
        // Errors of 0.13 that count as 0.3 need √(0.3² - 0.05²).
        let counted = unstated(&rows, &[], 0.3 / 0.13);
        assert!((counted.filter_sd - 0.0875_f64.sqrt()).abs() < 1e-6, "{counted:?}");
    }

    /// Compared with a table of Student's t at 97.5 %, to its three decimals: 1, 3, 5 and 119 degrees of freedom.
    #[test]
    fn few_strokes_count_as_students_t() {
        for (strokes, t) in [(0.2, 12.706), (1.0, 12.706), (2.0, 3.182), (3.0, 2.571), (60.5, 1.980)] {
            let half_width = error_factor(strokes) * 1.959_964;
            assert!((half_width - t).abs() < 6e-4, "{strokes}: {half_width}");
        }
    }
}
