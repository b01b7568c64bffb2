//! The filter's strain at the last rows of a recording, where a smoother has few later readings.

use ohmstrain_ekf::Gaussian;

use crate::run::Rows;

/// Time constant, s, with which the smoother's weight grows with the time until the last reading. Chosen from 0.5, 1, 2, 4 and
/// 8 s: see `docs/notes/2026-11-22-smoothing.md`.
const TIME_S: f64 = 4.0;
/// Weight of the filter below which it is left out.
const LEAST_WEIGHT: f64 = 0.01;

/// The filter's strain at the last rows.
///
/// The correction of a smoother has learned from rows with later readings. Near the end there are few of them, and
/// its error there was a third larger than the filter's. So the smoothed strain is the mixture of both, and at the last
/// reading it is the filter's.
pub(crate) struct LastRows {
    /// Time of the last reading, s.
    end_s: f64,
    /// Index of the first of the rows.
    first: usize,
    filtered: Vec<Gaussian<f64>>,
}

impl LastRows {
    /// Finds the last rows of a recording.
    pub(crate) fn of(rows: Rows<'_>) -> Self {
        let is_read = |row: &usize| rows.get(*row).1.is_some_and(|reading| reading.value.is_finite());
        let Some(last) = (0..rows.len()).rev().find(is_read) else {
            return Self { end_s: f64::NEG_INFINITY, first: rows.len(), filtered: Vec::new() };
        };
        let end_s = rows.get(last).0;
        let is_near = |row: &usize| weight(end_s - rows.get(*row).0) >= LEAST_WEIGHT;
        let count = (0..=last).rev().take_while(is_near).count();
        Self { end_s, first: last + 1 - count, filtered: Vec::with_capacity(rows.len() - last - 1 + count) }
    }

    /// Takes the filter's strain at a row, in order.
    pub(crate) fn watch(&mut self, row: usize, strain: Gaussian<f64>) {
        if row >= self.first {
            self.filtered.push(strain);
        }
    }

    /// Returns the mixture of a row's smoothed strain and the filter's.
    pub(crate) fn mixed(&self, row: usize, time_s: f64, smoothed: Gaussian<f64>) -> Gaussian<f64> {
        let filtered = row.checked_sub(self.first).and_then(|place| self.filtered.get(place));
        let Some(filtered) = filtered else { return smoothed };
        let weight = weight(self.end_s - time_s);
        let apart = filtered.mean - smoothed.mean;
        let variance = weight * filtered.variance + (1.0 - weight) * smoothed.variance;
        Gaussian { mean: smoothed.mean + weight * apart, variance: variance + weight * (1.0 - weight) * apart * apart }
    }
}

/// Weight of the filter at a time, s, before the last reading.
fn weight(before_end_s: f64) -> f64 {
    (-before_end_s.max(0.0) / TIME_S).exp()
}
