use ohmstrain_ekf::StepError;
use serde::{Deserialize, Serialize};

/// Times of rows.
#[derive(Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Clock {
    last_s: Option<f64>,
}

impl Clock {
    /// Returns the clock at the next row, and the time since the previous row, s; zero at the first row. Differences of successive
    /// times are exact, and so are their sums: a pause has the same length in one row or in many.
    ///
    /// # Errors
    /// If time is not finite or goes backwards.
    pub(crate) fn at(self, time_s: f64) -> Result<(Self, f64), StepError> {
        let dt_s = time_s - self.last_s.unwrap_or(time_s);
        if !dt_s.is_finite() {
            return Err(StepError::NonFiniteTimeStep);
        }
        if dt_s < 0.0 {
            return Err(StepError::NegativeTimeStep);
        }
        Ok((Self { last_s: Some(time_s) }, dt_s))
    }
}

/// Returns a length, s, whose multiples can be subtracted from such sums without rounding; it is shorter by a
/// nanosecond at most.
pub(crate) fn floored(length_s: f64) -> f64 {
    const PARTS: f64 = 1_073_741_824.0;
    let floored = (length_s * PARTS).floor() / PARTS;
    if floored > 0.0 { floored } else { length_s }
}
