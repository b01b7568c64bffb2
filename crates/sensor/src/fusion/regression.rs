use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::combine::Member;
use super::params::{FusionRow, RegressionParams};

/// Prior standard deviation of the strain, as a fraction of its range, wide enough for any strain within it.
pub const PRIOR_SD: f64 = 0.4;

/// ln R/R₀ of all channels at one time, and its low-passes.
#[derive(Clone, Copy)]
pub struct FusionReadings<'a> {
    /// ln R/R₀ of each channel; NaN for a channel that is not used.
    pub ln_r: &'a [f64],
    /// Low-passes of ln R/R₀: one list of channels for each time constant.
    pub low_passed: &'a [Vec<f64>],
}

impl<'a> From<&'a FusionRow> for FusionReadings<'a> {
    fn from(row: &'a FusionRow) -> Self {
        Self { ln_r: &row.ln_r, low_passed: &row.low_passed }
    }
}

/// Mean and inverse standard deviation of each input.
type Scale = Vec<(f64, f64)>;

/// Gaussian process of the strain on a subset of the channels, conditioned on rows of the calibration. Its kernel is the sum of a
/// squared exponential and a linear one.
///
/// Source: C. E. Rasmussen, C. K. I. Williams, *Gaussian Processes for Machine Learning* (2006), algorithm 2.1.
#[derive(Clone, Debug)]
pub struct Regression {
    channels: Vec<usize>,
    params: RegressionParams,
    /// Range of the strain.
    span: f64,
    mean_strain: f64,
    scale: Scale,
    /// Inputs of each row, scaled.
    inputs: Vec<Vec<f64>>,
    factor: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
    /// Variance of errors beyond the stated one, in squares of the strain's range.
    unstated: f64,
}

impl Regression {
    /// Conditions a process on `channels` on rows; `None` if there are no rows or no channels, or the matrix is not positive
    /// definite.
    #[must_use]
    pub fn new(rows: &[&FusionRow], params: &RegressionParams, channels: &[usize], span: f64) -> Option<Self> {
        if channels.is_empty() {
            return None;
        }
        let (scale, inputs) = scaled_inputs(rows.iter().copied(), params, channels)?;
        let mean_strain = rows.iter().map(|row| row.strain).sum::<f64>() / rows.len() as f64;
        let noise = params.noise * params.noise;
        let covariance = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            kernel(&inputs[i], &inputs[j], params.length) + if i == j { noise } else { 0.0 }
        });
        let factor = covariance.cholesky()?;
        let targets = DVector::from_iterator(rows.len(), rows.iter().map(|row| (row.strain - mean_strain) / span));
        let weights = factor.solve(&targets);
        Some(Self {
            channels: channels.to_vec(),
            params: params.clone(),
            span,
            mean_strain,
            scale,
            inputs,
            factor,
            weights,
            unstated: 0.0,
        })
    }

    /// Returns the mean square error of rows left out one by one beyond the variance that is stated for them, in squares of the strain's
    /// range; negative if they are stated too uncertain.
    ///
    /// Source: Rasmussen and Williams, equations 5.10 to 5.12.
    #[must_use]
    pub fn excess(&self) -> f64 {
        let inverse = self.factor.inverse();
        let of_row = |row: usize| {
            let variance = inverse[(row, row)].recip();
            (self.weights[row] * variance).powi(2) - variance
        };
        (0..self.inputs.len()).map(of_row).sum::<f64>() / self.inputs.len() as f64
    }

    /// Adds a variance in squares of the strain's range; a negative one counts as none.
    #[must_use]
    pub fn with_unstated(self, variance: f64) -> Self {
        Self { unstated: variance.max(0.0), ..self }
    }

    /// Returns the strain; its standard deviation includes the noise.
    #[must_use]
    pub fn strain(&self, seen: FusionReadings) -> Member {
        let input = scaled(raw_inputs(&self.params, &self.channels, seen), &self.scale);
        let of_row = |row: &Vec<f64>| kernel(&input, row, self.params.length);
        let mut covariance = DVector::from_iterator(self.inputs.len(), self.inputs.iter().map(of_row));
        let mean = covariance.dot(&self.weights);
        self.factor.l_dirty().solve_lower_triangular_mut(&mut covariance);
        let prior = kernel(&input, &input, self.params.length);
        // Rounding may make the variance negative.
        let variance =
            (prior - covariance.norm_squared()).max(0.0) + self.params.noise * self.params.noise + self.unstated;
        Member { strain: self.mean_strain + mean * self.span, sd: variance.sqrt() * self.span }
    }
}

