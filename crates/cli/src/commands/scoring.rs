use ohmstrain_calib::{Baseline, Output, ScoredRow, Scores};

use crate::input::Recording;

/// Scores of the rows from `from` on, of which `estimate` gives strain and deviation; `None` without a reference.
fn scores(recording: &Recording, from: Option<f64>, estimate: impl Fn(usize) -> (f64, Option<f64>)) -> Option<Scores> {
    let times = &recording.trace.time_s;
    let rows: Vec<ScoredRow> = (0..times.len())
        .filter(|&k| from.is_none_or(|from| times[k] >= from))
        .map(|k| {
            let (strain, sd) = estimate(k);
            ScoredRow { time_s: times[k], truth: recording.truth(k), strain, sd }
        })
        .collect();
    Scores::new(&rows)
}

/// Scores of an estimator's outputs; `None` without a reference.
pub fn of_outputs(recording: &Recording, outputs: &[Output], from: Option<f64>) -> Option<Scores> {
    scores(recording, from, |k| {
        let strain = outputs[k].estimate.strain;
        (strain.mean, Some(strain.sd()))
    })
}

/// Scores of a baseline, which runs over the whole recording too.
pub fn of_baseline(recording: &Recording, mut baseline: impl Baseline, from: Option<f64>) -> Option<Scores> {
    let trace = &recording.trace;
    let rows = trace.time_s.iter().zip(&trace.readings.values);
    let strains: Vec<f64> = rows.map(|(&time_s, &reading)| baseline.strain(time_s, reading)).collect();
    scores(recording, from, |k| (strains[k], None))
}
