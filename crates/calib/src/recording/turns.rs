use ohmstrain_ekf::live::{TurnSeen, TurnWatch};

use crate::samples::Samples;

/// Returns the longest time, s, between two turns of the readings, or between a turn and an end of a recording. A reading turns where it
/// reverses by `turn`, relative to R₀.
pub(crate) fn longest_unturned_s(recordings: &[Samples], rest_readings: &[f64], turn: f64) -> f64 {
    let longest_of = |(samples, rest_reading): (&Samples, &f64)| {
        let mut watch = TurnWatch::new(TurnSeen { turn, longest_s: f64::INFINITY });
        let known = samples.time_s.iter().zip(samples.reading).filter(|(_, reading)| reading.is_finite());
        let mut last_s = None;
        let unturned_s = known.map(|(time_s, reading)| {
            watch.see(time_s - last_s.replace(*time_s).unwrap_or(*time_s), reading / rest_reading - 1.0);
            watch.since_turn_s()
        });
        unturned_s.fold(0.0, f64::max)
    };
    recordings.iter().zip(rest_readings).map(longest_of).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::longest_unturned_s;
    use crate::samples::Samples;

    /// Up for 4 s, down for 3 s, and still for 9 s; fluctuations of less than a turn count as still.
    #[test]
    fn a_rest_lasts_from_the_last_turn_to_the_end() {
        let level = |t: usize| match t {
            0..=4 => 100.0 + 10.0 * t as f64,
            5..=7 => 140.0 - 10.0 * (t as f64 - 4.0),
            _ => 110.0 - 0.5 * (t % 2) as f64,
        };
        let time_s: Vec<f64> = (0..=16).map(|t| t as f64).collect();
        let longest_s = |until: usize| {
            let reading: Vec<f64> = (0..=until).map(level).collect();
            let samples = Samples::new(&time_s[..=until], &reading, &time_s[..=until]).unwrap();
            longest_unturned_s(&[samples], &[100.0], 0.02)
        };
        assert_eq!([3, 7, 16].map(longest_s), [3.0, 4.0, 12.0]);
    }
}
