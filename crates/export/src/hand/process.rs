//! A regression of the fusion for a microcontroller: a Gaussian process on a few inducing rows.

use nalgebra::{Cholesky, DMatrix, DVector, RealField};
use ohmstrain_sensor::fusion::{FusionParams, PRIOR_SD, RegressionParams, scaled_inputs};
use serde::Serialize;

/// Largest number of inducing rows.
const MOST_INDUCING: usize = 96;
/// Share of the noise variance below which the rest of the rows adds nothing: no further row is taken.
const EXPLAINED: f64 = 0.01;

/// A Gaussian process of the strain, as a share of its range, on all channels and these inducing rows.
///
/// With k the kernel between an input and the inducing rows, φ = L⁻¹ k are features whose weights have a standard normal prior;
/// all rows of the fusion determine their posterior, of mean w and covariance σ² A⁻¹, A = Φ Φᵀ + σ² I. What the features do not
/// explain of the prior variance stays in the variance of the strain.
///
/// Source: J. Quiñonero-Candela, C. E. Rasmussen, A unifying view of sparse approximate Gaussian process regression, *JMLR* 6 (2005)
/// 1939–1959, equation 20 (deterministic training conditional).
#[derive(Clone, Debug, Serialize)]
pub struct Process<T> {
    /// Indices of the low-passes that it sees.
    pub low_passes: Vec<usize>,
    /// Mean and inverse standard deviation of each input.
    pub mean: Vec<T>,
    pub per_sd: Vec<T>,
    /// Scaled inputs of each inducing row.
    pub rows: Vec<Vec<T>>,
    /// L, row by row; the diagonal is inverted.
    pub factor: Vec<Vec<T>>,
    /// w.
    pub weights: Vec<T>,
    /// σ C⁻¹ with A = C Cᵀ, row by row.
    pub spread: Vec<Vec<T>>,
    /// 1 / 2 l² of the squared exponential.
    pub per_length: T,
    /// σ².
    pub noise_variance: T,
    /// Mean of the strain.
    pub mean_strain: T,
}

/// Returns the inputs of a row: ln R of each channel and, for each low-pass, the difference of ln R from it.
fn inputs<T: RealField + Copy>(low_passes: &[usize], ln_r: &[T], low_passed: &[Vec<T>]) -> Vec<T> {
    let above =
        |index: &usize| ln_r.iter().zip(&low_passed[*index]).map(|(value, low)| *value - *low).collect::<Vec<T>>();
    ln_r.iter().copied().chain(low_passes.iter().flat_map(above)).collect()
}

/// Returns the kernel, a squared exponential and a linear one.
fn kernel<T: RealField + Copy>(a: &[T], b: &[T], per_length: T) -> T {
    let (mut squared, mut product) = (T::zero(), T::zero());
    for (a, b) in a.iter().zip(b) {
        squared += (*a - *b) * (*a - *b);
        product += *a * *b;
    }
    let prior: T = nalgebra::convert(PRIOR_SD * PRIOR_SD);
    let count: T = nalgebra::convert(a.len() as f64);
    prior * ((-(squared * per_length)).exp() + product / count)
}

impl Process<f64> {
    /// Conditions a process on the rows of a fusion; `None` if a matrix is not positive definite.
    pub fn new(params: &FusionParams, regression: &RegressionParams) -> Option<Self> {
        let channels: Vec<usize> = (0..params.channels()).collect();
        let (scale, all) = scaled_inputs(&params.rows, regression, &channels)?;
        let (mean, per_sd): (Vec<f64>, Vec<f64>) = scale.into_iter().unzip();
        let per_length = 0.5 / (regression.length * regression.length);
        let noise_variance = regression.noise * regression.noise;
        let (chosen, features) = pivoted(&all, per_length, EXPLAINED * noise_variance);
        let rows: Vec<Vec<f64>> = chosen.iter().map(|row| all[*row].clone()).collect();
        // Features of all rows, a row for each inducing one: Φ.
        let mut posterior = &features * features.transpose();
        (0..rows.len()).for_each(|i| posterior[(i, i)] += noise_variance);
        let cholesky = Cholesky::new(posterior)?;
        let span = params.limits.span();
        let mean_strain = params.rows.iter().map(|row| row.strain).sum::<f64>() / params.rows.len() as f64;
        let targets =
            DVector::from_iterator(all.len(), params.rows.iter().map(|row| (row.strain - mean_strain) / span));
        let weights = cholesky.solve(&(&features * targets));
        let spread = cholesky.l().try_inverse()? * regression.noise;
        let lower = |matrix: &DMatrix<f64>, i: usize| (0..=i).map(|j| matrix[(i, j)]).collect::<Vec<f64>>();
        let factor = |i: usize| {
            let mut row: Vec<f64> = (0..=i).map(|j| features[(j, chosen[i])]).collect();
            row[i] = 1.0 / row[i];
            row
        };
        Some(Self {
            low_passes: regression.low_passes.clone(),
            factor: (0..rows.len()).map(factor).collect(),
            spread: (0..rows.len()).map(|i| lower(&spread, i)).collect(),
            weights: weights.iter().copied().collect(),
            mean,
            per_sd,
            rows,
            per_length,
            noise_variance,
            mean_strain,
        })
    }
}

