//! Scale of the readings in a correction, from the recordings that it learns from.

use ohmstrain_ekf::Reading;
use ohmstrain_ekf::correction::{FEATURES, FeatureScale, ReadingFeatures, TIME_CONSTANTS_S, settled};

use crate::digits::digits;
use crate::order::extent;
use crate::samples::Samples;

/// Number of time constants after which a low-pass has forgotten its start.
const FORGOTTEN: f64 = 2.0;

/// Returns the range of the readings, the usual size of their rates, and the usual values of their low-passes; `None` if the readings do
/// not vary.
pub(crate) fn reading_scale(
    recordings: &[Samples],
    readings: &[Vec<Option<Reading<f64>>>],
) -> Option<FeatureScale<f64>> {
    let known = readings.iter().flatten().flatten().map(|reading| reading.value);
    let (low, high) = extent(known);
    let (centre, half_range) = (digits(0.5 * (low + high)), digits(0.5 * (high - low)));
    if !(half_range > 0.0) {
        return None;
    }
    let unknown = FeatureScale { centre, half_range, rates: [1.0; 2], starts: settled() };
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    let mut lines = [Line::default(); TIME_CONSTANTS_S.len()];
    for (samples, readings) in recordings.iter().zip(readings) {
        each_row(samples.time_s, readings, unknown, |_, features, _| {
            squares.iter_mut().zip(features.rates()).for_each(|(sum, rate)| *sum += rate * rate);
            count += 1.0;
        });
        see_low_passes((samples.time_s, readings), unknown, &mut lines);
    }
    let rates = squares.map(|square: f64| digits((square / f64::max(count, 1.0)).sqrt()).max(f64::MIN_POSITIVE));
    Some(FeatureScale { centre, half_range, rates, starts: lines.map(|line| line.fitted().map(digits)) })
}

/// Adds to each line its low-pass once that has forgotten its start; a recording too short for that counts with all its rows.
fn see_low_passes(
    (time_s, readings): (&[f64], &[Option<Reading<f64>>]),
    scale: FeatureScale<f64>,
    lines: &mut [Line; TIME_CONSTANTS_S.len()],
) {
    let since = |row: usize| time_s.first().zip(time_s.get(row)).map_or(0.0, |(first, time_s)| (time_s - first).abs());
    let lasts_s = since(time_s.len().saturating_sub(1));
    each_row(time_s, readings, scale, |row, features, now| {
        let Some([reading, ..]) = now else { return };
        for ((line, tau_s), low_pass) in lines.iter_mut().zip(TIME_CONSTANTS_S).zip(features.low_passes()) {
            if since(row) > FORGOTTEN * tau_s || lasts_s <= 2.0 * FORGOTTEN * tau_s {
                line.see(reading, low_pass);
            }
        }
    });
}

/// Sums for a straight line, y = a + b x.
#[derive(Clone, Copy, Default)]
struct Line {
    count: f64,
    mean: [f64; 2],
    square: f64,
    product: f64,
}

impl Line {
    fn see(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        let (dx, dy) = (x - self.mean[0], y - self.mean[1]);
        self.mean[0] += dx / self.count;
        self.mean[1] += dy / self.count;
        self.square += dx * (x - self.mean[0]);
        self.product += dx * (y - self.mean[1]);
    }

    /// Returns a and b of the least-squares line; those of a settled low-pass if x does not vary.
    fn fitted(self) -> [f64; 2] {
        if !(self.square > 0.0) {
            return [0.0, 1.0];
        }
        let slope = self.product / self.square;
        [self.mean[1] - slope * self.mean[0], slope]
    }
}

