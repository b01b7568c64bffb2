//! Progress of a move: the common velocity profile, and the pace of an irregular move.

use crate::order::extent;
use crate::samples::Samples;

/// Number of inner knots of an irregular move, and prior standard deviation of each, as a fraction of the move's distance.
pub(crate) const INNER_KNOTS: usize = 4;
const KNOT_SD: f64 = 0.15;
/// Difference between the readings at the ends of a move, as a fraction of the readings' range, below which they do not determine its pace.
const LEAST_CHANGE: f64 = 0.08;
/// Weight of the readings' activity, as opposed to time, in the placement of knots.
const BY_ACTIVITY: f64 = 0.8;

/// Returns the progress of a move, 0 to 1, at the fraction `u` of its time: from constant speed (`shape` 0) to minimum jerk (1).
///
/// Source of minimum jerk: Flash and Hogan, *J. Neurosci.* 5 (1985) 1688.
pub(crate) fn progress(u: f64, shape: f64) -> f64 {
    let smooth = u.powi(3) * (10.0 + u * (6.0 * u - 15.0));
    u + shape * (smooth - u)
}

/// Pace of an irregular move: the mean of the common progress and that of the readings, plus a deviation that is linear between knots.
/// Knots are dense where the readings move.
#[derive(Clone, Debug)]
pub(crate) struct Pace {
    /// Fractions of the move's time, and the progress at each.
    rows: Vec<(f64, f64)>,
    /// Fractions of time of all knots, including the two ends.
    knots: [f64; INNER_KNOTS + 2],
}

impl Pace {
    /// Estimates the pace between two times from the readings.
    pub(crate) fn new(samples: &Samples, (from_s, until_s): (f64, f64), shape: f64) -> Self {
        let rows = (0..samples.len())
            .filter(|&k| samples.reading[k].is_finite() && (from_s..=until_s).contains(&samples.time_s[k]));
        let (u, readings): (Vec<f64>, Vec<f64>) =
            rows.map(|k| ((samples.time_s[k] - from_s) / (until_s - from_s), samples.reading[k])).unzip();
        let (low, high) = extent(samples.reading.iter().copied().filter(|r| r.is_finite()));
        let read = reading_progress(&readings, LEAST_CHANGE * (high - low));
        let common = u.iter().map(|u| progress(*u, shape));
        let mut rows: Vec<(f64, f64)> = match read {
            Some(read) => u.iter().copied().zip(common.zip(read).map(|(a, b)| 0.5 * (a + b))).collect(),
            None => u.iter().copied().zip(common).collect(),
        };
        rows.push((1.0, 1.0));
        Self { knots: knots(&rows), rows }
    }

    /// Returns the progress at a fraction of the move's time, without deviation.
    pub(crate) fn progress(&self, u: f64) -> f64 {
        interpolate(&self.rows, u)
    }

    /// Returns the deviation of the progress, given the inner knots in units of their standard deviations.
    pub(crate) fn deviation(&self, u: f64, inner: &[f64; INNER_KNOTS]) -> f64 {
        let value = |k: usize| if (1..=INNER_KNOTS).contains(&k) { KNOT_SD * inner[k - 1] } else { 0.0 };
        let points: [(f64, f64); INNER_KNOTS + 2] = std::array::from_fn(|k| (self.knots[k], value(k)));
        interpolate(&points, u)
    }
}

/// Returns the progress of readings from the first to the last, 0 to 1, never decreasing; `None` if these two differ by less than `least`.
fn reading_progress(readings: &[f64], least: f64) -> Option<Vec<f64>> {
    let few = (readings.len() / 50).max(1);
    let mean = |rows: &[f64]| rows.iter().sum::<f64>() / rows.len().max(1) as f64;
    let (first, last) = (mean(readings.get(..few)?), mean(readings.get(readings.len().checked_sub(few)?..)?));
    let read: Vec<f64> = readings.iter().map(|r| (r - first) / (last - first)).collect();
    ((last - first).abs() >= least).then(|| monotone(&read).into_iter().map(|p| p.clamp(0.0, 1.0)).collect())
}

/// Returns the mean of the running maximum from the front and the running minimum from the back, which never decreases.
fn monotone(values: &[f64]) -> Vec<f64> {
    let running = |most: &mut f64, x: f64| {
        *most = most.max(x);
        Some(*most)
    };
    let forward = values.iter().copied().scan(f64::NEG_INFINITY, running);
    let mut backward: Vec<f64> = values.iter().rev().map(|x| -x).scan(f64::NEG_INFINITY, running).map(|x| -x).collect();
    backward.reverse();
    forward.zip(backward).map(|(a, b)| 0.5 * (a + b)).collect()
}

/// Returns fractions of time that divide the move into equal parts.
fn knots(rows: &[(f64, f64)]) -> [f64; INNER_KNOTS + 2] {
    let mut travelled = 0.0;
    let mut before = rows.first().map_or(0.0, |row| row.1);
    let mut activity: Vec<(f64, f64)> = Vec::with_capacity(rows.len());
    for &(u, progress) in rows {
        travelled += (progress - before).abs();
        before = progress;
        activity.push((travelled, u));
    }
    let whole = if travelled > 0.0 { travelled } else { 1.0 };
    let mixed = activity.iter().map(|(travelled, u)| (BY_ACTIVITY * travelled / whole + (1.0 - BY_ACTIVITY) * u, *u));
    let mixed: Vec<(f64, f64)> = mixed.collect();
    std::array::from_fn(|k| interpolate(&mixed, k as f64 / (INNER_KNOTS + 1) as f64))
}

/// Interpolates linearly between points in ascending order, from (0, 0) if they begin later; constant beyond the last one.
fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let next = points.partition_point(|point| point.0 < x);
    let before = next.checked_sub(1).map_or((0.0, 0.0), |k| points[k]);
    let Some(after) = points.get(next) else { return before.1 };
    let share = if after.0 > before.0 { (x - before.0) / (after.0 - before.0) } else { 1.0 };
    before.1 + share * (after.1 - before.1)
}
