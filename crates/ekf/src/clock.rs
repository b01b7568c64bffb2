use ohmstrain_model::Scalar;

use crate::StepError;

/// Returns the seconds from one microsecond count to a later one, correct across the wrap of a 32-bit counter (every
/// 71.6 minutes).
///
/// Count time in integers and take the difference first: a clock in seconds in `f32` loses its milliseconds after a few
/// hours.
/// ```
/// assert_eq!(ohmstrain_ekf::seconds_between::<f32>(u32::MAX - 499, 500), 0.001);
/// ```
#[must_use]
pub fn seconds_between<T: Scalar>(earlier_us: u32, later_us: u32) -> T {
    T::of(f64::from(later_us.wrapping_sub(earlier_us))) * T::of(1e-6)
}

/// Rejects a step whose length is negative or not finite.
pub(crate) fn check_time_step<T: Scalar>(dt_s: T) -> Result<(), StepError> {
    if !dt_s.is_finite() {
        return Err(StepError::NonFiniteTimeStep);
    }
    if dt_s < T::zero() { Err(StepError::NegativeTimeStep) } else { Ok(()) }
}
