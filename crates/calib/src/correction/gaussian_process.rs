use crate::dense::{cholesky, lower_inverse, product};
use crate::order::mean_sd;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use ohmstrain_ekf::correction::kernel;
use ohmstrain_sensor::correction::relevance;

/// Number of blocks that are left out in turn.
pub(super) const BLOCKS: usize = 5;
/// White noise beside the noise that is correlated in time, as a share of its variance.
pub(super) const WHITE: f64 = 0.09;
/// Variance that keeps the equations regular, in units of the targets' variance.
const JITTER: f64 = 1e-6;
/// Smallest pivot of an inducing row that still adds information, as a fraction of the prior variance.
const SMALLEST_PIVOT: f64 = 1e-6;

/// Hyper-parameters of a Gaussian process.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    /// Length scale of each input, in standard deviations of the input.
    pub lengths: Vec<f64>,
    /// Standard deviation of the noise that is correlated in time, relative to that of the targets.
    pub noise: f64,
    /// Correlation time of the noise, s.
    pub noise_time_s: f64,
}

/// Rows to learn from: standardised inputs, targets, times.
#[derive(Clone, Copy)]
pub(crate) struct TrainingSet<'a> {
    pub inputs: &'a [&'a [f64]],
    pub targets: &'a [f64],
    pub time_s: &'a [f64],
}

/// A Gaussian process conditioned on rows.
pub(crate) struct GaussianProcess {
    /// Mean and standard deviation of the targets.
    pub centre: f64,
    pub size: f64,
    /// Prior variance where the kernel is 1, in units of the targets' variance; the maximum-likelihood value.
    pub scale: f64,
    /// Variance of the noise, in units of the prior variance.
    pub noise: f64,
    /// Kernels between the rows, lower triangle.
    kernel: DMatrix<f64>,
    covariance: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
    targets: DVector<f64>,
}

/// Prediction of a row by the process conditioned without the row's block, in the unit of the target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeftOutRow {
    pub mean: f64,
    /// Fraction of the prior variance that is unexplained.
    pub unknown: f64,
    /// Prior variance.
    pub prior: f64,
}

/// Prediction of a block from the other rows.
pub(super) struct BlockLeftOut {
    /// Its first row.
    pub start: usize,
    /// Targets minus the prediction from the other rows, in standard deviations of the targets.
    pub errors: DVector<f64>,
    /// The inverse of their covariance, for a prior variance of 1.
    pub precision: Cholesky<f64, Dyn>,
}

impl TrainingSet<'_> {
    /// Returns `Σ (xᵢ - xᵢ')²/2ℓᵢ²` for all pairs of rows, lower triangle.
    pub(super) fn half_squares(self, lengths: &[f64]) -> DMatrix<f64> {
        let relevance: Vec<f64> = lengths.iter().map(|length| relevance(*length)).collect();
        let apart = |(a, b): (&f64, &f64)| (a - b).powi(2);
        let sum = |i: usize, j: usize| {
            let squares = self.inputs[i].iter().zip(self.inputs[j]).map(apart);
            squares.zip(&relevance).map(|(square, relevance)| square * relevance).sum()
        };
        lower_triangle(self.inputs.len(), sum)
    }

    /// Returns the kernels between the rows, lower triangle, from sums by [`half_squares`](Self::half_squares).
    pub(super) fn kernel(self, sums: &DMatrix<f64>) -> DMatrix<f64> {
        lower_triangle(self.inputs.len(), |i, j| kernel(sums[(i, j)], self.inputs[i][0] * self.inputs[j][0]))
    }
}

/// Noise of the targets.
pub(super) struct Noise {
    /// Standard deviation of the part that is correlated in time, relative to that of the targets.
    pub sd: f64,
    /// Correlation time, s.
    pub time_s: f64,
    /// Covariance, in units of the targets' variance, lower triangle.
    covariance: DMatrix<f64>,
}

impl Noise {
    pub(super) fn new(of: TrainingSet, sd: f64, time_s: f64) -> Self {
        let variance = sd.powi(2);
        let covariance = lower_triangle(of.time_s.len(), |i, j| {
            let white = if i == j { WHITE * variance + JITTER } else { 0.0 };
            variance * (-(of.time_s[i] - of.time_s[j]).abs() / time_s).exp() + white
        });
        Self { sd, time_s, covariance }
    }
}

impl GaussianProcess {
    /// Conditions a process on rows; `None` if its covariance is not positive definite.
    pub(crate) fn new(training: TrainingSet, params: &Settings) -> Option<Self> {
        let kernel = training.kernel(&training.half_squares(&params.lengths));
        Self::of_kernel(training.targets, kernel, &Noise::new(training, params.noise, params.noise_time_s))
    }

    /// Conditions a process on rows, given kernels by [`TrainingSet::kernel`].
    pub(super) fn of_kernel(targets: &[f64], kernel: DMatrix<f64>, noise: &Noise) -> Option<Self> {
        let n = targets.len();
        let (centre, sd) = mean_sd(targets.iter().copied());
        let size = sd.max(f64::MIN_POSITIVE);
        let targets = DVector::from_iterator(n, targets.iter().map(|y| (y - centre) / size));
        let covariance = cholesky(&kernel + &noise.covariance)?;
        let weights = covariance.solve(&targets);
        let scale = targets.dot(&weights) / n as f64;
        let noise = (1.0 + WHITE) * noise.sd.powi(2);
        Some(Self { centre, size, scale, noise, kernel, covariance, weights, targets })
    }

    /// Returns the negative log evidence up to a constant, with the scale that minimises it.
    pub(super) fn negative_log_evidence(&self) -> f64 {
        let n = self.targets.len() as f64;
        let half_log_determinant: f64 = self.covariance.l_dirty().diagonal().iter().map(|pivot| pivot.ln()).sum();
        0.5 * n * self.scale.ln() + half_log_determinant
    }

