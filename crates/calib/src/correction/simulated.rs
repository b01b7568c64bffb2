//! Strain from features of the law's readings in simulated motions, beyond those of the calibration; a few rows represent thousands.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{FEATURES, FILTER_INPUTS, OUTPUTS, filter_inputs, kernel};
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::correction::{relevance, standardised};
use ohmstrain_sensor::{SimulatedParams, TrainingRow};
use serde::Deserialize;

use super::prepared::{Prepared, scale};
use super::weight;
use crate::digits::digits;

/// Number of rows that represent all others. Two hundred carry no more information.
const ROWS: usize = 64;
/// Length scale of all inputs, in their standard deviations.
const LENGTH: f64 = 4.0;
/// Regularisation of the equations, in units of the process' variance.
const JITTER: f64 = 1e-4;
/// Number of iterations that alternate between weights and noise, and initial noise as a fraction of the strain's variance.
const TURNS: usize = 4;
const FIRST_NOISE: f64 = 0.1;

/// A row of a simulated motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SimulatedRow {
    /// Features of the readings up to this row.
    pub past: [f64; FEATURES],
    /// True strain, or its estimate.
    pub strain: f64,
}

/// A few rows that represent all.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Distilled {
    /// Standard deviation of the strain around their prediction.
    pub sd: f64,
    /// The rows.
    pub rows: Vec<SimulatedRow>,
}

impl Distilled {
    /// Learns from simulated rows; `real` rows determine the scales of the inputs. `None` if equations are singular.
    pub(crate) fn fit(simulated: &[SimulatedRow], real: &[TrainingRow], limits: StrainRange<f64>) -> Option<Self> {
        let scales: [_; FEATURES] = std::array::from_fn(|i| scale(real.iter().map(|row| row.past[i])));
        let on_scale = |row: &SimulatedRow| -> [f64; FEATURES] {
            std::array::from_fn(|i| (row.past[i] - scales[i].mean) / scales[i].sd)
        };
        let inputs: Vec<[f64; FEATURES]> = simulated.iter().map(on_scale).collect();
        let inputs: Vec<&[f64]> = inputs.iter().map(|row| &row[..]).collect();
        let strain: Vec<f64> = simulated.iter().map(|row| row.strain).collect();
        let (predicted, sd) = distilled(&inputs, &strain, centre(limits))?;
        let row = |(k, predicted): (usize, f64)| SimulatedRow {
            past: simulated[k].past.map(digits),
            strain: digits(predicted),
        };
        Some(Self { sd: digits(sd), rows: chosen(simulated.len()).zip(predicted).map(row).collect() })
    }
}

fn centre(limits: StrainRange<f64>) -> f64 {
    0.5 * (limits.lower + limits.upper)
}

/// Returns the indices of the representing rows among `rows`.
fn chosen(rows: usize) -> impl Iterator<Item = usize> {
    let count = ROWS.min(rows);
    (0..count).map(move |k| k * rows / count)
}

/// Returns the values of the process at the representing rows, by a subset of regressors (Quiñonero-Candela & Rasmussen, *J. Mach. Learn.
/// Res.* 6 (2005) 1939), and the standard deviation of the residual.
fn distilled(inputs: &[&[f64]], strain: &[f64], centre: f64) -> Option<(Vec<f64>, f64)> {
    let chosen: Vec<&[f64]> = chosen(inputs.len()).map(|k| inputs[k]).collect();
    let (with_all, among) = (kernels(inputs, &chosen), kernels(&chosen, &chosen));
    let targets = from_centre(strain, centre);
    let variance = targets.norm_squared() / strain.len() as f64;
    let (normal, right) = (with_all.tr_mul(&with_all), with_all.tr_mul(&targets));
    let (mut left, mut weights) = (FIRST_NOISE * variance, DVector::zeros(chosen.len()));
    for _ in 0..TURNS {
        let regular = &normal + &among * (left / variance) + DMatrix::identity(chosen.len(), chosen.len()) * JITTER;
        weights = regular.cholesky()?.solve(&right);
        left = (&targets - &with_all * &weights).norm_squared() / strain.len() as f64;
    }
    Some(((among * weights).iter().map(|x| x + centre).collect(), left.sqrt()))
}

