use std::ops::Range;

use crate::Samples;
use crate::samples::filled_strain;

use super::datum::{Datum, Moment, Movement};

/// Returns the readings of the given rows over the time since the first one, for laws of time alone.
#[must_use]
pub fn whole_data(samples: &Samples, rows: Range<usize>) -> Vec<Datum> {
    let Some(&start_s) = samples.time_s.get(rows.start) else { return Vec::new() };
    let at = |k: usize| Moment { elapsed_s: samples.time_s[k] - start_s, ..Moment::default() };
    readings(samples, rows, at)
}

/// Returns the readings of a movement. Missing reference values are interpolated linearly; the rate is the
/// least-squares slope of travel over time.
#[must_use]
pub fn moving_data(samples: &Samples, rows: Range<usize>) -> Vec<Datum> {
    if rows.is_empty() {
        return Vec::new();
    }
    let strain = filled_strain(samples);
    let rate = slope(&samples.time_s[rows.clone()], &strain[rows.clone()]);
    let (start_s, start_strain) = (samples.time_s[rows.start], strain[rows.start]);
    let at = |k: usize| Moment {
        elapsed_s: samples.time_s[k] - start_s,
        travel: strain[k] - start_strain,
        rate,
        strain: strain[k],
        before: None,
    };
    readings(samples, rows, at)
}

/// Returns the readings of a hold, with the movement that led to it for the laws that need it.
#[must_use]
pub fn hold_data(samples: &Samples, rows: Range<usize>, movement: Option<Range<usize>>) -> Vec<Datum> {
    if rows.is_empty() {
        return Vec::new();
    }
    let strain = filled_strain(samples);
    let start_s = samples.time_s[rows.start];
    let movement = movement.filter(|rows| !rows.is_empty());
    let before = movement.clone().map(|moved| Movement {
        duration_s: start_s - samples.time_s[moved.start],
        travel: strain[rows.start] - strain[moved.start],
    });
    let rate = movement.map_or(0.0, |moved| slope(&samples.time_s[moved.clone()], &strain[moved]));
    let at = |k: usize| Moment { elapsed_s: samples.time_s[k] - start_s, travel: 0.0, rate, strain: strain[k], before };
    readings(samples, rows, at)
}

fn readings(samples: &Samples, rows: Range<usize>, at: impl Fn(usize) -> Moment) -> Vec<Datum> {
    let known = rows.filter(|&k| samples.reading[k].is_finite());
    known.map(|k| Datum { at: at(k), reading: samples.reading[k] }).collect()
}

/// Returns the slope of the straight line through values over time; zero for a single row.
fn slope(time_s: &[f64], values: &[f64]) -> f64 {
    let n = time_s.len() as f64;
    let (mean_s, mean) = (time_s.iter().sum::<f64>() / n, values.iter().sum::<f64>() / n);
    let product: f64 = time_s.iter().zip(values).map(|(t, x)| (t - mean_s) * (x - mean)).sum();
    let square: f64 = time_s.iter().map(|t| (t - mean_s) * (t - mean_s)).sum();
    if square > 0.0 { product / square } else { 0.0 }
}