/// Calls `visit` for every row, in order of time, with the features after it.
pub(crate) fn each_row(
    time_s: &[f64],
    readings: &[Option<Reading<f64>>],
    scale: FeatureScale<f64>,
    mut visit: impl FnMut(usize, &ReadingFeatures<f64>, Option<[f64; FEATURES]>),
) {
    let mut features = ReadingFeatures::new(scale);
    let mut before_s = time_s.first().copied().unwrap_or(0.0);
    for (row, (&time_s, reading)) in time_s.iter().zip(readings).enumerate() {
        let now = features.step((time_s - before_s).abs(), reading.map(|reading| reading.value));
        before_s = time_s;
        visit(row, &features, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a reading of a long motion: two sines, with a half range of about one.
    fn reading(time_s: f64) -> f64 {
        0.3 + 0.2 * (0.41 * time_s).sin() + 0.05 * (2.3 * time_s + 1.0).sin()
    }

    /// Returns a low-pass of these readings after its start is forgotten, by the integral over the past: amplitude 1/√(1 + (ωτ)²), phase
    /// −atan ωτ.
    fn low_passed(time_s: f64, tau_s: f64) -> f64 {
        let sine = |size: f64, omega: f64, phase: f64| {
            let lag = (omega * tau_s).atan();
            size * lag.cos() * (omega * time_s + phase - lag).sin()
        };
        0.3 + sine(0.2, 0.41, 0.0) + sine(0.05, 2.3, 1.0)
    }

    /// A filter started in mid-motion begins closer to its low-passes than one that takes the first reading for a rest, and as close as a
    /// straight line in the reading can be.
    #[test]
    fn low_passes_start_where_they_usually_are() {
        let time_s: Vec<f64> = (0..6000).map(|k| 0.05 * f64::from(k)).collect();
        let readings: Vec<f64> = time_s.iter().map(|t| reading(*t)).collect();
        let samples = Samples::new(&time_s, &readings, &readings).unwrap();
        let known: Vec<Option<Reading<f64>>> = readings.iter().map(|r| Some(Reading::from(*r))).collect();
        let scale = reading_scale(&[samples], &[known]).unwrap();
        let moments: Vec<f64> = (0..997).map(|k| 120.0 + 0.317 * f64::from(k)).collect();
        for (i, tau_s) in TIME_CONSTANTS_S.into_iter().enumerate() {
            let [a, b] = scale.starts[i];
            let scaled = |value: f64| (value - scale.centre) / scale.half_range;
            let off = |start: &dyn Fn(f64) -> f64| -> f64 {
                let square = |t: &f64| (start(scaled(reading(*t))) - scaled(low_passed(*t, tau_s))).powi(2);
                (moments.iter().map(square).sum::<f64>() / moments.len() as f64).sqrt()
            };
            let (fitted, at_rest) = (off(&|y| a + b * y), off(&|y| y));
            // The fitted line is the best: none with another offset or slope is better.
            for (da, db) in [(0.05, 0.0), (-0.05, 0.0), (0.0, 0.05), (0.0, -0.05)] {
                assert!(off(&|y| a + da + (b + db) * y) > fitted, "τ = {tau_s} s: {a}, {b}");
            }
            // A low-pass slower than the motion stays near the mean, away from the reading.
            let most = if tau_s > 4.0 { 0.5 } else { 1.0 };
            assert!(fitted < most * at_rest, "τ = {tau_s} s: {fitted} {at_rest}");
        }
    }

    /// A recording shorter than the low-passes' memory, and one that never moves, still have starts.
    #[test]
    fn what_is_too_short_or_still_has_starts_that_are_numbers() {
        let time_s: Vec<f64> = (0..40).map(|k| 0.1 * f64::from(k)).collect();
        let readings: Vec<f64> = time_s.iter().map(|t| 0.1 + 0.1 * t).collect();
        let samples = Samples::new(&time_s, &readings, &readings).unwrap();
        let known: Vec<Option<Reading<f64>>> = readings.iter().map(|r| Some(Reading::from(*r))).collect();
        let scale = reading_scale(&[samples], &[known]).unwrap();
        assert!(scale.starts.iter().flatten().all(|x| x.is_finite()));
        let still = vec![Some(Reading::from(0.2)); 40];
        assert!(reading_scale(&[samples], &[still]).is_none());
        assert_eq!(Line::default().fitted(), [0.0, 1.0]);
    }
}
