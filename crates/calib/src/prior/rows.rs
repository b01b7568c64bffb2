use ohmstrain_ekf::correction::{FEATURES, FeatureScale, RATE_GAIN};
use serde::{Deserialize, Serialize};

use super::median;
use crate::correction_fit::{PAUSE_S, rounded};
use crate::correction_params::{CorrectionParams, FUTURE_FEATURES, TrainingRow};
use crate::estimator_params::EstimatorKind;

/// Rows of other sensors that a correction learns from beside the new sensor's own: as many as its own at most.
pub(crate) const ROWS: usize = 100;
/// A bounded rate is taken back from its bound by this much at least.
const LEAST_FROM_BOUND: f64 = 1e-6;

/// The correction of one more sensor of the make: what some moments of every sensor have taught.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionPrior {
    /// The filter that it corrects.
    pub corrects: EstimatorKind,
    /// As in [`CorrectionParams`], of the median sensor.
    pub reading_centre: f64,
    /// Likewise.
    pub reading_half_range: f64,
    /// Likewise.
    pub rate_scales: [f64; 2],
    /// Rows of all sensors, in order of time.
    pub rows: Vec<TrainingRow>,
}

impl CorrectionPrior {
    /// From the corrections of several sensors, all of one filter; `None` without any.
    pub(super) fn learn(sensors: &[&CorrectionParams]) -> Option<Self> {
        let first = sensors.first()?;
        let of_make = FeatureScale {
            centre: median(sensors.iter().map(|one| one.reading_centre)),
            half_range: median(sensors.iter().map(|one| one.reading_half_range)),
            rates: [0, 1].map(|i| median(sensors.iter().map(|one| one.rate_scales[i]))),
        };
        let mut rows: Vec<TrainingRow> = Vec::new();
        let mut start_s = 0.0;
        for (k, sensor) in sensors.iter().enumerate() {
            // As many as should have been taken by now, from another place of every sensor.
            let wanted = ROWS * (k + 1) / sensors.len() - rows.len();
            let first_s = sensor.rows.first().map_or(0.0, |row| row.time_s);
            for i in 0..wanted.min(sensor.rows.len()) {
                let place = (i * sensors.len() + k) * sensor.rows.len() / (wanted * sensors.len());
                let row = moved(&sensor.rows[place], sensor.feature_scale(), of_make);
                rows.push(rounded(TrainingRow { time_s: start_s + row.time_s - first_s, ..row }));
            }
            start_s = rows.last().map_or(0.0, |row| row.time_s + PAUSE_S);
        }
        Some(Self {
            corrects: first.corrects,
            reading_centre: of_make.centre,
            reading_half_range: of_make.half_range,
            rate_scales: of_make.rates,
            rows,
        })
    }

    pub(crate) const fn feature_scale(&self) -> FeatureScale<f64> {
        FeatureScale { centre: self.reading_centre, half_range: self.reading_half_range, rates: self.rate_scales }
    }
}

/// A row as it would have been seen on another scale.
fn moved(row: &TrainingRow, from: FeatureScale<f64>, to: FeatureScale<f64>) -> TrainingRow {
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
    use ohmstrain_ekf::correction::ReadingFeatures;

    use super::*;

    /// The features themselves, seen on both scales.
    #[test]
    fn rows_are_what_the_other_scale_would_have_seen() {
        let from = FeatureScale { centre: 0.3, half_range: 0.25, rates: [0.08, 0.05] };
        let to = FeatureScale { centre: 0.2, half_range: 0.4, rates: [0.11, 0.02] };
        let (mut on_from, mut on_to) = (ReadingFeatures::new(from), ReadingFeatures::new(to));
        for k in 0..200 {
            let reading = Some(0.3 + 0.2 * (0.1 * f64::from(k)).sin());
            let (Some(past), Some(expected)) = (on_from.step(0.1, reading), on_to.step(0.1, reading)) else {
                unreachable!("readings are known")
            };
            let future: [f64; FUTURE_FEATURES] = std::array::from_fn(|i| past[i + 1]);
            let zeros = [0.0; ohmstrain_ekf::correction::OUTPUTS];
            let row = TrainingRow { time_s: 0.0, strain: 0.0, past, future, filtered: zeros, smoothed: zeros };
            let found = moved(&row, from, to);
            for (i, expected) in expected.into_iter().enumerate() {
                assert!((found.past[i] - expected).abs() < 1e-9, "row {k}, feature {i}: {} {expected}", found.past[i]);
                assert!(i == 0 || found.future[i - 1] == found.past[i]);
            }
        }
    }
}
