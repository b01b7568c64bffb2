use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::calibrate::left_out::REFERENCE_SD;
use crate::order::{self, range};
use crate::samples::{LONGEST_GAP, usual_step_s};
use ohmstrain_sensor::Scores;

/// Error, as a fraction of full scale, and duration, s, beyond which the estimate is taken to follow another solution.
const WRONG_BRANCH: (f64, f64) = (0.2, 2.0);

/// One scored row.
#[derive(Clone, Copy, Debug)]
pub struct ScoredRow {
    /// Time, s.
    pub time_s: f64,
    /// True strain.
    pub truth: f64,
    /// Estimate.
    pub strain: f64,
    /// Its standard deviation, if it has one.
    pub sd: Option<f64>,
}

/// Scores rows; `None` if there are none. Rows without a true strain are skipped.
#[must_use]
pub fn score(rows: &[ScoredRow]) -> Option<Scores> {
    let rows: Vec<&ScoredRow> = rows.iter().filter(|row| row.truth.is_finite()).collect();
    let n = rows.len();
    let mean = |of: &dyn Fn(&ScoredRow) -> f64| order::mean(rows.iter().map(|row| of(row)));
    let (low, high) = range(rows.iter().map(|row| row.truth))?;
    let full_scale = high - low;
    let rmse = mean(&|row| (row.strain - row.truth).powi(2)).sqrt();
    let has_sd = rows.iter().all(|row| row.sd.is_some());
    let covered = |level: f64| has_sd.then(|| mean(&|row| f64::from(u8::from(row.is_covered(level)))));
    let width_95 = has_sd.then(|| mean(&|row| 2.0 * row.half_width(0.95)));
    let crps = mean(&ScoredRow::crps);
    Some(Scores {
        n,
        rmse,
        rmse_percent_fs: 100.0 * rmse / full_scale,
        mae: mean(&|row| (row.strain - row.truth).abs()),
        bias: mean(&|row| row.strain - row.truth),
        coverage_50: covered(0.5),
        coverage_90: covered(0.9),
        coverage_95: covered(0.95),
        width_95,
        width_95_percent_fs: width_95.map(|width| 100.0 * width / full_scale),
        crps,
        crps_percent_fs: 100.0 * crps / full_scale,
        log_score: has_sd.then(|| mean(&|row| row.log_density(full_scale))),
        wrong_branch: wrong_branch(&rows, full_scale),
    })
}

/// Returns the scores if their errors are finite in percent of full scale; `None` if the truth is constant or an estimate is NaN.
pub(crate) fn score_of_full_scale(rows: &[ScoredRow]) -> Option<Scores> {
    score(rows).filter(|scores| scores.rmse_percent_fs.is_finite())
}

/// Returns the share of the scored time in which the estimate follows another solution; gaps between scored rows are not scored.
fn wrong_branch(rows: &[&ScoredRow], full_scale: f64) -> f64 {
    let time_s: Vec<f64> = rows.iter().map(|row| row.time_s).collect();
    let longest_s = LONGEST_GAP * usual_step_s(std::iter::once(&time_s[..]));
    let parts = rows.chunk_by(|a, b| b.time_s - a.time_s <= longest_s).map(|part| wrong_time_s(part, full_scale));
    let (wrong_s, total_s) =
        parts.fold((0.0, 0.0), |(wrong_s, total_s), (wrong, all)| (wrong_s + wrong, total_s + all));
    if total_s > 0.0 { wrong_s / total_s } else { 0.0 }
}

