//! Simulated motions and the law's readings of them, beyond those of the calibration.

use std::f64::consts::{PI, TAU};

use ohmstrain_ekf::Reading;
use ohmstrain_ekf::correction::FeatureScale;
use ohmstrain_model::StrainRange;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

use crate::calibrate::correction_scale::each_row;
use crate::correction::simulated::SimulatedRow;
use crate::law::structure::LawFit;
use crate::motion_stats::MotionStats;

/// Number of simulated motions, their duration, s, and the start of each that is dropped while low-passes forget it, s.
const MOTIONS: usize = 24;
const LASTS_S: f64 = 600.0;
const FORGOTTEN_S: f64 = 20.0;
/// Shortest time step, s (no low-pass of the features would resolve a shorter one), and least number of steps of a motion.
const LEAST_STEP_S: f64 = 0.1;
const LEAST_STEPS: usize = 200;
/// Seed of all simulated motions.
pub const SIMULATED_SEED: u64 = 1;
/// Target number of rows to learn from.
const ROWS: usize = 4000;
/// Standard deviation of ln R₀ between days.
const REST_SPREAD: f64 = 0.1;
/// Correlation time of the law's error, s.
const ERROR_TIME_S: f64 = 10.0;
/// Slowest mean speed in median speeds of the calibration, fastest one in its fastest speeds, and least ratio of the two.
const SLOWEST: f64 = 0.3;
const FASTEST: f64 = 1.5;
const LEAST_SPEED: f64 = 1e-3;
/// Mean hold, s, longest sine, s, and least amplitude of a sine as a fraction of the range.
const HOLD_S: f64 = 5.0;
const SINE_S: f64 = 120.0;
const LEAST_AMPLITUDE: f64 = 0.01;

/// Slowest and fastest mean speed, strain/s.
type Speeds = (f64, f64);

/// Returns rows of simulated motions within the calibrated range, at its speeds and somewhat beyond, with the law's readings; `step_s` is
/// the usual time between readings.
pub(crate) fn simulated_rows(
    fit: &LawFit,
    stats: &MotionStats,
    scale: &FeatureScale<f64>,
    step_s: f64,
) -> Vec<SimulatedRow> {
    let step_s = step_s.max(LEAST_STEP_S);
    let mut rng = ChaCha12Rng::seed_from_u64(SIMULATED_SEED);
    let fastest = FASTEST * stats.fastest_rate.max(stats.speed);
    let speeds = ((SLOWEST * stats.speed).max(LEAST_SPEED * fastest), fastest);
    let rows = ((LASTS_S / step_s) as usize).max(LEAST_STEPS);
    let forgotten = ((FORGOTTEN_S / step_s) as usize).max(1);
    let every = (MOTIONS * (rows - forgotten) / ROWS).max(1);
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 * step_s).collect();
    let mut found = Vec::with_capacity(ROWS + MOTIONS);
    for _ in 0..MOTIONS {
        let strain = motion(&mut rng, rows, step_s, fit.law.range, speeds);
        let readings = readings(fit, &strain, step_s, &mut rng);
        each_row(&time_s, &readings, *scale, |k, _, past| {
            if k >= forgotten && (k - forgotten).is_multiple_of(every) {
                found.extend(past.map(|past| SimulatedRow { past, strain: strain[k] }));
            }
        });
    }
    found
}

/// Draws a motion. Half of its pieces are ramps, to anywhere or to an end of the range; the others are holds, and sines around any strain.
fn motion(rng: &mut ChaCha12Rng, rows: usize, step_s: f64, range: StrainRange<f64>, speeds: Speeds) -> Vec<f64> {
    let mut uniform = |from: f64, to: f64| Uniform::new_inclusive(from, to).map_or(from, |any| any.sample(rng));
    let (low, high) = (range.lower, range.upper);
    let mut strain = vec![uniform(low, high)];
    while strain.len() < rows {
        let now = strain[strain.len() - 1];
        let speed = uniform(speeds.0.ln(), speeds.1.ln()).exp();
        match uniform(0.0, 1.0) {
            kind if kind < 0.25 => {
                let hold_s = -HOLD_S * uniform(f64::EPSILON, 1.0).ln();
                strain.extend(std::iter::repeat_n(now, (hold_s / step_s) as usize + 1));
            }
            kind if kind < 0.75 => {
                let to = match uniform(0.0, 1.0) {
                    x if x < 0.6 => uniform(low, high),
                    x if x < 0.8 => low,
                    _ => high,
                };
                strain.extend(ramp(now, to, speed * step_s).take(rows));
            }
            _ => {
                let middle = uniform(low, high);
                let room = (middle - low).min(high - middle).max(LEAST_AMPLITUDE * (high - low));
                let amplitude = uniform(0.3, 1.0) * room;
                let omega = 0.5 * PI * speed / amplitude;
                let lasts_s = (uniform(1.0, 5.0).floor() * TAU / omega).min(SINE_S);
                strain.extend(ramp(now, middle, speed * step_s).take(rows));
                let sine = |k: usize| (middle + amplitude * (omega * step_s * k as f64).sin()).clamp(low, high);
                strain.extend((1..=(lasts_s / step_s) as usize + 1).map(sine));
            }
        }
    }
    strain.truncate(rows);
    strain
}

/// Returns even steps, none longer than `step`.
fn ramp(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let steps = ((to - from).abs() / step) as usize + 1;
    (1..=steps).map(move |k| from + (to - from) * k as f64 / steps as f64)
}