/// Chooses inducing rows by a pivoted Cholesky decomposition of the kernel matrix: next is the row with the largest variance that those
/// before it do not explain, until none is above `least`. Returns the chosen rows, and the features of all rows.
fn pivoted(rows: &[Vec<f64>], per_length: f64, least: f64) -> (Vec<usize>, DMatrix<f64>) {
    let n = rows.len();
    let mut left: Vec<f64> = rows.iter().map(|row| kernel(row, row, per_length)).collect();
    let (mut chosen, mut features) = (Vec::new(), DMatrix::zeros(n.min(MOST_INDUCING), n));
    while chosen.len() < features.nrows() {
        let Some(next) = (0..n).max_by(|a, b| left[*a].total_cmp(&left[*b])).filter(|next| left[*next] > least) else {
            break;
        };
        let i = chosen.len();
        let diagonal = left[next].sqrt();
        for row in 0..n {
            let explained: f64 = (0..i).map(|j| features[(j, row)] * features[(j, next)]).sum();
            let feature = (kernel(&rows[row], &rows[next], per_length) - explained) / diagonal;
            features[(i, row)] = feature;
            left[row] -= feature * feature;
        }
        chosen.push(next);
    }
    let count = chosen.len();
    (chosen, features.resize_vertically(count, 0.0))
}

impl<T: RealField + Copy> Process<T> {
    /// Returns the strain and its variance, as shares of the range; the strain is relative to its mean.
    pub fn predict(&self, ln_r: &[T], low_passed: &[Vec<T>]) -> (T, T) {
        let raw = inputs(&self.low_passes, ln_r, low_passed);
        let input: Vec<T> = raw
            .iter()
            .zip(&self.mean)
            .zip(&self.per_sd)
            .map(|((value, mean), per_sd)| (*value - *mean) * *per_sd)
            .collect();
        let mut features: Vec<T> = Vec::with_capacity(self.rows.len());
        let (mut mean, mut variance) = (T::zero(), kernel(&input, &input, self.per_length));
        for (i, row) in self.rows.iter().enumerate() {
            let mut feature = kernel(&input, row, self.per_length);
            for (entry, before) in self.factor[i].iter().zip(&features) {
                feature -= *entry * *before;
            }
            feature *= self.factor[i][i];
            mean += self.weights[i] * feature;
            variance -= feature * feature;
            features.push(feature);
        }
        // Rounding may make it negative.
        if variance < T::zero() {
            variance = T::zero();
        }
        for row in &self.spread {
            let mut spread = T::zero();
            for (entry, feature) in row.iter().zip(&features) {
                spread += *entry * *feature;
            }
            variance += spread * spread;
        }
        (mean, variance + self.noise_variance)
    }

    /// Converts every number.
    pub fn map<U>(&self, convert: impl Fn(T) -> U + Copy) -> Process<U> {
        let list = |numbers: &[T]| numbers.iter().map(|number| convert(*number)).collect::<Vec<U>>();
        let table = |rows: &[Vec<T>]| rows.iter().map(|row| list(row)).collect::<Vec<Vec<U>>>();
        Process {
            low_passes: self.low_passes.clone(),
            mean: list(&self.mean),
            per_sd: list(&self.per_sd),
            rows: table(&self.rows),
            factor: table(&self.factor),
            weights: list(&self.weights),
            spread: table(&self.spread),
            per_length: convert(self.per_length),
            noise_variance: convert(self.noise_variance),
            mean_strain: convert(self.mean_strain),
        }
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_sensor::fusion::{FusionReadings, Regression};

    use super::Process;
    use crate::hand::tests::fusion;

    /// Fewer inducing rows than rows give nearly the process of the computer; single precision differs from double by rounding.
    #[test]
    fn inducing_rows_give_nearly_the_whole_process() {
        let params = fusion();
        let regression = &params.regressions[0];
        let rows: Vec<_> = params.rows.iter().collect();
        let whole = Regression::new(&rows, regression, &[0, 1, 2], params.limits.span()).unwrap();
        let sparse = Process::new(&params, regression).unwrap();
        let single = sparse.map(|number| number as f32);
        let mut largest = [0.0_f64; 3];
        for row in &params.rows {
            // Between the rows, where they are not what was learned.
            let ln_r: Vec<f64> = row.ln_r.iter().map(|value| 1.02 * value + 0.003).collect();
            let low_passed = &row.low_passed;
            let expected = whole.strain(FusionReadings { ln_r: &ln_r, low_passed });
            let (mean, variance) = sparse.predict(&ln_r, low_passed);
            let strain = params.limits.span() * (mean) + sparse.mean_strain;
            let sd = params.limits.span() * variance.sqrt();
            let to_single = |numbers: &[f64]| numbers.iter().map(|number| *number as f32).collect::<Vec<f32>>();
            let low_single: Vec<Vec<f32>> = low_passed.iter().map(|low| to_single(low)).collect();
            let (rounded, _) = single.predict(&to_single(&ln_r), &low_single);
            largest[0] = largest[0].max((strain - expected.strain).abs() / expected.sd);
            largest[1] = largest[1].max((sd / expected.sd - 1.0).abs());
            largest[2] = largest[2].max((f64::from(rounded) - mean).abs() / variance.sqrt());
        }
        // Rows that add less than a hundredth of the noise variance are left out, and the strain moves by less than a tenth of its
        // standard deviation.
        assert!(sparse.rows.len() < params.rows.len() && largest[0] < 0.1 && largest[1] < 0.1, "{largest:?}");
        // 1e-7 for each of a hundred products, times the condition of L, which is below 4 / 0.002.
        assert!(largest[2] < 0.02, "{largest:?}");
    }
}
