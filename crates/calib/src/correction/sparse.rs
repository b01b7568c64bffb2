//! Weights of a few rows from all rows of several recordings.
//!
//! The process is `Σ αⱼ k(x, uⱼ)` over the few rows u, a priori with the covariance `K⁻¹` (deterministic training conditional:
//! Quiñonero-Candela & Rasmussen, *J. Mach. Learn. Res.* 6 (2005) 1939). Each recording also has its own offset, because R₀ and the initial
//! state differ between recordings. Settings and factors are judged on held-out recordings: neighbours within one recording share errors
//! that do not occur on another day.

use crate::dense::{cholesky, gram_of, inverse, product};
use crate::order::mean_sd;
use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use ohmstrain_ekf::correction::{LINEAR, kernel};
use ohmstrain_sensor::correction::relevance;

use super::gaussian_process::{LeftOutRow, WHITE};

/// Standard deviation of a recording's offset, in standard deviations of the targets.
const OFFSET: f64 = 0.25;
/// Correlation time of errors, s; rows that are closer count for less. Whitening the errors as an Ornstein-Uhlenbeck process gives worse
/// predictions of other recordings (docs/notes/2026-11-26-correction-several-recordings.md).
const ERROR_TIME_S: f64 = 4.0;
/// Regularisation that keeps the kernels of the few rows apart.
const JITTER: f64 = 1e-6;
const LEAST: f64 = 1e-9;

/// All rows of several recordings, one recording after the other, and the few that get weights.
#[derive(Clone, Copy)]
pub(super) struct Population<'a> {
    pub few: &'a [&'a [f64]],
    pub inputs: &'a [&'a [f64]],
    pub targets: &'a [f64],
    pub recordings: &'a [Range<usize>],
    /// Usual time between rows, s.
    pub step_s: f64,
}

/// Sums over a population for given length scales, from which a fit with any noise follows.
pub(super) struct Sums {
    /// Mean and standard deviation of the targets.
    pub centre: f64,
    pub size: f64,
    targets: DVector<f64>,
    /// Kernels between all rows and the few.
    kernels: DMatrix<f64>,
    /// Kernel of each row with itself.
    priors: Vec<f64>,
    /// Kernels between the few rows.
    few: DMatrix<f64>,
    /// The inverse of the prior covariance of weights and offsets.
    regular: DMatrix<f64>,
    /// Normal equations of each recording, and of all.
    own: Vec<Normal>,
    all: Normal,
    recordings: Vec<Range<usize>>,
    /// Fraction of a row's information that its neighbours do not share.
    share: f64,
}

/// Normal equations of weights, then offsets: matrix, right-hand side, and sum of squared targets.
#[derive(Clone)]
struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

impl Sums {
    pub(super) fn new(population: Population, lengths: &[f64]) -> Self {
        let Population { few, inputs, targets, recordings, step_s } = population;
        let (centre, sd) = mean_sd(targets.iter().copied());
        let size = sd.max(f64::MIN_POSITIVE);
        let targets = DVector::from_iterator(targets.len(), targets.iter().map(|y| (y - centre) / size));
        let relevance: Vec<f64> = lengths.iter().map(|length| relevance(*length)).collect();
        let of_rows = |a: &[f64], b: &[f64]| {
            let apart = a.iter().zip(b).zip(&relevance).map(|((a, b), by)| (a - b).powi(2) * by);
            kernel(apart.sum(), a[0] * b[0])
        };
        let kernels = DMatrix::from_fn(inputs.len(), few.len(), |i, j| of_rows(inputs[i], few[j]));
        let among =
            DMatrix::from_fn(few.len(), few.len(), |i, j| of_rows(few[i], few[j]) + if i == j { JITTER } else { 0.0 });
        let (m, all) = (few.len(), few.len() + recordings.len());
        let mut regular = DMatrix::identity(all, all) / OFFSET.powi(2);
        regular.view_mut((0, 0), (m, m)).copy_from(&among);
        let share = (0.5 * step_s / ERROR_TIME_S).min(1.0);
        let own: Vec<Normal> = recordings
            .iter()
            .enumerate()
            .map(|(g, rows)| Normal::of_recording((&kernels, &targets), rows, (m + g, all), share))
            .collect();
        let all = own.iter().skip(1).fold(own[0].clone(), |sum, own| Normal {
            matrix: sum.matrix + &own.matrix,
            right: sum.right + &own.right,
            square: sum.square + own.square,
        });
        let priors = inputs.iter().map(|x| 1.0 + LINEAR * (1.0 + x[0] * x[0])).collect();
        Self {
            centre,
            size,
            targets,
            kernels,
            priors,
            few: among,
            regular,
            own,
            all,
            recordings: recordings.to_vec(),
            share,
        }
    }

    /// Returns the variance of the noise of a single row, in units of the prior variance.
    fn white(noise: f64) -> f64 {
        (1.0 + WHITE) * noise * noise
    }

    /// Factors the normal equations with the prior, without one recording if given.
    fn factor(&self, noise: f64, without: Option<&Normal>) -> Option<Cholesky<f64, Dyn>> {
        let mut matrix = &self.regular * Self::white(noise) + &self.all.matrix;
        if let Some(own) = without {
            matrix -= &own.matrix;
        }
        for i in 0..matrix.nrows() {
            matrix[(i, i)] += LEAST;
        }
        cholesky(matrix)
    }

