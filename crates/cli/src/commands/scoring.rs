use ohmstrain::Estimate;
use ohmstrain_calib::{Baseline, ScoredRow};
use ohmstrain_sensor::Scores;

use crate::input::TraceFile;

/// The rows that are scored, by their times.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// Rows at this time, s, or later; all if there is none.
    pub from_s: Option<f64>,
    /// Rows before this time, s; all if there is none.
    pub until_s: Option<f64>,
}

impl Part {
    /// Rows from a time on, if there is one.
    pub const fn since(from_s: Option<f64>) -> Self {
        Self { from_s, until_s: None }
    }

    /// True if a row at this time is one of them.
    pub fn holds(self, time_s: f64) -> bool {
        self.from_s.is_none_or(|from_s| time_s >= from_s) && self.until_s.is_none_or(|until_s| time_s < until_s)
    }
}

/// Scores of the rows of `part`, of which `estimate` gives strain and deviation; `None` without a reference.
fn scores(recording: &TraceFile, part: Part, estimate: impl Fn(usize) -> (f64, Option<f64>)) -> Option<Scores> {
    let times = &recording.trace.time_s;
    let rows: Vec<ScoredRow> = (0..times.len())
        .filter(|&k| part.holds(times[k]))
        .map(|k| {
            let (strain, sd) = estimate(k);
            ScoredRow { time_s: times[k], truth: recording.truth(k), strain, sd }
        })
        .collect();
    ohmstrain_calib::score(&rows)
}

/// Scores of estimates; `None` without a reference.
pub fn of_estimates(recording: &TraceFile, estimates: &[Estimate], part: Part) -> Option<Scores> {
    scores(recording, part, |k| (estimates[k].strain, Some(estimates[k].strain_sd)))
}

/// Scores of a baseline, which runs over the whole recording too; it is given the readings times `moved`.
pub fn of_baseline(recording: &TraceFile, mut baseline: impl Baseline, part: Part, moved: f64) -> Option<Scores> {
    let trace = &recording.trace;
    let rows = trace.time_s.iter().zip(&trace.readings.values);
    let strains: Vec<f64> = rows.map(|(&time_s, &reading)| baseline.strain(time_s, moved * reading)).collect();
    scores(recording, part, |k| (strains[k], None))
}