fn from_centre(strain: &[f64], centre: f64) -> DVector<f64> {
    DVector::from_iterator(strain.len(), strain.iter().map(|x| x - centre))
}

fn kernels(a: &[&[f64]], b: &[&[f64]]) -> DMatrix<f64> {
    let by = relevance(LENGTH);
    DMatrix::from_fn(a.len(), b.len(), |i, j| {
        let sum: f64 = a[i].iter().zip(b[j]).map(|(x, y)| (x - y).powi(2)).sum();
        kernel(by * sum, a[i][0] * b[j][0])
    })
}

impl Prepared<'_, FILTER_INPUTS> {
    /// Learns the process of simulated rows. Its variance is the sum of two: that of its error in simulation, where the law is exact, and
    /// the mean squared error in the worst block of the judged rows, where it is not.
    pub(crate) fn simulated(&self, of: &Distilled) -> Option<SimulatedParams> {
        let rows: Vec<[f64; FEATURES]> = of.rows.iter().map(|row| row.past).collect();
        let standardised = self.simulated_rows(&rows);
        let own = features(&standardised);
        let strain: Vec<f64> = of.rows.iter().map(|row| row.strain).collect();
        let mean = centre(self.examples.limits);
        let regular = kernels(&own, &own) + DMatrix::identity(own.len(), own.len()) * JITTER;
        let weights = regular.cholesky()?.solve(&from_centre(&strain, mean));
        let weights: Vec<f64> = weights.iter().map(|x| weight(*x)).collect();
        let predicted = self.predictions(&rows, &weights);
        let squares: Vec<f64> =
            predicted.zip(self.judged.strain).map(|(predicted, strain)| (predicted - strain).powi(2)).collect();
        let of_block = |block: &Range<usize>| squares[block.clone()].iter().sum::<f64>() / block.len() as f64;
        let worst = self.judged.blocks.iter().map(of_block).fold(0.0, f64::max);
        Some(SimulatedParams { mean, sd: (of.sd.powi(2) + worst).sqrt(), length: LENGTH, weights, rows })
    }

    /// Predicts each judged row from the simulated ones.
    pub(super) fn simulated_predictions(&self, of: &SimulatedParams) -> Vec<Gaussian<f64>> {
        let variance = of.sd.powi(2);
        self.predictions(&of.rows, &of.weights).map(|mean| Gaussian { mean, variance }).collect()
    }

    fn predictions(&self, rows: &[[f64; FEATURES]], weights: &[f64]) -> impl Iterator<Item = f64> {
        let limits = self.examples.limits;
        let rows = self.simulated_rows(rows);
        let predicted = kernels(&features(&self.judged.rows), &features(&rows)) * DVector::from_column_slice(weights);
        let centre = centre(limits);
        (0..self.judged.rows.len()).map(move |k| (centre + predicted[k]).clamp(limits.lower, limits.upper))
    }

    fn simulated_rows(&self, rows: &[[f64; FEATURES]]) -> Vec<[f64; FILTER_INPUTS]> {
        rows.iter().map(|past| standardised(&self.scales, &filter_inputs(&[0.0; OUTPUTS], past))).collect()
    }
}

