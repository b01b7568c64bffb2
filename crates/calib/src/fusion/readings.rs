use ohmstrain_sensor::fusion::{FusionRow, LowPasses};

use super::{BLOCKS, FusionChannel};
use crate::CalibrationError;

/// Rows with readings of all channels and a known strain.
pub(super) struct Readings {
    pub rows: Vec<ReadingsRow>,
    pub channels: usize,
}

/// One of these rows.
pub(super) struct ReadingsRow {
    /// Its index among them.
    pub place: usize,
    pub recording: usize,
    /// The row of that recording.
    pub row: usize,
    pub time_s: f64,
    /// The block with which it is left out.
    pub block: usize,
    pub seen: FusionRow,
}

impl Readings {
    pub(super) fn new(channels: &[FusionChannel], low_pass_s: &[f64]) -> Result<Self, CalibrationError> {
        let [first, others @ ..] = channels else { return Err(CalibrationError::NoCommonRows) };
        let is_alike = |other: &FusionChannel| {
            let times = |channel: &FusionChannel| -> Vec<Vec<f64>> {
                channel.recordings.iter().map(|samples| samples.time_s.to_vec()).collect()
            };
            times(other) == times(first)
        };
        if others.is_empty() || !others.iter().all(is_alike) {
            return Err(CalibrationError::NoCommonRows);
        }
        let mut rows = Vec::new();
        for (recording, samples) in first.recordings.iter().enumerate() {
            let mut low_passes = LowPasses::new(low_pass_s, channels.len());
            for (row, time_s) in samples.time_s.iter().enumerate() {
                let ln_r =
                    |channel: &FusionChannel| (channel.recordings[recording].reading[row] / channel.rest_reading).ln();
                let ln_r: Vec<f64> = channels.iter().map(ln_r).collect();
                low_passes.step(*time_s, &ln_r);
                let strain = samples.strain[row];
                if strain.is_finite() && ln_r.iter().all(|value| value.is_finite()) {
                    let block = row * BLOCKS / samples.len();
                    let seen = FusionRow { strain, ln_r, low_passed: low_passes.states().to_vec() };
                    rows.push(ReadingsRow { place: rows.len(), recording, row, time_s: *time_s, block, seen });
                }
            }
        }
        if (0..BLOCKS).all(|block| rows.iter().any(|row| row.block == block)) {
            Ok(Self { rows, channels: channels.len() })
        } else {
            Err(CalibrationError::NoCommonRows)
        }
    }

    /// Returns at most `most` of these rows, evenly spread.
    pub(super) fn thinned(
        &self,
        wanted: impl Fn(&ReadingsRow) -> bool,
        most: usize,
    ) -> impl Iterator<Item = &ReadingsRow> {
        let rows: Vec<&ReadingsRow> = self.rows.iter().filter(|row| wanted(row)).collect();
        let stride = rows.len().div_ceil(most).max(1);
        rows.into_iter().step_by(stride)
    }
}
