use ohmstrain_calib::{Output, ScoredRow, Scores, StaticCubic};

use crate::input::Recording;

/// The rows of a recording that are scored: those from `from` on.
fn scored_rows(recording: &Recording, from: Option<f64>) -> impl Iterator<Item = usize> + '_ {
    let times = &recording.trace.time_s;
    (0..times.len()).filter(move |&k| from.is_none_or(|from| times[k] >= from))
}

fn truth(recording: &Recording, row: usize) -> f64 {
    recording.trace.reference.as_ref().and_then(|reference| reference.values.get(row).copied()).unwrap_or(f64::NAN)
}

/// Scores of an estimator's outputs; `None` without a reference.
pub fn of_outputs(recording: &Recording, outputs: &[Output], from: Option<f64>) -> Option<Scores> {
    let rows: Vec<ScoredRow> = scored_rows(recording, from)
        .map(|k| {
            let strain = outputs[k].estimate.strain;
            ScoredRow {
                time_s: recording.trace.time_s[k],
                truth: truth(recording, k),
                strain: strain.mean,
                sd: Some(strain.sd()),
            }
        })
        .collect();
    Scores::new(&rows)
}

/// Scores of the static inverse, which keeps its last value where a reading is missing.
pub fn of_static_cubic(recording: &Recording, cubic: &StaticCubic, from: Option<f64>) -> Option<Scores> {
    let mut last = 0.5 * (cubic.range.lower + cubic.range.upper);
    let strains: Vec<f64> = recording
        .trace
        .readings
        .values
        .iter()
        .map(|&reading| {
            if reading.is_finite() {
                last = cubic.strain(reading);
            }
            last
        })
        .collect();
    let rows: Vec<ScoredRow> = scored_rows(recording, from)
        .map(|k| ScoredRow {
            time_s: recording.trace.time_s[k],
            truth: truth(recording, k),
            strain: strains[k],
            sd: None,
        })
        .collect();
    Scores::new(&rows)
}
