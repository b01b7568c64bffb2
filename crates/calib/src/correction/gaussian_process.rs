use crate::params::correction::ProcessParams;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use ohmstrain_ekf::correction::kernel;

/// White noise beside the noise that is correlated in time, as a share of its variance.
const WHITE: f64 = 0.09;
/// Variance that keeps the equations regular, in variances of the targets.
const JITTER: f64 = 1e-6;
/// A pivot of the inducing rows below this share of the prior variance says nothing new.
const SMALLEST_PIVOT: f64 = 1e-6;

/// Length scales, of all inputs alike, noises and correlation times tried: coarse, since the marginal likelihood of a few
/// hundred rows whose errors hang together tells no more.
const LENGTHS: [f64; 3] = [2.0, 4.0, 8.0];
const NOISES: [f64; 3] = [0.03, 0.1, 0.3];
const NOISE_TIMES_S: [f64; 2] = [2.0, 10.0];
/// After that each input but the first, on which the linear part of the kernel depends, finds a length scale of its own, in
/// steps of this factor, in turn, and once again.
const STRETCH: f64 = 2.0;
const TURNS: usize = 2;
/// Prior of a length scale over that of all inputs: log-normal, with this factor for a standard deviation; and its limits.
const SPREAD: f64 = 2.0;
const LEAST_STRETCH: f64 = 0.25;
const MOST_STRETCH: f64 = 8.0;

/// Rows to learn from: standardised inputs, targets, times.
#[derive(Clone, Copy)]
pub(crate) struct Lessons<'a> {
    pub inputs: &'a [&'a [f64]],
    pub targets: &'a [f64],
    pub time_s: &'a [f64],
}

/// A Gaussian process conditioned on rows.
pub(crate) struct GaussianProcess {
    /// Mean and standard deviation of the targets.
    pub centre: f64,
    pub size: f64,
    /// Prior variance where the kernel is 1, in variances of the targets: the one that explains them best.
    pub scale: f64,
    /// Variance of the noise, in those of the prior.
    pub noise: f64,
    kernel: DMatrix<f64>,
    covariance: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
    targets: DVector<f64>,
}

/// What is said of a row by the process without the row's block, in the unit of the target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeftOutRow {
    pub mean: f64,
    /// Share of the prior variance that is unknown.
    pub unknown: f64,
    /// Prior variance.
    pub prior: f64,
}

impl Lessons<'_> {
    /// The settings with the largest marginal likelihood, times the prior of the length scales; none if no covariance is
    /// positive definite.
    pub(crate) fn best_settings(self) -> Option<ProcessParams> {
        self.alike().map(|(cost, params)| self.with_relevance(cost, params))
    }

    /// With one length scale of all inputs.
    fn alike(self) -> Option<(f64, ProcessParams)> {
        let inputs = self.inputs.first()?.len();
        let squares = self.half_squares(&vec![1.0; inputs]);
        let mut best: Option<(f64, ProcessParams)> = None;
        for length in LENGTHS {
            let sums = &squares / (length * length);
            for noise in NOISES {
                for noise_time_s in NOISE_TIMES_S {
                    let lengths = vec![length; inputs];
                    let params = ProcessParams { lengths, noise, noise_time_s, sd_scale: 1.0 };
                    let Some(cost) = self.cost(&sums, &params) else { continue };
                    if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                        best = Some((cost, params));
                    }
                }
            }
        }
        best
    }

    /// Automatic relevance determination (Neal, *Bayesian Learning for Neural Networks*, 1996): inputs that tell little get long
    /// length scales. Coordinates in turn, since a step of one is all that a few hundred rows can tell.
    fn with_relevance(self, cost: f64, params: ProcessParams) -> ProcessParams {
        let inputs = params.lengths.len();
        let mut search = RelevanceSearch { lessons: self, sums: self.half_squares(&params.lengths), params, cost };
        for input in (1..inputs).cycle().take(TURNS * (inputs - 1)) {
            // Shorter for as long as it pays; if it does not at all, longer.
            let shorter = (0..).take_while(|_| search.step(input, 1.0 / STRETCH)).count();
            while shorter == 0 && search.step(input, STRETCH) {}
        }
        search.params
    }

    /// The negative logarithm of the marginal likelihood, up to a constant.
    fn cost(self, sums: &DMatrix<f64>, params: &ProcessParams) -> Option<f64> {
        GaussianProcess::with_sums(self, sums, params).map(|process| process.negative_log_evidence())
    }

    /// `Σ (xᵢ - xᵢ')²/2ℓᵢ²` for all pairs of rows.
    fn half_squares(self, lengths: &[f64]) -> DMatrix<f64> {
        let relevance: Vec<f64> = lengths.iter().map(|length| relevance(*length)).collect();
        let apart = |(a, b): (&f64, &f64)| (a - b).powi(2);
        let sum = |i: usize, j: usize| {
            let squares = self.inputs[i].iter().zip(self.inputs[j]).map(apart);
            squares.zip(&relevance).map(|(square, relevance)| square * relevance).sum()
        };
        symmetric(self.inputs.len(), sum)
    }

    /// The same with another length scale of one input.
    fn stretched(self, sums: &DMatrix<f64>, input: usize, from: f64, to: f64) -> DMatrix<f64> {
        let change = relevance(to) - relevance(from);
        let apart = |i: usize, j: usize| self.inputs[i][input] - self.inputs[j][input];
        symmetric(self.inputs.len(), |i, j| sums[(i, j)] + change * apart(i, j).powi(2))
    }
}

