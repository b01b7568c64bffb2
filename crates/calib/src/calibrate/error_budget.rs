use crate::law::fit::CrossFit;
use crate::motion_stats::{directions, moving_mean};
use crate::order::median;
use crate::samples::{Samples, central_rate, known_parts, reading_range};
use ohmstrain_sensor::ErrorBudget;

/// Splits the error on held-out blocks into its shares.
pub(crate) fn error_budget(recordings: &[Samples], fit: &CrossFit, wrong: &WrongDirection) -> ErrorBudget {
    let (mut law, mut drift, mut noise, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (block, without) in fit.without_block.iter().enumerate() {
        for (r, (residuals, samples)) in without.residuals.iter().zip(recordings).enumerate() {
            let rows = fit.blocks[r][block].clone();
            let percent = 100.0 * without.rest_readings[r] / range(samples);
            let known: Vec<f64> = residuals[rows].iter().filter(|x| x.is_finite()).map(|x| x * percent).collect();
            let n = known.len() as f64;
            if known.len() < 3 || !percent.is_finite() {
                continue;
            }
            let mean = known.iter().sum::<f64>() / n;
            let variance = known.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
            let white = white_variance(&known).min(variance);
            (law, drift, noise) = (law + n * (variance - white), drift + n * mean * mean, noise + n * white);
            count += n;
        }
    }
    let size = |sum: f64| (sum / f64::max(count, 1.0)).sqrt();
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    ErrorBudget {
        law_percent: size(law),
        drift_percent: size(drift),
        noise_percent: size(noise),
        wrong_rows: share(wrong.rows, wrong.moving_rows),
        wrong_error: share(wrong.squared_error, wrong.all_squared_error),
    }
}

/// Returns the range of the readings.
fn range(samples: &Samples) -> f64 {
    let (low, high) = reading_range(std::slice::from_ref(samples));
    high - low
}

/// Median of a χ² variable with one degree of freedom.
const CHI_SQUARE_MEDIAN: f64 = 0.454_936;

/// Estimates the variance of row-to-row independent noise from the median squared second difference, which a steady slope does not change:
/// (x₋ − 2 x + x₊)² is 6 σ² on average.
fn white_variance(x: &[f64]) -> f64 {
    let squares = x.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).powi(2));
    median(squares).map_or(0.0, |median| median / (6.0 * CHI_SQUARE_MEDIAN))
}

/// Direction of the body's motion in a row; zero at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Direction(i8);

impl Direction {
    /// Returns the direction in every row of a recording; zero in long gaps of its reference.
    pub(crate) fn of_rows(samples: &Samples) -> Vec<Self> {
        let mut rates = vec![f64::NAN; samples.len()];
        for (rows, strain) in known_parts(samples) {
            let rate = moving_mean(&central_rate(&samples.time_s[rows.clone()], &strain));
            rates[rows].copy_from_slice(&rate);
        }
        directions(&rates).into_iter().map(Self).collect()
    }
}

/// Counts and squared errors of the rows in which a filter has the direction wrong.
#[derive(Debug, Default)]
pub(crate) struct WrongDirection {
    rows: f64,
    moving_rows: f64,
    squared_error: f64,
    all_squared_error: f64,
}

impl WrongDirection {
    /// Adds a row: the true direction, the estimated rate, the error of the strain.
    pub(crate) fn see(&mut self, truth: Direction, rate: f64, error: f64) {
        let is_wrong = f64::from(truth.0) * rate < 0.0;
        self.all_squared_error += error * error;
        self.moving_rows += f64::from(u8::from(truth.0 != 0));
        if is_wrong {
            self.rows += 1.0;
            self.squared_error += error * error;
        }
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_sensor::{ErrorBudget, Limit};

    use super::white_variance;

    /// Second differences of white noise with standard deviation 0.3 on a steep line. The squares of neighbours are correlated, so the
    /// median of n = 20 000 is known to a few percent.
    #[test]
    fn noise_is_distinguished_from_a_steady_change() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let noise: Vec<f64> = (0..20_000).map(|_| 0.3 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)).collect();
        let sloped: Vec<f64> = noise.iter().enumerate().map(|(k, x)| x + 5.0 * k as f64).collect();
        assert!((white_variance(&sloped).sqrt() / 0.3 - 1.0).abs() < 0.05, "{}", white_variance(&sloped).sqrt());
        assert_eq!(white_variance(&[1.0, 2.0]), 0.0);
    }

    #[test]
    fn the_largest_share_limits() {
        let budget = |law_percent, drift_percent, noise_percent, wrong_error| ErrorBudget {
            law_percent,
            drift_percent,
            noise_percent,
            wrong_rows: 0.1,
            wrong_error,
        };
        // Squares 9, 1, 0.25 of 10.25: the law has a share of 0.878 in what the direction leaves.
        assert_eq!(budget(3.0, 1.0, 0.5, 0.4).limit(), Limit::Law);
        assert_eq!(budget(1.0, 3.0, 0.5, 0.4).limit(), Limit::Drift);
        assert_eq!(budget(1.0, 0.5, 3.0, 0.4).limit(), Limit::Noise);
        assert_eq!(budget(3.0, 1.0, 0.5, 0.6).limit(), Limit::Direction);
        // Less than half, but more than any other: 0.4 against 0.6 / 2.
        assert_eq!(budget(2.0, 2.0, 0.0, 0.4).limit(), Limit::Direction);
        let shares = budget(3.0, 1.0, 0.5, 0.4).shares();
        assert!((shares.law - 0.6 * 9.0 / 10.25).abs() < 1e-15 && shares.direction == 0.4);
        assert!((shares.law + shares.direction + shares.drift + shares.noise - 1.0).abs() < 1e-15);
        assert_eq!(budget(0.0, 0.0, 0.0, 0.0).limit(), Limit::Law);
    }
}