    /// Returns the weights of the rows, in the unit of the targets.
    pub(crate) fn weights(&self) -> impl Iterator<Item = f64> {
        self.weights.iter().map(|weight| weight * self.size)
    }

    /// Returns the variance that corresponds to a kernel of 1, in the squared unit of the targets.
    pub(crate) fn variance(&self) -> f64 {
        self.scale * self.size * self.size
    }

    /// Predicts every row without the row's block, in closed form from the inverse covariance (Rasmussen & Williams, *Gaussian Processes
    /// for Machine Learning*, 2006, eq. 5.12, for blocks). Blocks are of consecutive rows.
    pub(crate) fn left_out(&self, blocks: usize) -> Option<Vec<LeftOutRow>> {
        let n = self.targets.len();
        let mut rows = Vec::with_capacity(n);
        for BlockLeftOut { start, errors, precision } in self.blocks_left_out(blocks)? {
            let covariance = precision.inverse();
            for (k, error) in errors.iter().enumerate() {
                let prior = self.kernel[(start + k, start + k)];
                rows.push(LeftOutRow {
                    mean: self.centre + self.size * (self.targets[start + k] - error),
                    unknown: ((covariance[(k, k)] - self.noise - JITTER) / prior).clamp(0.0, 1.0),
                    prior: prior * self.variance(),
                });
            }
        }
        Some(rows)
    }

    /// Predicts each block from the rows of the others, in order; `None` if a covariance is not positive definite.
    pub(super) fn blocks_left_out(&self, blocks: usize) -> Option<Vec<BlockLeftOut>> {
        let n = self.targets.len();
        let triangle = self.covariance.l_dirty();
        let mut inverse: DMatrix<f64> = DMatrix::zeros(n, n);
        let mut left_out = Vec::with_capacity(blocks);
        // The inverse of the triangle is built from its end. The columns of a block are zero above the block; below it they follow from the
        // part of the inverse that is already known. Matrix products are several times as fast as triangular solves.
        for block in (0..blocks).rev() {
            let (start, end) = (block * n / blocks, (block + 1) * n / blocks);
            let (len, later) = (end - start, n - end);
            let own = lower_inverse(&triangle.view((start, start), (len, len)));
            let below = product(triangle.view((end, start), (later, len)), &own);
            let below = -product(inverse.view((end, end), (later, later)), &below);
            let precision = cholesky(product(&own.transpose(), &own) + product(&below.transpose(), &below))?;
            inverse.view_mut((start, start), (len, len)).copy_from(&own);
            inverse.view_mut((end, start), (later, len)).copy_from(&below);
            left_out.push(BlockLeftOut { start, errors: precision.solve(&self.weights.rows(start, len)), precision });
        }
        left_out.reverse();
        Some(left_out)
    }

    /// Returns the rows of the upper triangle W, one after the other: |W k|² is the fraction of the prior variance that all rows explain if
    /// their kernels are projected onto those of the inducing rows, k (Nyström).
    pub(crate) fn explained(&self, inducing: &[usize]) -> Option<Vec<f64>> {
        let m = inducing.len();
        let mut kernel = self.kernel.clone();
        kernel.fill_upper_triangle_with_lower_triangle();
        let with_inducing = kernel.select_columns(inducing);
        let among = with_inducing.select_rows(inducing) + DMatrix::identity(m, m) * JITTER * 1e-2;
        // Kernels of all rows as weighted sums of those of the inducing rows.
        let projection = cholesky(among)?.solve(&with_inducing.transpose()).transpose();
        let triangle = self.covariance.l_dirty().solve_lower_triangular(&projection)?.qr().r();
        Some((0..m).flat_map(|i| (i..m).map(move |j| (i, j))).map(|place| triangle[place]).collect())
    }
}

/// Returns the kernels between rows.
pub(super) fn kernel_of(rows: &[Vec<f64>], settings: &Settings) -> DMatrix<f64> {
    let inputs: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    let training = TrainingSet { inputs: &inputs, targets: &[], time_s: &[] };
    let mut kernel = training.kernel(&training.half_squares(&settings.lengths));
    kernel.fill_upper_triangle_with_lower_triangle();
    kernel
}

/// Builds the lower triangle of an n × n matrix, with zeros above it.
pub(super) fn lower_triangle(n: usize, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n, n);
    for (j, mut column) in matrix.column_iter_mut().enumerate() {
        column.iter_mut().enumerate().skip(j).for_each(|(i, to)| *to = entry(i, j));
    }
    matrix
}

/// Selects the rows that carry most information on all others, by a pivoted Cholesky decomposition of a kernel (Fine & Scheinberg, *J.
/// Mach. Learn. Res.* 2 (2001) 243): at most `most` rows, fewer if the others add no information.
pub(crate) fn inducing_rows(kernel: &DMatrix<f64>, most: usize) -> Vec<usize> {
    let n = kernel.nrows();
    let mut left = kernel.diagonal();
    let smallest = SMALLEST_PIVOT * left.max();
    let mut columns: Vec<DVector<f64>> = Vec::new();
    let mut chosen = Vec::new();
    while chosen.len() < most.min(n) {
        let pivot = left.imax();
        if !(left[pivot] > smallest) {
            break;
        }
        let mut column = kernel.column(pivot).into_owned();
        for earlier in &columns {
            column.axpy(-earlier[pivot], earlier, 1.0);
        }
        column /= left[pivot].sqrt();
        left.zip_apply(&column, |left, entry| *left -= entry * entry);
        left[pivot] = 0.0;
        chosen.push(pivot);
        columns.push(column);
    }
    chosen
}
