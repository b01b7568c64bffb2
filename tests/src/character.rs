//! Model-free characteristics of a sensor, which real and simulated recordings must share.

use nalgebra::{DMatrix, DVector};

/// A recording: times, s, readings and true strains, without gaps.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Times, s.
    pub time_s: Vec<f64>,
    /// Readings.
    pub reading: Vec<f64>,
    /// True strains.
    pub strain: Vec<f64>,
}

/// Character of a recording, each number in percent.
#[derive(Clone, Copy, Debug)]
pub struct Character {
    /// Error over the second half of the cubic fitted to the first half, of the strain's range.
    pub static_cubic: f64,
    /// Mean distance of the readings on the way up and down at the same strain, of the readings' span.
    pub loop_area: f64,
    /// Rise of the reading above its value at the start of a release, of the span: the median over long releases.
    pub release_peak: f64,
    /// Standard deviation of one-minute means of the residual of a cubic of strain for each direction, of the span.
    pub drift: f64,
}

/// Quantiles of the readings between which their span lies.
const SPAN: (f64, f64) = (0.02, 0.98);
/// Fraction of the 90th percentile of the rate above which strain counts as moving.
const MOVES: f64 = 0.1;
/// Fraction of the strain's range that a long release covers.
const LONG: f64 = 0.3;
const BINS: usize = 10;

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * (sorted.len().max(1) - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN)
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
    (sum / n).sqrt()
}

/// Returns the least-squares solution.
fn fitted(rows: &[Vec<f64>], targets: &[f64]) -> DVector<f64> {
    let design = DMatrix::from_fn(rows.len(), rows.first().map_or(0, Vec::len), |i, j| rows[i][j]);
    let (normal, right) = (design.transpose() * &design, design.transpose() * DVector::from_column_slice(targets));
    normal.svd(true, true).solve(&right, 1e-12).unwrap_or_default()
}

impl Known {
    fn rates(&self) -> Vec<f64> {
        let n = self.time_s.len();
        let rate = |k: usize| {
            let (before, after) = (k.saturating_sub(5), (k + 5).min(n - 1));
            (self.strain[after] - self.strain[before]) / (self.time_s[after] - self.time_s[before])
        };
        (0..n).map(rate).collect()
    }

    fn span(&self) -> f64 {
        quantile(&self.reading, SPAN.1) - quantile(&self.reading, SPAN.0)
    }

    fn static_cubic(&self) -> f64 {
        let (middle, unit) = (self.strain.len() / 2, self.span());
        let row = |r: &f64| (0..4).map(|power| ((r - self.reading[0]) / unit).powi(power)).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = self.reading.iter().map(row).collect();
        let cubic = fitted(&rows[..middle], &self.strain[..middle]);
        let (low, high) = range(&self.strain[..middle]);
        let (least, most) = range(&self.strain[middle..]);
        let estimate = |row: &Vec<f64>| row.iter().zip(&cubic).map(|(x, c)| x * c).sum::<f64>().clamp(low, high);
        rms((middle..rows.len()).map(|k| estimate(&rows[k]) - self.strain[k])) / (most - least)
    }

    fn loop_area(&self, direction: &[i8]) -> f64 {
        let (low, high) = range(&self.strain);
        let bin = |e: f64| (((e - low) / (high - low) * BINS as f64) as usize).min(BINS - 1);
        let readings = |wanted: usize, side: i8| {
            let rows = (0..self.strain.len()).filter(|k| bin(self.strain[*k]) == wanted && direction[*k] == side);
            rows.map(|k| self.reading[k]).collect::<Vec<f64>>()
        };
        let gaps: Vec<f64> = (1..BINS - 1)
            .map(|bin| [readings(bin, 1), readings(bin, -1)])
            .filter(|sides| sides.iter().all(|side| side.len() > 5))
            .map(|[up, down]| (quantile(&up, 0.5) - quantile(&down, 0.5)).abs())
            .collect();
        gaps.iter().sum::<f64>() / gaps.len() as f64 / self.span()
    }

    fn release_peak(&self, direction: &[i8]) -> f64 {
        let (low, high) = range(&self.strain);
        let mut peaks = Vec::new();
        let mut start = 0;
        for piece in direction.chunk_by(|a, b| a == b) {
            let rows = start..start + piece.len();
            start = rows.end;
            if piece[0] < 0 && self.strain[rows.start] - self.strain[rows.end - 1] > LONG * (high - low) {
                peaks.push(range(&self.reading[rows.clone()]).1 - self.reading[rows.start]);
            }
        }
        quantile(&peaks, 0.5) / self.span()
    }

    fn drift(&self, direction: &[i8]) -> f64 {
        let row = |(e, side): (&f64, &i8)| {
            let (up, down) = (f64::from(*side > 0), f64::from(*side < 0));
            vec![1.0, *e, e * e, e * e * e, up, down, up * e, down * e]
        };
        let rows: Vec<Vec<f64>> = self.strain.iter().zip(direction).map(row).collect();
        let law = fitted(&rows, &self.reading);
        let left = |k: usize| self.reading[k] - rows[k].iter().zip(&law).map(|(x, c)| x * c).sum::<f64>();
        let minute = |k: usize| ((self.time_s[k] - self.time_s[0]) / 60.0) as usize;
        let all: Vec<usize> = (0..rows.len()).collect();
        let means: Vec<f64> = all
            .chunk_by(|a, b| minute(*a) == minute(*b))
            .filter(|rows| self.time_s[rows[rows.len() - 1]] - self.time_s[rows[0]] > 55.0)
            .map(|rows| rows.iter().map(|k| left(*k)).sum::<f64>() / rows.len() as f64)
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        rms(means.iter().map(|x| x - mean)) / self.span()
    }

    /// Returns the characteristics of the recording.
    #[must_use]
    pub fn character(&self) -> Character {
        let rates = self.rates();
        let speeds: Vec<f64> = rates.iter().map(|rate| rate.abs()).collect();
        let least = MOVES * quantile(&speeds, 0.9);
        let side = |rate: &f64| {
            if *rate > least {
                1
            } else if *rate < -least {
                -1
            } else {
                0
            }
        };
        let direction: Vec<i8> = rates.iter().map(side).collect();
        Character {
            static_cubic: 100.0 * self.static_cubic(),
            loop_area: 100.0 * self.loop_area(&direction),
            release_peak: 100.0 * self.release_peak(&direction),
            drift: 100.0 * self.drift(&direction),
        }
    }
}
