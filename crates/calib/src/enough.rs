//! Minimum requirements for recordings of a calibration.

use crate::order::range;
use crate::samples::FEWEST_ROWS;
use crate::{CalibrationError, Samples};

/// Checks the requirements of a calibration and returns the strain's range over all recordings.
pub(crate) fn check(recordings: &[Samples]) -> Result<(f64, f64), CalibrationError> {
    for (recording, samples) in recordings.iter().enumerate() {
        let complete = samples.complete_rows().count();
        if complete < FEWEST_ROWS {
            return Err(CalibrationError::TooFewRows { recording, complete, needed: FEWEST_ROWS });
        }
    }
    match range(recordings.iter().filter_map(Samples::strain_range).flat_map(<[f64; 2]>::from)) {
        None => Err(CalibrationError::NoRecording),
        Some((low, high)) if !(high > low) => Err(CalibrationError::ConstantStrain),
        Some(_) if recordings.iter().all(is_frozen) => Err(CalibrationError::ConstantReading),
        Some(ends) => Ok(ends),
    }
}

/// True if the reading never changes.
fn is_frozen(samples: &Samples) -> bool {
    let mut readings = samples.complete_rows().map(|k| samples.reading[k]);
    let first = readings.next();
    readings.all(|reading| Some(reading) == first)
}
