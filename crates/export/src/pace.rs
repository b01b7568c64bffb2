//! Usual time between two readings, from the calibration.

use ohmstrain_sensor::{RecordingInfo, SensorParams};

/// Returns the usual time between two rows of the recordings that a sensor was calibrated on, s, rounded to six digits: the
/// median of the recordings' means. `None` if the sensor names no recording.
pub fn usual_step_s(params: &SensorParams) -> Option<f64> {
    median(params.recordings.iter().filter_map(mean_step_s).collect())
}

fn mean_step_s(recording: &RecordingInfo) -> Option<f64> {
    let steps = recording.rows.checked_sub(1).filter(|steps| *steps > 0)?;
    Some((recording.last_s - recording.first_s) / steps as f64).filter(|step_s| *step_s > 0.0)
}

fn median(mut steps_s: Vec<f64>) -> Option<f64> {
    steps_s.sort_by(f64::total_cmp);
    // Times are differences, so that further digits are rounding errors.
    format!("{:.5e}", steps_s.get(steps_s.len() / 2)?).parse().ok()
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn it_is_the_median_to_six_digits() {
        assert_eq!(median(vec![0.1, 0.2 - 1e-12, 0.5]), Some(0.2));
        assert_eq!(median(vec![]), None);
    }
}