/// Scales the inputs of rows. Returns the mean and inverse standard deviation of each input, and the scaled inputs of each row;
/// `None` without a row.
#[must_use]
pub fn scaled_inputs<'a>(
    rows: impl IntoIterator<Item = &'a FusionRow>,
    params: &RegressionParams,
    channels: &[usize],
) -> Option<(Scale, Vec<Vec<f64>>)> {
    let of_row = |row: &FusionRow| raw_inputs(params, channels, FusionReadings::from(row)).collect::<Vec<f64>>();
    let raw: Vec<Vec<f64>> = rows.into_iter().map(of_row).collect();
    let scale: Scale = (0..raw.first()?.len()).map(|input| location(&raw, input)).collect();
    let inputs = raw.iter().map(|row| scaled(row.iter().copied(), &scale)).collect();
    Some((scale, inputs))
}

/// Returns the inputs of a row: ln R of each channel and, for each low-pass, the difference of ln R from it.
fn raw_inputs<'a>(
    params: &'a RegressionParams,
    channels: &'a [usize],
    seen: FusionReadings<'a>,
) -> impl Iterator<Item = f64> + 'a {
    let above = move |low_passed: &'a [f64]| channels.iter().map(move |&c| seen.ln_r[c] - low_passed[c]);
    let readings = channels.iter().map(move |&c| seen.ln_r[c]);
    readings.chain(params.low_passes.iter().flat_map(move |&index| above(&seen.low_passed[index])))
}

/// Returns the mean and inverse standard deviation of an input. The latter is zero for a constant input, which then has
/// no effect.
fn location(rows: &[Vec<f64>], input: usize) -> (f64, f64) {
    let n = rows.len() as f64;
    let mean = rows.iter().map(|row| row[input]).sum::<f64>() / n;
    let sd = (rows.iter().map(|row| (row[input] - mean).powi(2)).sum::<f64>() / n).sqrt();
    (mean, if sd > 1e-9 { 1.0 / sd } else { 0.0 })
}

fn scaled(raw: impl Iterator<Item = f64>, scale: &[(f64, f64)]) -> Vec<f64> {
    raw.zip(scale).map(|(value, (mean, per_sd))| (value - mean) * per_sd).collect()
}

