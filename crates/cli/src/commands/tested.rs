//! Scores of a calibration on the rows that `--from` and `--until` kept from it.

use std::ops::Range;

use ohmstrain::{Sensor, Tested};
use ohmstrain_calib::{Baseline, ScoredRow};

use crate::input::TraceFile;

/// Least number of rows for a score.
const FEWEST_ROWS: usize = 10;

/// A recording of which only some rows were calibrated on.
pub struct Kept {
    /// All of it.
    pub whole: TraceFile,
    /// The rows that were calibrated on.
    pub seen: Range<usize>,
}

/// Rows of filter and static cubic, one recording after the other.
#[derive(Default)]
struct Rows {
    filter: Vec<ScoredRow>,
    static_cubic: Vec<ScoredRow>,
}

/// Scores the default estimator on all other rows; `None` if there are few, if their strain is constant, or if the filter
/// refuses a row.
pub fn tested(recordings: &[Kept], sensor: &Sensor) -> Option<Tested> {
    let mut rows = Rows::default();
    for recording in recordings {
        rows.add(recording, sensor)?;
    }
    if rows.filter.len() < FEWEST_ROWS {
        return None;
    }
    let (filter, static_cubic) = (ohmstrain_calib::score(&rows.filter)?, ohmstrain_calib::score(&rows.static_cubic)?);
    filter.rmse_percent_fs.is_finite().then_some(Tested { filter, static_cubic })
}

impl Rows {
    /// Filter and cubic run over the whole recording, as they would live.
    fn add(&mut self, Kept { whole, seen }: &Kept, sensor: &Sensor) -> Option<()> {
        let mut filter = sensor.filter().build().ok()?;
        let mut cubic = ohmstrain_calib::running_cubic(sensor.params().static_cubic);
        // Times go on from recording to recording, so that none goes back.
        let after = self.filter.last().map_or(0.0, |row| row.time_s);
        for row in 0..whole.trace.len() {
            let (time_s, reading) = whole.reading(row);
            let estimate = filter.step(time_s, reading).ok()?;
            let on_cubic = cubic.strain(time_s, reading.value);
            let truth = whole.truth(row);
            if !seen.contains(&row) && truth.is_finite() {
                let time_s = after + time_s - whole.trace.time_s[0];
                self.filter.push(ScoredRow { time_s, truth, strain: estimate.strain, sd: Some(estimate.strain_sd) });
                self.static_cubic.push(ScoredRow { time_s, truth, strain: on_cubic, sd: None });
            }
        }
        Some(())
    }
}
