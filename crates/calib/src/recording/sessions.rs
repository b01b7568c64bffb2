//! Random effects of R₀: differences between recordings.

use crate::recording::rest::reading_before_moving;
use crate::samples::Samples;
use ohmstrain_sensor::Sessions;

/// Prior standard deviation of both logarithms between sessions: R₀ of one carbon-black sensor was 1117 to 1800 Ω on nine days. The prior
/// counts as one degree of freedom.
const EXPECTED_SD: f64 = 0.15;

/// Returns the standard deviations between recordings; `None` if fewer than two, or fewer than half of them, begin at rest.
pub(crate) fn sessions(recordings: &[Samples], rest_readings: &[f64], span: f64) -> Option<Sessions> {
    let share = |(samples, rest): (&Samples, &f64)| Some(reading_before_moving(samples, span)? / rest);
    let starts: Vec<f64> = recordings.iter().zip(rest_readings).filter_map(share).collect();
    if starts.len() < 2 || 2 * starts.len() < recordings.len() {
        return None;
    }
    Some(Sessions { rest_sd: sd_of_logarithm(rest_readings), start_sd: sd_of_logarithm(&starts) })
}

/// Returns the standard deviation of the logarithm, including the prior.
fn sd_of_logarithm(values: &[f64]) -> f64 {
    let logarithms = values.iter().map(|value| value.ln());
    let n = values.len() as f64;
    let mean = logarithms.clone().sum::<f64>() / n;
    let squares = logarithms.map(|x| (x - mean).powi(2)).sum::<f64>();
    // n - 1 degrees of freedom, and one of the prior.
    ((EXPECTED_SD.powi(2) + squares) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::sessions;
    use crate::samples::Samples;

    #[test]
    fn sessions_are_recognised_by_recordings_that_begin_at_rest() {
        let time_s = [0.0, 1.0, 2.0];
        let (at_rest, stretched) = ([0.0, 0.1, 0.3], [0.1, 0.2, 0.3]);
        let readings = [[1000.0, 1500.0, 2000.0], [1500.0, 2000.0, 3000.0]];
        let of = |first: &[f64; 3], second: &[f64; 3]| {
            let recordings = [
                Samples::new(&time_s, &readings[0], first).unwrap(),
                Samples::new(&time_s, &readings[1], second).unwrap(),
            ];
            sessions(&recordings, &[2000.0, 3000.0], 0.3)
        };
        // Both begin at half of R₀. The two R₀ differ by a factor of 1.5: squares of ln 1.5 / 2 on either side of the mean.
        let sessions = of(&at_rest, &at_rest).unwrap();
        let squares = 1.5_f64.ln().powi(2) / 2.0;
        assert!((sessions.rest_sd.powi(2) - (0.0225 + squares) / 2.0).abs() < 1e-12, "{sessions:?}");
        assert!((sessions.start_sd.powi(2) - 0.0225 / 2.0).abs() < 1e-12, "{sessions:?}");
        assert!((sessions.weight() - (0.0225 + squares) / (0.045 + squares)).abs() < 1e-12);
        assert_eq!(of(&at_rest, &stretched), None);
    }
}
