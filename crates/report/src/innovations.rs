//! Test of the filter's innovations: their size against the stated one, and their independence.

use ohmstrain::Estimate;

/// Standardised innovations of a recording, without their signs: `|z| = √NIS`.
pub struct Innovations {
    /// |z|, row by row; NaN where the reading was missing.
    pub size: Vec<f64>,
    /// Number of known innovations.
    pub count: usize,
    /// Mean of z²; 1 if the filter's covariance is right.
    pub mean_square: f64,
    /// Share of rows with |z| beyond [`BOUND`].
    pub share_beyond: f64,
}

/// Bound within ± of which 95 % of a standard normal lie; its square is the 95 % point of χ² with one degree of freedom.
pub const BOUND: f64 = 1.959_964;
/// Number of lags of the autocorrelation.
const LAGS: usize = 40;
/// Width and number of the histogram's bins.
const BIN: f64 = 0.2;
const BINS: usize = 20;
/// Number of blocks of the moving mean over a recording.
const SHOWN_BLOCKS: usize = 60;

impl Innovations {
    /// Collects the innovations of a filter's estimates.
    pub fn new(rows: &[Estimate]) -> Self {
        let size: Vec<f64> =
            rows.iter().map(|row| row.nis.filter(|nis| *nis >= 0.0).map_or(f64::NAN, f64::sqrt)).collect();
        let known = || size.iter().filter(|z| z.is_finite());
        let count = known().count();
        let share = |sum: f64| if count > 0 { sum / count as f64 } else { f64::NAN };
        let mean_square = share(known().map(|z| z * z).sum());
        let share_beyond = share(known().filter(|z| **z > BOUND).count() as f64);
        Self { size, count, mean_square, share_beyond }
    }

    /// Returns the range of the mean square with 95 % probability: χ² with `count` degrees of freedom over `count`, as a
    /// Gaussian.
    pub fn mean_square_range(&self) -> (f64, f64) {
        let half = BOUND * (2.0 / self.count.max(1) as f64).sqrt();
        ((1.0 - half).max(0.0), 1.0 + half)
    }

    /// Returns the 99.8 % quantile of |z|.
    pub fn usual_largest(&self) -> f64 {
        let mut known: Vec<f64> = self.size.iter().copied().filter(|z| z.is_finite()).collect();
        let place = (0.998 * known.len() as f64) as usize;
        if place >= known.len() {
            return 0.0;
        }
        *known.select_nth_unstable_by(place, f64::total_cmp).1
    }

    /// Returns the root mean square of |z| over successive blocks: `(first row, last row, value)`.
    pub fn moving_rms(&self) -> Vec<(usize, usize, f64)> {
        let length = self.size.len().div_ceil(SHOWN_BLOCKS).max(1);
        let rms = |block: &[f64]| {
            let known: Vec<f64> = block.iter().copied().filter(|z| z.is_finite()).collect();
            (known.iter().map(|z| z * z).sum::<f64>() / known.len() as f64).sqrt()
        };
        let blocks = self.size.chunks(length).enumerate();
        blocks.map(|(i, block)| (i * length, i * length + block.len() - 1, rms(block))).collect()
    }

    /// Returns the density of |z| in bins `(left, right, density)`; the last bin contains all larger values.
    pub fn histogram(&self) -> Vec<(f64, f64, f64)> {
        let mut counts = [0_usize; BINS];
        for z in self.size.iter().filter(|z| z.is_finite()) {
            let bin = ((z / BIN) as usize).min(BINS - 1);
            if let Some(count) = counts.get_mut(bin) {
                *count += 1;
            }
        }
        let density = |count: usize| count as f64 / (self.count.max(1) as f64 * BIN);
        let edge = |i: usize| i as f64 * BIN;
        counts.iter().enumerate().map(|(i, count)| (edge(i), edge(i + 1), density(*count))).collect()
    }

    /// Returns the expected density of the histogram: that of the root of a χ² variable with one degree of freedom.
    pub fn expected_density(z: f64) -> f64 {
        (2.0 / std::f64::consts::PI).sqrt() * (-0.5 * z * z).exp()
    }

    /// Returns the right end of the histogram.
    pub const fn histogram_end() -> f64 {
        BIN * BINS as f64
    }

    /// Returns the autocorrelation of |z| at lags 1, 2, … in rows, without missing ones.
    pub fn autocorrelation(&self) -> Vec<(usize, f64)> {
        let mean = self.size.iter().filter(|z| z.is_finite()).sum::<f64>() / self.count.max(1) as f64;
        let off: Vec<f64> = self.size.iter().map(|z| if z.is_finite() { z - mean } else { 0.0 }).collect();
        let power: f64 = off.iter().map(|x| x * x).sum();
        if !(power > 0.0) {
            return vec![];
        }
        let at = |lag: usize| off.iter().zip(off.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>() / power;
        (1..=LAGS.min(self.count / 4)).map(|lag| (lag, at(lag))).collect()
    }

    /// Returns the bound within ± of which 95 % of the autocorrelations of independent innovations lie.
    pub fn autocorrelation_bound(&self) -> f64 {
        BOUND / (self.count.max(1) as f64).sqrt()
    }
}
