//! Scores of estimates and baselines on a recording.

use ohmstrain::trace::TraceFile;
use ohmstrain::{Estimate, Scores};
use ohmstrain_calib::{Baseline, ScoredRow};

use crate::Scored;

/// Scores the rows of `part` with strain and deviation from `estimate`; `None` without a reference.
pub fn scores(recording: &TraceFile, part: Scored, estimate: impl Fn(usize) -> (f64, Option<f64>)) -> Option<Scores> {
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

/// Scores estimates; `None` without a reference.
pub fn of_estimates(recording: &TraceFile, estimates: &[Estimate], part: Scored) -> Option<Scores> {
    scores(recording, part, |k| (estimates[k].strain, Some(estimates[k].strain_sd)))
}

/// Scores a baseline, which also runs over the whole recording, on the readings times `moved`; `None` without a reference.
pub fn of_baseline(recording: &TraceFile, mut baseline: impl Baseline, part: Scored, moved: f64) -> Option<Scores> {
    let trace = &recording.trace;
    let rows = trace.time_s.iter().zip(&trace.readings.values);
    let strains: Vec<f64> = rows.map(|(&time_s, &reading)| baseline.strain(time_s, moved * reading)).collect();
    scores(recording, part, |k| (strains[k], None))
}
