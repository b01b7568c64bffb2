use crate::CalibrationError;
use crate::samples::Samples;
use crate::samples::reading_range;

/// Centre and half the range of the readings; scaled readings are between -1 and 1 on the rows of the fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReadingScale {
    pub centre: f64,
    pub half_range: f64,
}

impl ReadingScale {
    /// Measures the scale over all rows with reading and strain. Constant readings are an error.
    pub(super) fn of(recordings: &[Samples]) -> Result<Self, CalibrationError> {
        let (low, high) = reading_range(recordings);
        if !(high > low) {
            return Err(CalibrationError::Singular);
        }
        Ok(Self { centre: 0.5 * (low + high), half_range: 0.5 * (high - low) })
    }

    pub(super) fn scaled(&self, reading: f64) -> f64 {
        (reading - self.centre) / self.half_range
    }
}
