use ohmstrain_model::Scalar;

use crate::StepError;

/// Seconds from one microsecond count to a later one, right across the wrap of a 32-bit counter (every 71.6 minutes).
///
/// Count time in integers and take the difference first: in `f32` a clock in seconds has lost its milliseconds after
/// a few hours.
/// ```
/// assert_eq!(ohmstrain_ekf::seconds_between::<f32>(u32::MAX - 499, 500), 0.001);
/// ```
#[must_use]
pub fn seconds_between<T: Scalar>(earlier_us: u32, later_us: u32) -> T {
    T::of(f64::from(later_us.wrapping_sub(earlier_us))) * T::of(1e-6)
}

/// Refuses a step that is no length of time.
pub(crate) fn check_time_step<T: Scalar>(dt_s: T) -> Result<(), StepError> {
    if !dt_s.is_finite() {
        return Err(StepError::NonFiniteTimeStep);
    }
    if dt_s < T::zero() { Err(StepError::NegativeTimeStep) } else { Ok(()) }
}