/// Returns the law's readings, with an error like that on held-out blocks and with the R₀ of another day. They are exact for strain that
/// changes linearly between rows.
fn readings(fit: &LawFit, strain: &[f64], step_s: f64, rng: &mut ChaCha12Rng) -> Vec<Option<Reading<f64>>> {
    let law = &fit.law;
    let gauge = law.gauge;
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let rest = (REST_SPREAD * normal()).exp();
    let kept = (-step_s / ERROR_TIME_S).exp();
    let mut error = fit.cross_validated_error * normal();
    let mut relaxation = vec![0.0; law.branches.len()];
    let mut before = strain[0];
    let row = |&now: &f64| {
        let (step, middle) = (now - before, 0.5 * (now + before));
        before = now;
        for (c, branch) in relaxation.iter_mut().zip(&law.branches) {
            let x = step_s / branch.tau_s;
            let gain = if step > 0.0 {
                branch.extend_gain + branch.extend_gain_slope * middle
            } else {
                branch.retract_gain + branch.retract_gain_slope * middle
            };
            *c = *c * (-x).exp() - (-x).exp_m1() / x * gain * step;
        }
        error = kept * error + (1.0 - kept * kept).sqrt() * fit.cross_validated_error * normal();
        let viscosity_s = if step > 0.0 { law.extend_viscosity_s } else { law.retract_viscosity_s };
        let (value, _) = gauge.value_and_slope(now);
        let reading = value + viscosity_s * step / step_s + relaxation.iter().sum::<f64>() + error;
        Some(Reading::from((1.0 + reading) * rest - 1.0))
    };
    strain.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use ohmstrain_model::{Branch, Gauge};
    use ohmstrain_sensor::LawParams;

    use super::*;

    const RANGE: StrainRange<f64> = StrainRange { lower: 0.05, upper: 0.35 };

    #[test]
    fn motions_hold_and_move_within_range_and_speeds() {
        let (step_s, speeds) = (0.1, (0.01, 0.2));
        let mut rng = ChaCha12Rng::seed_from_u64(3);
        let (mut holds, mut rows) = (0, 0);
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for _ in 0..20 {
            let strain = motion(&mut rng, 6000, step_s, RANGE, speeds);
            assert_eq!(strain.len(), 6000);
            for pair in strain.windows(2) {
                let rate = (pair[1] - pair[0]).abs() / step_s;
                // The largest speed of a sine is π/2 of its mean.
                assert!(rate <= 0.5 * PI * speeds.1 + 1e-9, "{rate}");
                holds += usize::from(rate == 0.0);
                rows += 1;
            }
            lowest = strain.iter().copied().fold(lowest, f64::min);
            highest = strain.iter().copied().fold(highest, f64::max);
        }
        // The motions reach both ends of the range, to rounding, and stay within it.
        assert!((lowest - RANGE.lower).abs() < 1e-15 && (highest - RANGE.upper).abs() < 1e-15, "{lowest} {highest}");
        let share = holds as f64 / rows as f64;
        assert!((0.05..0.6).contains(&share), "{share}");
    }

    /// Compares a law without error with its differential equations, integrated in a thousand steps a row.
    #[test]
    fn readings_are_the_laws() {
        let branch = Branch {
            tau_s: 2.0,
            extend_gain: 0.9,
            retract_gain: -0.6,
            extend_gain_slope: 0.4,
            retract_gain_slope: -0.7,
        };
        let slow = Branch { tau_s: 30.0, extend_gain: 0.3, ..branch };
        let law = LawParams {
            range: RANGE,
            gauge: Gauge::Polynomial { coefficients: [2.0, -1.0, 3.0] },
            extend_viscosity_s: 0.05,
            retract_viscosity_s: -0.02,
            branches: vec![branch, slow],
        };
        let fit = LawFit { law, rest_readings: vec![], residuals: vec![], cross_validated_error: 0.0, ridge: 0.0 };
        let (step_s, fine) = (0.1, 1000);
        let mut rng = ChaCha12Rng::seed_from_u64(4);
        let strain = motion(&mut rng, 600, step_s, RANGE, (0.01, 0.2));
        let read = readings(&fit, &strain, step_s, &mut rng);
        let mut relaxation = [0.0, 0.0];
        let mut expected = vec![];
        for (k, &now) in strain.iter().enumerate() {
            let rate = if k == 0 { 0.0 } else { (now - strain[k - 1]) / step_s };
            for i in 0..fine {
                let at = now - rate * step_s * (1.0 - (f64::from(i) + 0.5) / f64::from(fine));
                for (c, branch) in relaxation.iter_mut().zip([branch, slow]) {
                    let gain = if rate > 0.0 {
                        branch.extend_gain + branch.extend_gain_slope * at
                    } else {
                        branch.retract_gain + branch.retract_gain_slope * at
                    };
                    *c += step_s / f64::from(fine) * (gain * rate - *c / branch.tau_s);
                }
            }
            let viscosity_s = if rate > 0.0 { 0.05 } else { -0.02 };
            let gauge = 2.0 * now - now * now + 3.0 * now.powi(3);
            expected.push(1.0 + gauge + viscosity_s * rate + relaxation[0] + relaxation[1]);
        }
        // The R₀ of another day is a common factor of all readings.
        let rest = (1.0 + read[0].unwrap().value) / expected[0];
        assert!(rest != 1.0 && rest.ln().abs() < 5.0 * REST_SPREAD, "{rest}");
        for (read, expected) in read.iter().zip(expected) {
            // Euler's method has an error of half a step of the rate's change: 1e-4 s / 2 of 0.2 /s over 2 s. The gain at mid-strain
            // replaces the mean over a row; with a slope of 0.7 that changes it by 0.7 · 0.02 / 24 of 0.02 per row forgotten.
            assert!(((1.0 + read.unwrap().value) / rest - expected).abs() < 1e-4);
        }
    }
}