fn features(rows: &[[f64; FILTER_INPUTS]]) -> Vec<&[f64]> {
    rows.iter().map(|row| &row[OUTPUTS..]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::Examples;
    use ohmstrain_ekf::correction::InputScale;
    use ohmstrain_sensor::FUTURE_FEATURES;

    /// Returns rows whose strain is a smooth function of two features; the others are noise.
    fn rows(count: usize, seed: usize) -> (Vec<[f64; D]>, Vec<f64>) {
        let number = |k: usize| 2.0 * ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0) - 1.0;
        let inputs: Vec<[f64; D]> =
            (0..count).map(|k| std::array::from_fn(|i| 1.7 * number(seed + 31 * k + i))).collect();
        let strain = inputs.iter().map(|row| (0.6 * row[6]).tanh() + 0.2 * row[6] * row[7]).collect();
        (inputs, strain)
    }
    const D: usize = FILTER_INPUTS;
    const LIMITS: StrainRange<f64> = StrainRange { lower: -2.0, upper: 2.0 };

    /// Tests that sixty-four rows represent four thousand, with the stated error: two features of seven within ±1.7, in a kernel four wide.
    /// An error in one block of the calibration's rows widens the stated error for all.
    #[test]
    fn few_rows_stand_for_all_and_state_their_error() {
        let (real, known) = rows(100, 7);
        let time_s: Vec<f64> = (0..100).map(f64::from).collect();
        let distilled_from = |known: &[f64]| {
            let examples = Examples {
                inputs: &real,
                strain: known,
                time_s: &time_s,
                limits: LIMITS,
                reference_sd: 0.0,
                all: None,
            };
            let prepared = Prepared::new(examples);
            let (all, strain) = rows(4000, 100_000);
            let row = |(row, strain): (&[f64; D], &f64)| SimulatedRow {
                past: std::array::from_fn(|i| row[OUTPUTS + i]),
                strain: *strain,
            };
            let simulated: Vec<SimulatedRow> = all.iter().zip(&strain).map(row).collect();
            let as_training = |row: &[f64; D]| TrainingRow {
                time_s: 0.0,
                strain: 0.0,
                past: std::array::from_fn(|i| row[OUTPUTS + i]),
                future: [0.0; FUTURE_FEATURES],
                filtered: [0.0; OUTPUTS],
                smoothed: [0.0; OUTPUTS],
            };
            let training: Vec<TrainingRow> = real.iter().map(as_training).collect();
            let distilled = Distilled::fit(&simulated, &training, LIMITS).unwrap();
            let of = prepared.simulated(&distilled).unwrap();
            (of, distilled.sd, prepared.scales)
        };
        let (of, sd, scales): (_, _, [InputScale<f64>; D]) = distilled_from(&known);
        // The strain has a standard deviation of 0.5; sixty-four rows cover seven dimensions, most of them irrelevant.
        assert!(sd < 0.05, "{sd}");
        let (others, strain) = rows(500, 900_000);
        let on_scale = |row: &[f64; D], i: usize| (row[i] - scales[i].mean) / scales[i].sd;
        let error = |(row, strain): (&[f64; D], &f64)| {
            let kernel = |other: &[f64; FEATURES]| {
                let square: f64 = (6..D).map(|i| ((row[i] - other[i - 6]) / scales[i].sd).powi(2)).sum();
                let other = (other[0] - scales[6].mean) / scales[6].sd;
                (-square / 32.0).exp() + 0.09 * (1.0 + on_scale(row, 6) * other)
            };
            let weighted = of.rows.iter().zip(&of.weights).map(|(other, weight)| weight * kernel(other));
            (of.mean + weighted.sum::<f64>() - strain).powi(2)
        };
        let left = (others.iter().zip(&strain).map(error).sum::<f64>() / 500.0).sqrt();
        assert!(left < 1.5 * of.sd && of.sd < 0.1, "{left} {}", of.sd);
        let off: Vec<f64> = known.iter().enumerate().map(|(k, x)| if k < 20 { x + 0.5 } else { *x }).collect();
        let (of, sd, _) = distilled_from(&off);
        // Errors of 0.015 in twenty rows: 0.003 is one standard deviation of the cross term.
        assert!((of.sd * of.sd - sd * sd - 0.25).abs() < 0.01, "{}", of.sd);
    }
}
