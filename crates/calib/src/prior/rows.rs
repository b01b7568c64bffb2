use ohmstrain_ekf::correction::{FEATURES, FeatureScale, RATE_GAIN};
use serde::{Deserialize, Serialize};

use super::median;
use crate::calibrate::correction_fit::{PAUSE_S, rounded};
use ohmstrain_sensor::{CorrectionParams, EstimatorKind, FUTURE_FEATURES, TrainingRow};

/// Number of rows of other sensors that a correction learns from; of the new sensor's own it uses at most as many.
pub(crate) const ROWS: usize = 100;
/// Least distance of a bounded rate from its bound before the bound is inverted.
const LEAST_FROM_BOUND: f64 = 1e-6;

/// The correction of one more sensor of the make, learned from some rows of every sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionPrior {
    /// The filter that it corrects.
    pub corrects: EstimatorKind,
    /// Scale of the readings of the median sensor.
    pub readings: FeatureScale<f64>,
    /// Rows of all sensors, in order of time.
    pub rows: Vec<TrainingRow>,
}

impl CorrectionPrior {
    /// Collects rows from the corrections of several sensors, all of one filter; `None` without any.
    pub(super) fn learn(sensors: &[&CorrectionParams]) -> Option<Self> {
        let first = sensors.first()?;
        let scales: Vec<FeatureScale<f64>> = sensors.iter().map(|one| one.readings).collect();
        let of_make = median_scale(&scales);
        let mut rows: Vec<TrainingRow> = Vec::new();
        let mut start_s = 0.0;
        for (k, sensor) in sensors.iter().enumerate() {
            // Tops up to the number of rows due by now, from a different place of every sensor.
            let wanted = ROWS * (k + 1) / sensors.len() - rows.len();
            let first_s = sensor.rows.first().map_or(0.0, |row| row.time_s);
            for i in 0..wanted.min(sensor.rows.len()) {
                let place = (i * sensors.len() + k) * sensor.rows.len() / (wanted * sensors.len());
                let row = moved(&sensor.rows[place], &sensor.readings, &of_make);
                rows.push(rounded(&TrainingRow { time_s: start_s + row.time_s - first_s, ..row }));
            }
            start_s = rows.last().map_or(0.0, |row| row.time_s + PAUSE_S);
        }
        Some(Self { corrects: first.corrects, readings: of_make, rows })
    }
}

/// Returns the median of each number; starts are first converted to the median scale.
fn median_scale(scales: &[FeatureScale<f64>]) -> FeatureScale<f64> {
    let of = |number: &dyn Fn(&FeatureScale<f64>) -> f64| median(scales.iter().map(number));
    let (centre, half_range) = (of(&|scale| scale.centre), of(&|scale| scale.half_range));
    let start = |i: usize, part: usize| of(&|scale| start_on(scale, scale.starts[i], (centre, half_range))[part]);
    FeatureScale {
        centre,
        half_range,
        rates: [0, 1].map(|i| of(&|scale| scale.rates[i])),
        starts: std::array::from_fn(|i| [start(i, 0), start(i, 1)]),
    }
}

/// Converts a low-pass's starting values to a scale of another centre and half range.
fn start_on(scale: &FeatureScale<f64>, [a, b]: [f64; 2], (centre, half_range): (f64, f64)) -> [f64; 2] {
    [(a * scale.half_range + (b - 1.0) * (centre - scale.centre)) / half_range, b]
}

/// Converts a row to another scale.
fn moved(row: &TrainingRow, from: &FeatureScale<f64>, to: &FeatureScale<f64>) -> TrainingRow {
    let size = from.half_range / to.half_range;
    let rate = |i: usize, bounded: f64| {
        let most = 1.0 - LEAST_FROM_BOUND;
        let rate = bounded.clamp(-most, most).atanh() * from.rates[i] / RATE_GAIN;
        (RATE_GAIN * rate * size / to.rates[i]).tanh()
    };
    let mut past = row.past.map(|distance| distance * size);
    past[0] += (from.centre - to.centre) / to.half_range;
    let mut future = row.future.map(|distance| distance * size);
    for i in 0..2 {
        past[FEATURES - 2 + i] = rate(i, row.past[FEATURES - 2 + i]);
        future[FUTURE_FEATURES - 2 + i] = rate(i, row.future[FUTURE_FEATURES - 2 + i]);
    }
    TrainingRow { past, future, ..*row }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::correction::{ReadingFeatures, settled};

    use super::*;

    /// Compares with the features themselves, computed on both scales.
    #[test]
    fn rows_are_what_the_other_scale_would_have_seen() {
        let scale = |centre, half_range, rates| FeatureScale { centre, half_range, rates, starts: settled() };
        let (from, to) = (scale(0.3, 0.25, [0.08, 0.05]), scale(0.2, 0.4, [0.11, 0.02]));
        let (mut on_from, mut on_to) = (ReadingFeatures::new(from), ReadingFeatures::new(to));
        for k in 0..200 {
            let reading = Some(0.3 + 0.2 * (0.1 * f64::from(k)).sin());
            let (Some(past), Some(expected)) = (on_from.step(0.1, reading), on_to.step(0.1, reading)) else {
                unreachable!("readings are known")
            };
            let future: [f64; FUTURE_FEATURES] = std::array::from_fn(|i| past[i + 1]);
            let zeros = [0.0; ohmstrain_ekf::correction::OUTPUTS];
            let row = TrainingRow { time_s: 0.0, strain: 0.0, past, future, filtered: zeros, smoothed: zeros };
            let found = moved(&row, &from, &to);
            for (i, expected) in expected.into_iter().enumerate() {
                assert!((found.past[i] - expected).abs() < 1e-9, "row {k}, feature {i}: {} {expected}", found.past[i]);
                assert!(i == 0 || found.future[i - 1] == found.past[i]);
            }
        }
    }

    /// Tests that a low-pass at one reading is the same on any scale.
    #[test]
    fn starts_are_moved_with_the_scale() {
        let (centre, half_range, start) = (0.3, 0.25, [0.3, 0.4]);
        let scale = FeatureScale { centre, half_range, rates: [0.1; 2], starts: settled() };
        let low_pass = |centre: f64, half_range: f64, [a, b]: [f64; 2], reading: f64| {
            centre + half_range * (a + b * (reading - centre) / half_range)
        };
        for reading in [0.1, 0.35, 0.8] {
            let moved = low_pass(0.2, 0.4, start_on(&scale, start, (0.2, 0.4)), reading);
            assert!((moved - low_pass(centre, half_range, start, reading)).abs() < 1e-15, "{reading}");
        }
    }
}
