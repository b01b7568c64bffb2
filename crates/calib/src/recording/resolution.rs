use ohmstrain_sensor::Resolution;

use crate::order::{median, sorted};
use crate::samples::Samples;

/// Quantile of the gaps between neighbouring values that serves as the step. Continuous readings have smaller gaps than this, those of a
/// converter do not.
const QUANTILE: f64 = 0.05;
/// Median of the absolute value of a normal variable, in standard deviations.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_082;
/// Sum of the squared coefficients 1, -3, 3, -1 of a third difference.
const THIRD_DIFFERENCE: f64 = 20.0;

/// Returns step and white noise of readings, of several recordings the coarser step and the smaller noise; `None` without four readings in
/// a row.
pub(crate) fn resolution(recordings: &[Samples]) -> Option<Resolution> {
    let coarser =
        |a: Resolution, b: Resolution| Resolution { step: a.step.max(b.step), noise_sd: a.noise_sd.min(b.noise_sd) };
    recordings.iter().filter_map(|samples| of_readings(samples.reading)).reduce(coarser)
}

/// Estimates both; the variance of rounding to the step is subtracted from that of the noise.
fn of_readings(readings: &[f64]) -> Option<Resolution> {
    let (step, sd) = (step(readings)?, noise_sd(readings)?);
    Some(Resolution { step, noise_sd: (sd * sd - step * step / 12.0).max(0.0).sqrt() })
}

/// Returns a small quantile of the gaps between neighbouring values.
fn step(readings: &[f64]) -> Option<f64> {
    let values = sorted(readings.iter().copied().filter(|reading| reading.is_finite()));
    let gaps = sorted(values.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0));
    gaps.get((QUANTILE * gaps.len() as f64) as usize).copied()
}

/// Estimates the noise from the median of third differences: they are small for motion of low frequency, and jumps are few.
fn noise_sd(readings: &[f64]) -> Option<f64> {
    let differences = readings.windows(4).map(|row| (row[3] - row[0] - 3.0 * (row[2] - row[1])).abs());
    let typical = median(differences.filter(|difference| difference.is_finite()))?;
    Some(typical / MEDIAN_OF_NORMAL / THIRD_DIFFERENCE.sqrt())
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::of_readings;

    /// Returns step and noise found in a slow triangle of 400 ohms and 200 s at 20 rows a second, with noise, read in steps.
    fn found(noise_sd: f64, step: f64) -> (f64, f64) {
        let mut draws = ChaCha8Rng::seed_from_u64(1);
        let triangle = |k: usize| 1000.0 + 4.0 * (0.05 * k as f64 - 100.0).abs();
        let mut noise = || -> f64 { StandardNormal.sample(&mut draws) };
        let readings: Vec<f64> =
            (0..4000).map(|k| ((triangle(k) + noise_sd * noise()) / step).round() * step).collect();
        let resolution = of_readings(&readings).unwrap();
        (resolution.step, resolution.noise_sd)
    }

    /// The median of 4000 third differences, with neighbours correlated, is known to 3 %.
    #[test]
    fn step_and_noise_are_found() {
        let (step, noise_sd) = found(0.5, 1e-6);
        assert!(step < 0.02 * 0.5 && (noise_sd / 0.5 - 1.0).abs() < 0.06, "{step} {noise_sd}");
        let (step, noise_sd) = found(0.5, 0.5);
        assert!((step - 0.5).abs() < 1e-9 && (noise_sd / 0.5 - 1.0).abs() < 0.1, "{step} {noise_sd}");
        // A step of a whole ohm with hardly any noise: the step is coarse.
        let (step, noise_sd) = found(0.01, 1.0);
        assert!((step - 1.0).abs() < 1e-9 && noise_sd < 0.25, "{step} {noise_sd}");
    }
}