/// Settings on the way to better ones.
struct RelevanceSearch<'a> {
    lessons: Lessons<'a>,
    params: ProcessParams,
    /// `Σ (xᵢ - xᵢ')²/2ℓᵢ²` for all pairs of rows.
    sums: DMatrix<f64>,
    /// Negative logarithm of marginal likelihood and prior.
    cost: f64,
}

impl RelevanceSearch<'_> {
    /// Multiplies the length scale of an input, if that is better.
    fn step(&mut self, input: usize, factor: f64) -> bool {
        let (now, alike) = (self.params.lengths[input], self.params.lengths[0]);
        let trial = factor * now;
        if !(LEAST_STRETCH * alike..=MOST_STRETCH * alike).contains(&trial) {
            return false;
        }
        let sums = self.lessons.stretched(&self.sums, input, now, trial);
        self.params.lengths[input] = trial;
        let prior = |length: &f64| 0.5 * ((length / alike).ln() / SPREAD.ln()).powi(2);
        let priors: f64 = self.params.lengths.iter().map(prior).sum();
        let cost = self.lessons.cost(&sums, &self.params).map_or(f64::INFINITY, |cost| cost + priors);
        let is_better = cost < self.cost;
        if is_better {
            (self.cost, self.sums) = (cost, sums);
        } else {
            self.params.lengths[input] = now;
        }
        is_better
    }
}

/// What an input counts in the kernel, 1/2ℓ².
pub(crate) fn relevance(length: f64) -> f64 {
    0.5 / (length * length)
}

impl GaussianProcess {
    /// Conditions a process on rows; none if its covariance is not positive definite.
    pub(crate) fn new(lessons: Lessons, params: &ProcessParams) -> Option<Self> {
        Self::with_sums(lessons, &lessons.half_squares(&params.lengths), params)
    }

    fn with_sums(lessons: Lessons, sums: &DMatrix<f64>, params: &ProcessParams) -> Option<Self> {
        let Lessons { inputs, targets, time_s } = lessons;
        let n = targets.len();
        let centre = targets.iter().sum::<f64>() / n as f64;
        let size = (targets.iter().map(|y| (y - centre).powi(2)).sum::<f64>() / n as f64).sqrt().max(f64::MIN_POSITIVE);
        let targets = DVector::from_iterator(n, targets.iter().map(|y| (y - centre) / size));
        let kernel = symmetric(n, |i, j| kernel(sums[(i, j)], inputs[i][0] * inputs[j][0]));
        let covariance = (&kernel + noise_covariance(time_s, params)).cholesky()?;
        let weights = covariance.solve(&targets);
        let scale = targets.dot(&weights) / n as f64;
        let noise = (1.0 + WHITE) * params.noise.powi(2);
        Some(Self { centre, size, scale, noise, kernel, covariance, weights, targets })
    }