    /// Returns the weights of the few rows, in the unit of the targets, and the prior variance where the kernel is 1, in that unit squared.
    pub(super) fn weights(&self, noise: f64) -> Option<(Vec<f64>, f64)> {
        let solution = self.factor(noise, None)?.solve(&self.all.right);
        let rows = self.targets.len() as f64 * self.share;
        let scale = (self.all.square - self.all.right.dot(&solution)) / (Self::white(noise) * rows.max(1.0));
        let weights = solution.iter().take(self.few.nrows()).map(|weight| weight * self.size).collect();
        Some((weights, scale.max(0.0) * self.size * self.size))
    }

    /// Returns the unpredictable variance, of the noise and a recording's offset, in units of the prior variance.
    pub(super) fn unpredicted(noise: f64) -> f64 {
        Self::white(noise) + OFFSET * OFFSET
    }

    /// Predicts every row without its recording, for a prior variance of 1.
    pub(super) fn left_out(&self, noise: f64) -> Option<Vec<LeftOutRow>> {
        let m = self.few.nrows();
        let among = inverse(&cholesky(self.few.clone())?);
        let mut predicted = Vec::with_capacity(self.targets.len());
        for (own, rows) in self.own.iter().zip(&self.recordings) {
            let factor = self.factor(noise, Some(own))?;
            let weights = factor.solve(&(&self.all.right - &own.right));
            let known = &among - inverse(&factor).view((0, 0), (m, m)) * Self::white(noise);
            let kernels = self.kernels.rows(rows.start, rows.len());
            let (means, weighted) = (kernels * weights.rows(0, m), product(kernels, &known));
            predicted.extend(rows.clone().enumerate().map(|(k, row)| {
                let explained = weighted.row(k).dot(&kernels.row(k));
                let prior = self.priors[row];
                let unknown = ((prior - explained) / prior).clamp(0.0, 1.0);
                LeftOutRow { mean: self.centre + self.size * means[k], unknown, prior }
            }));
        }
        Some(predicted)
    }

    /// Returns the mean negative log density of the rows, each predicted without its recording, at the prior variance that minimises it, up
    /// to a constant.
    pub(super) fn cost(&self, noise: f64) -> Option<f64> {
        let rows = self.left_out(noise)?;
        let count = rows.len() as f64;
        let (mut squares, mut logarithms) = (0.0, 0.0);
        for (row, target) in rows.iter().zip(self.targets.iter()) {
            let variance = row.unknown * row.prior + Self::unpredicted(noise);
            squares += ((row.mean - self.centre) / self.size - target).powi(2) / variance;
            logarithms += variance.ln();
        }
        Some(0.5 * ((squares / count).ln() + logarithms / count))
    }

    /// Returns the rows of the upper triangle W, one after the other: |W k|² is the fraction of the prior variance that all rows explain
    /// through these of the few, whose kernels are k.
    pub(super) fn explained(&self, noise: f64, inducing: &[usize]) -> Option<Vec<f64>> {
        let m = inducing.len();
        let among = inverse(&cholesky(self.few.select_rows(inducing).select_columns(inducing))?);
        let kept: Vec<usize> = inducing.iter().copied().chain(self.few.nrows()..self.regular.nrows()).collect();
        let matrix = &self.regular * Self::white(noise) + &self.all.matrix;
        let matrix =
            matrix.select_rows(&kept).select_columns(&kept) + DMatrix::identity(kept.len(), kept.len()) * LEAST;
        let left = inverse(&cholesky(matrix)?);
        let known = among - left.view((0, 0), (m, m)) * Self::white(noise);
        let parts = (0.5 * (&known + known.transpose())).symmetric_eigen();
        let roots = parts.eigenvalues.map(|value| value.max(0.0).sqrt());
        let triangle = product(&DMatrix::from_diagonal(&roots), &parts.eigenvectors.transpose()).qr().r();
        Some((0..m).flat_map(|i| (i..m).map(move |j| (i, j))).map(|place| triangle[place]).collect())
    }
}

impl Normal {
    /// Computes the sums over the rows of a recording, whose offset is one of the unknowns.
    fn of_recording(
        (kernels, targets): (&DMatrix<f64>, &DVector<f64>),
        rows: &Range<usize>,
        (offset, all): (usize, usize),
        share: f64,
    ) -> Self {
        let m = kernels.ncols();
        let (own, targets) = (kernels.rows(rows.start, rows.len()), targets.rows(rows.start, rows.len()));
        let mut matrix = DMatrix::zeros(all, all);
        matrix.view_mut((0, 0), (m, m)).copy_from(&(gram_of(own) * share));
        let sums = own.row_sum() * share;
        matrix.view_mut((offset, 0), (1, m)).copy_from(&sums);
        matrix.view_mut((0, offset), (m, 1)).copy_from(&sums.transpose());
        matrix[(offset, offset)] = rows.len() as f64 * share;
        let mut right = DVector::zeros(all);
        right.rows_mut(0, m).copy_from(&(own.tr_mul(&targets) * share));
        right[offset] = targets.sum() * share;
        Self { matrix, right, square: targets.norm_squared() * share }
    }
}
