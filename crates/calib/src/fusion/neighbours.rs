use ohmstrain_sensor::fusion::{UNLIKE, distance};

use super::readings::{Readings, ReadingsRow};
use super::{BLOCKS, KEPT_ROWS};
use crate::order::{mean_sd, median, sorted};

/// Number of iterations for the channels' typical differences, each with the distances of the one before.
const ROUNDS: usize = 3;
/// Standard deviation of a normal variable over the median of its absolute value.
const MEDIAN_TO_SD: f64 = 1.4826;
/// Least typical difference of ln R: even a sensor that repeats its readings to the digit may differ by this.
const LEAST_SD: f64 = 1e-4;
/// Share of the calibration's rows, per cent, within the distance [`Neighbours::novelty`].
const USUAL: usize = 99;

/// Distances of readings from the nearest readings of other blocks.
pub(super) struct Neighbours {
    /// Typical difference of ln R of each channel between rows in which the others agree.
    pub channel_sd: Vec<f64>,
    /// Distance that one row in a hundred exceeds, at least 1.
    pub novelty: f64,
    /// Distance of each row.
    distances: Vec<f64>,
}

impl Neighbours {
    pub(super) fn new(readings: &Readings) -> Self {
        let others: Vec<Vec<&ReadingsRow>> =
            (0..BLOCKS).map(|block| readings.thinned(|row| row.block != block, KEPT_ROWS).collect()).collect();
        let mut channel_sd: Vec<f64> = (0..readings.channels).map(|channel| spread(readings, channel)).collect();
        for _ in 0..ROUNDS {
            let of_channel = |channel| difference(readings, &others, &channel_sd, channel);
            channel_sd = (0..readings.channels).map(of_channel).collect();
        }
        let of_row = |row: &ReadingsRow| {
            let of_others = others[row.block].iter().map(|other| other.seen.ln_r.as_slice());
            distance(&row.seen.ln_r, of_others, &channel_sd)
        };
        let distances: Vec<f64> = readings.rows.iter().map(of_row).collect();
        let ordered = sorted(distances.iter().copied());
        let novelty = ordered[(ordered.len() - 1) * USUAL / 100].max(1.0);
        Self { channel_sd, novelty, distances }
    }

    /// Returns the novelty of a row relative to those of other blocks, 0 to 1.
    pub(super) fn excess(&self, place: usize) -> f64 {
        (self.distances[place] / self.novelty - UNLIKE).clamp(0.0, 1.0)
    }
}

/// Returns the standard deviation of a channel's ln R.
fn spread(readings: &Readings, channel: usize) -> f64 {
    mean_sd(readings.rows.iter().map(|row| row.seen.ln_r[channel])).1.max(LEAST_SD)
}

/// Returns the typical difference of a channel's ln R between a row and the row of other blocks that is nearest to it in the other
/// channels.
fn difference(readings: &Readings, others: &[Vec<&ReadingsRow>], channel_sd: &[f64], channel: usize) -> f64 {
    let differences = readings.thinned(|_| true, 4 * KEPT_ROWS).map(|row| {
        let mut without = row.seen.ln_r.clone();
        without[channel] = f64::NAN;
        let far = |other: &&&ReadingsRow| distance(&without, std::iter::once(other.seen.ln_r.as_slice()), channel_sd);
        let nearest = others[row.block].iter().min_by(|a, b| far(a).total_cmp(&far(b)));
        nearest.map_or(0.0, |nearest| (row.seen.ln_r[channel] - nearest.seen.ln_r[channel]).abs())
    });
    (MEDIAN_TO_SD * median(differences).unwrap_or(0.0)).max(LEAST_SD)
}