    /// Up to a constant, with the scale that makes it least.
    fn negative_log_evidence(&self) -> f64 {
        let n = self.targets.len() as f64;
        let half_log_determinant: f64 = self.covariance.l_dirty().diagonal().iter().map(|pivot| pivot.ln()).sum();
        0.5 * n * self.scale.ln() + half_log_determinant
    }

    /// Weights of the rows, in the unit of the targets.
    pub(crate) fn weights(&self) -> impl Iterator<Item = f64> {
        self.weights.iter().map(|weight| weight * self.size)
    }

    /// Variance for which the kernel 1 stands, in the squared unit of the targets.
    pub(crate) fn variance(&self) -> f64 {
        self.scale * self.size * self.size
    }

    /// Kernels of the rows with each other.
    pub(crate) fn kernel(&self) -> &DMatrix<f64> {
        &self.kernel
    }

    /// What the process says of every row without the row's block, in closed form from the inverse covariance (Rasmussen &
    /// Williams, *Gaussian Processes for Machine Learning*, 2006, eq. 5.12, for blocks). Blocks are of rows in order.
    pub(crate) fn left_out(&self, blocks: usize) -> Option<Vec<LeftOutRow>> {
        let n = self.targets.len();
        let inverse = self.covariance.inverse();
        let mut rows = Vec::with_capacity(n);
        for block in 0..blocks {
            let (start, end) = (block * n / blocks, (block + 1) * n / blocks);
            let len = end - start;
            let conditional = inverse.view((start, start), (len, len)).into_owned().cholesky()?.inverse();
            let errors = &conditional * self.weights.rows(start, len);
            for k in 0..len {
                let prior = self.kernel[(start + k, start + k)];
                rows.push(LeftOutRow {
                    mean: self.centre + self.size * (self.targets[start + k] - errors[k]),
                    unknown: ((conditional[(k, k)] - self.noise - JITTER) / prior).clamp(0.0, 1.0),
                    prior: prior * self.variance(),
                });
            }
        }
        Some(rows)
    }

    /// The upper triangle, row by row, of W: |W k|² is the share of the prior variance that all rows explain where their
    /// kernels are projected onto those of these inducing rows, k (Nyström).
    pub(crate) fn explained(&self, inducing: &[usize]) -> Option<Vec<f64>> {
        let m = inducing.len();
        let with_inducing = self.kernel.select_columns(inducing);
        let among = with_inducing.select_rows(inducing) + DMatrix::identity(m, m) * JITTER * 1e-2;
        // Kernels of all rows as weighted sums of those of the inducing rows.
        let projection = among.cholesky()?.solve(&with_inducing.transpose()).transpose();
        let triangle = self.covariance.l_dirty().solve_lower_triangular(&projection)?.qr().r();
        Some((0..m).flat_map(|i| (i..m).map(move |j| (i, j))).map(|place| triangle[place]).collect())
    }
}

/// Covariance of the noise, in variances of the targets.
fn noise_covariance(time_s: &[f64], params: &ProcessParams) -> DMatrix<f64> {
    let variance = params.noise.powi(2);
    symmetric(time_s.len(), |i, j| {
        let white = if i == j { WHITE * variance + JITTER } else { 0.0 };
        variance * (-(time_s[i] - time_s[j]).abs() / params.noise_time_s).exp() + white
    })
}

/// A symmetric matrix; `entry` is asked for those of the lower triangle.
fn symmetric(n: usize, entry: impl Fn(usize, usize) -> f64) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n, n);
    for j in 0..n {
        for i in j..n {
            matrix[(i, j)] = entry(i, j);
        }
    }
    matrix.fill_upper_triangle_with_lower_triangle();
    matrix
}

/// The rows that say most about all others, by a pivoted Cholesky decomposition of a kernel (Fine & Scheinberg, *J. Mach.
/// Learn. Res.* 2 (2001) 243): at most `most`, fewer if the others add nothing.
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