fn kernel(a: &[f64], b: &[f64], length: f64) -> f64 {
    let (mut squared, mut product) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        squared += (a - b) * (a - b);
        product += a * b;
    }
    PRIOR_SD * PRIOR_SD * ((-0.5 * squared / (length * length)).exp() + product / a.len() as f64)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{FusionReadings, FusionRow, PRIOR_SD, Regression, RegressionParams};

    fn row(strain: f64, first: f64, second: f64) -> FusionRow {
        FusionRow { strain, ln_r: vec![first, second], low_passed: vec![vec![0.5 * first, 0.9 * second]] }
    }

    /// The same from the textbook's equations 2.25 and 2.26 with an inverse, the inputs scaled by hand.
    #[test]
    fn a_process_is_that_of_the_textbook() {
        let rows =
            [row(0.0, 0.0, 0.1), row(0.1, 0.3, 0.2), row(0.2, 0.5, 0.6), row(0.3, 0.9, 0.7), row(0.15, 0.4, 0.5)];
        let params = RegressionParams { low_passes: vec![0], length: 1.5, noise: 0.05 };
        let all: Vec<&FusionRow> = rows.iter().collect();
        let regression = Regression::new(&all, &params, &[0, 1], 0.3).unwrap();
        let inputs = |row: &FusionRow| {
            let [a, b] = [row.ln_r[0], row.ln_r[1]];
            [a, b, a - row.low_passed[0][0], b - row.low_passed[0][1]]
        };
        let raw: Vec<[f64; 4]> = rows.iter().map(inputs).collect();
        let mean: Vec<f64> = (0..4).map(|i| raw.iter().map(|x| x[i]).sum::<f64>() / 5.0).collect();
        let sd: Vec<f64> =
            (0..4).map(|i| (raw.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f64>() / 5.0).sqrt()).collect();
        let scaled = |x: &[f64; 4]| -> Vec<f64> { (0..4).map(|i| (x[i] - mean[i]) / sd[i]).collect() };
        let kernel = |a: &[f64], b: &[f64]| {
            let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
            let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
            0.16 * ((-squared / 4.5).exp() + product / 4.0)
        };
        let x: Vec<Vec<f64>> = raw.iter().map(scaled).collect();
        let noisy = DMatrix::from_fn(5, 5, |i, j| kernel(&x[i], &x[j]) + if i == j { 0.0025 } else { 0.0 });
        let inverse = noisy.clone().try_inverse().unwrap();
        let mean_strain = rows.iter().map(|row| row.strain).sum::<f64>() / 5.0;
        let targets = DVector::from_iterator(5, rows.iter().map(|row| (row.strain - mean_strain) / 0.3));
        let new = row(0.0, 0.7, 0.4);
        let at = scaled(&inputs(&new));
        let k = DVector::from_iterator(5, x.iter().map(|row| kernel(row, &at)));
        let expected = mean_strain + 0.3 * (k.transpose() * &inverse * &targets)[0];
        let variance = kernel(&at, &at) - (k.transpose() * &inverse * &k)[0] + 0.0025;
        let found = regression.strain(FusionReadings::from(&new));
        // The inverse of a matrix whose condition is below 1e4 loses four digits of sixteen.
        assert!((found.strain - expected).abs() < 1e-11, "{found:?} {expected}");
        assert!((found.sd - 0.3 * variance.sqrt()).abs() < 1e-11, "{found:?}");
        // Each row from the others.
        let of_row = |left: usize| {
            let others = noisy.clone().remove_row(left).remove_column(left).try_inverse().unwrap();
            let k = noisy.column(left).remove_row(left);
            let predicted = (k.transpose() * &others * targets.clone().remove_row(left))[0];
            let variance = noisy[(left, left)] - (k.transpose() * &others * &k)[0];
            (targets[left] - predicted).powi(2) - variance
        };
        let excess = (0..5).map(of_row).sum::<f64>() / 5.0;
        assert!((regression.excess() - excess).abs() < 1e-11, "{} {excess}", regression.excess());
    }

    /// Far from all rows, in a direction in which no two rows differ, the strain is as uncertain as before, or more.
    #[test]
    fn what_no_row_has_shown_is_unknown() {
        let rows: Vec<FusionRow> =
            (0..20).map(|k| row(0.015 * f64::from(k), 0.05 * f64::from(k), 0.06 * f64::from(k % 7))).collect();
        let all: Vec<&FusionRow> = rows.iter().collect();
        let params = RegressionParams { low_passes: vec![0], length: 1.0, noise: 0.01 };
        let regression = Regression::new(&all, &params, &[0, 1], 0.3).unwrap();
        let near = regression.strain(FusionReadings::from(&rows[7]));
        let far = regression.strain(FusionReadings::from(&row(0.0, 0.5, 30.0)));
        assert!(near.sd < 0.05 * 0.3 && far.sd > PRIOR_SD * 0.3, "{near:?} {far:?}");
    }

    #[test]
    fn no_channel_tells_nothing() {
        let params = RegressionParams { low_passes: vec![], length: 1.0, noise: 0.01 };
        assert!(Regression::new(&[&row(0.1, 0.1, 0.1)], &params, &[], 0.3).is_none());
        assert!(Regression::new(&[], &params, &[0], 0.3).is_none());
    }
}
