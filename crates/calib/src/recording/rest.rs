use crate::order::median;
use crate::samples::Samples;

/// Tolerance around zero strain, as a fraction of the reference's span.
const ZERO: f64 = 0.01;

/// Returns the measured resistance at rest over the law's R₀: the median over the recordings that begin at rest, at zero strain; `None` if
/// none does.
///
/// The law's R₀ is a fitted constant, biased by the ridge. While the sensor moves, gauge and branches compensate for the difference, but R₀
/// cannot be measured then.
pub(crate) fn rest_share(recordings: &[Samples], rest_readings: &[f64], span: f64) -> Option<f64> {
    let measured = recordings.iter().zip(rest_readings);
    let shares = measured.filter_map(|(samples, rest)| Some(reading_before_moving(samples, span)? / rest));
    median(shares)
}

/// Returns the median reading of the first rows at zero strain, before the first other one.
pub(crate) fn reading_before_moving(samples: &Samples, span: f64) -> Option<f64> {
    let at_zero = samples.complete_rows().take_while(|&k| samples.strain[k].abs() <= ZERO * span);
    median(at_zero.map(|k| samples.reading[k]))
}

#[cfg(test)]
mod tests {
    use super::rest_share;
    use crate::samples::Samples;

    #[test]
    fn the_rested_sensor_is_what_is_read_before_it_moves() {
        let time_s = [0.0, 1.0, 2.0, 3.0, 4.0];
        let reading = [1000.0, f64::NAN, 1004.0, 1500.0, 1002.0];
        let share = |strain: [f64; 5]| {
            let samples = Samples::new(&time_s, &reading, &strain).unwrap();
            rest_share(&[samples], &[2000.0], 0.3)
        };
        // The last row is back at zero strain, but not rested.
        assert_eq!(share([0.0, 0.0, 0.002, 0.3, 0.0]), Some(1004.0 / 2000.0));
        assert_eq!(share([0.1, 0.0, 0.0, 0.3, 0.0]), None);
    }
}