/// Returns the time in which the estimate follows another solution, and that between the first and the last row, s.
fn wrong_time_s(rows: &[&ScoredRow], full_scale: f64) -> (f64, f64) {
    let wrong = |row: &ScoredRow| (row.strain - row.truth).abs() > WRONG_BRANCH.0 * full_scale;
    let (mut total, mut since) = (0.0, None);
    for (k, row) in rows.iter().enumerate() {
        let last = k + 1 == rows.len();
        match (since, wrong(row) && !last) {
            (None, true) => since = Some(row.time_s),
            (Some(start), false) => {
                total += Some(row.time_s - start).filter(|duration| *duration >= WRONG_BRANCH.1).unwrap_or(0.0);
                since = None;
            }
            _ => {}
        }
    }
    let (first, last) = (rows.first().map_or(0.0, |row| row.time_s), rows.last().map_or(0.0, |row| row.time_s));
    (total, last - first)
}

impl ScoredRow {
    fn is_covered(&self, level: f64) -> bool {
        (self.strain - self.truth).abs() <= self.half_width(level)
    }

    fn half_width(&self, level: f64) -> f64 {
        Normal::standard().inverse_cdf(0.5 + 0.5 * level) * self.sd.unwrap_or(0.0)
    }

    fn crps(&self) -> f64 {
        let error = (self.truth - self.strain).abs();
        let Some(sd) = self.sd.filter(|sd| *sd > 0.0) else { return error };
        let (normal, z) = (Normal::standard(), error / sd);
        sd * (z * (2.0 * normal.cdf(z) - 1.0) + 2.0 * normal.pdf(z) - 0.5 * std::f64::consts::FRAC_2_SQRT_PI)
    }

    fn log_density(&self, full_scale: f64) -> f64 {
        let variance = (self.sd.unwrap_or(0.0) / full_scale).powi(2) + REFERENCE_SD.powi(2);
        let error = (self.strain - self.truth) / full_scale;
        -0.5 * (error * error / variance + (std::f64::consts::TAU * variance).ln())
    }
}

#[cfg(test)]
mod tests {
    use super::{ScoredRow, score, score_of_full_scale};

    #[test]
    fn short_excursions_are_no_wrong_branch() {
        // One row a second, full scale 1: errors of 0.3 in rows 10 to 11 (until 12, 2 s), in row 30, and of 0.1 before.
        let row = |k: u32| {
            let error = match k {
                10 | 11 | 30 => 0.3,
                0..10 => 0.1,
                _ => 0.0,
            };
            let truth = f64::from(k % 2);
            ScoredRow { time_s: f64::from(k), truth, strain: truth + error, sd: None }
        };
        let rows: Vec<ScoredRow> = (0..=40).map(row).collect();
        assert_eq!(score(&rows).unwrap().wrong_branch, 2.0 / 40.0);
    }

    /// One row a second; errors of 0.3 before and after a gap, for a second each, and no truth in between.
    #[test]
    fn a_gap_is_no_wrong_branch() {
        let row = |k: u32| {
            let truth = if (12..40).contains(&k) { f64::NAN } else { f64::from(k % 2) };
            let error = if (11..=40).contains(&k) { 0.3 } else { 0.0 };
            ScoredRow { time_s: f64::from(k), truth, strain: truth + error, sd: None }
        };
        assert_eq!(score(&(0..=60).map(row).collect::<Vec<_>>()).unwrap().wrong_branch, 0.0);
    }

    /// Neither zero error over zero full scale nor an error of a NaN estimate is a number.
    #[test]
    fn there_is_no_percentage_of_a_constant() {
        let row = |k: u32, truth: f64, strain: f64| ScoredRow { time_s: f64::from(k), truth, strain, sd: None };
        let constant: Vec<ScoredRow> = (0..9).map(|k| row(k, 0.1, 0.1)).collect();
        let lost: Vec<ScoredRow> = (0..9).map(|k| row(k, f64::from(k), f64::NAN)).collect();
        let known: Vec<ScoredRow> = (0..9).map(|k| row(k, f64::from(k), 1.0)).collect();
        for (rows, is_known) in [(constant, false), (lost, false), (known, true)] {
            assert_eq!(score_of_full_scale(&rows).is_some(), is_known);
        }
    }
}
