use ohmstrain_report::Scored;
use std::fmt;

use ohmstrain::Estimate;
use ohmstrain::trace::TraceFile;
use ohmstrain_calib::{Hold, ScoredRow, holds};
use ohmstrain_sensor::Scores;
use serde::Serialize;

use crate::error::CliError;

/// Shortest hold that is scored, s; readings have not settled in shorter ones.
const LEAST_HOLD_S: f64 = 60.0;
/// Scored rows begin this long after a hold's start, s, and end `BEFORE_END_S` before its end.
const FROM_S: f64 = 2.0;
const BEFORE_END_S: f64 = 10.0;
/// Time after a hold's start, s, up to which a row counts as early.
const EARLY_S: f64 = 30.0;

/// Scores of the settled resistance in the rows of holds, as a prediction of the reading at the hold's end, in the unit of the
/// readings.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SettledScores {
    /// Number of holds of at least a minute in which every row is scored.
    holds: usize,
    /// Number of rows in them, without the first and the last seconds.
    n: usize,
    /// Share of the rows whose 95 % interval contains the last reading of the hold.
    coverage_95: f64,
    /// The same share for rows of the first half minute.
    early_coverage_95: f64,
    rmse: f64,
    width_95: f64,
    crps: f64,
    /// RMSE of the rows' own readings as such a prediction.
    reading_rmse: f64,
}

impl SettledScores {
    /// Computes the scores for the holds of a recording whose strains have a range of `span`; `None` without a long hold.
    pub fn new(
        recording: &TraceFile,
        estimates: &[Estimate],
        part: Scored,
        span: f64,
    ) -> Result<Option<Self>, CliError> {
        let time_s = &recording.trace.time_s;
        let mut holds = holds(&recording.samples()?, span, LEAST_HOLD_S);
        holds.retain(|hold| hold.rows.clone().all(|row| part.holds(time_s[row])));
        let until = |after_start_s: f64| -> Vec<(f64, &Estimate)> {
            let of_hold = |hold: &Hold| {
                let (start_s, last_reading) = (time_s[hold.rows.start], hold.last_reading);
                let scored = FROM_S..=(hold.duration_s - BEFORE_END_S).min(after_start_s);
                let rows = estimates[hold.rows.clone()].iter();
                rows.filter(move |row| scored.contains(&(row.time_s - start_s))).map(move |row| (last_reading, row))
            };
            holds.iter().flat_map(of_hold).collect()
        };
        let (rows, early) = (until(f64::INFINITY), until(EARLY_S));
        let settled = |row: &Estimate| Some((row.settled_resistance, Some(row.settled_resistance_sd)));
        let read = |row: &Estimate| Some((row.resistance?, None));
        let (Some(all), Some(early), Some(read)) =
            (scores(&rows, settled), scores(&early, settled), scores(&rows, read))
        else {
            return Ok(None);
        };
        Ok(Some(Self {
            holds: holds.len(),
            n: all.n,
            coverage_95: all.coverage_95.unwrap_or(0.0),
            early_coverage_95: early.coverage_95.unwrap_or(0.0),
            rmse: all.rmse,
            width_95: all.width_95.unwrap_or(0.0),
            crps: all.crps,
            reading_rmse: read.rmse,
        }))
    }
}

/// Scores predictions of rows, with their deviations, against the last reading of their hold.
fn scores(rows: &[(f64, &Estimate)], prediction: impl Fn(&Estimate) -> Option<(f64, Option<f64>)>) -> Option<Scores> {
    let scored = |(truth, row): &(f64, &Estimate)| {
        let (strain, sd) = prediction(row)?;
        Some(ScoredRow { time_s: row.time_s, truth: *truth, strain, sd })
    };
    ohmstrain_calib::score(&rows.iter().filter_map(scored).collect::<Vec<_>>())
}

impl fmt::Display for SettledScores {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { holds, n, coverage_95, early_coverage_95, rmse, width_95, reading_rmse, .. } = self;
        let (all, early) = (100.0 * coverage_95, 100.0 * early_coverage_95);
        let number = |value: &f64| if *value < 10.0 { format!("{value:.3}") } else { format!("{value:.0}") };
        let (rmse, width, reading) = (number(rmse), number(width_95), number(reading_rmse));
        writeln!(
            out,
            "settled resistance against the last reading of a hold ({holds} of a minute or longer, {n} rows):"
        )?;
        write!(out, "95 % interval {all:.0} %, in the first half minute {early:.0} %, width {width}; RMSE {rmse}, ")?;
        write!(out, "of the row's own reading {reading}")
    }
}
