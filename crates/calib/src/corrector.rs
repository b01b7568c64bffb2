use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{Correction, INDUCING, InputScale, OUTPUTS, Process, mixture};

use crate::correction_params::CorrectorParams;
use crate::gaussian_process::{GaussianProcess, LeftOutRow, Lessons, ProcessParams, inducing_rows};
use crate::params::RangeParams;
use crate::portable::PortableProcess;
use crate::sd_scale::{joint_scale, sd_scale_up_to};

/// Blocks of rows that are left out in turn.
const BLOCKS: usize = 5;
/// Where nothing is known, the variance of the strain that the direct process leaves, and of the filter's error that the
/// residual process leaves, in variances of the strain. The targets' own variances, of a filter that has seen the rows,
/// promise too much for other motions.
const LEAST_DIRECT: f64 = 0.5;
const LEAST_RESIDUAL: f64 = 0.07;
/// Widest factor on a process' deviation: block left out of recordings that hold still for long are worlds of their own.
const WIDEST_PROCESS: f64 = 3.0;

/// What a corrector learns from: inputs with the filter's outputs first, the true strain, and times, s, row by row.
#[derive(Clone, Copy)]
pub(crate) struct Examples<'a, const D: usize> {
    pub inputs: &'a [[f64; D]],
    pub strain: &'a [f64],
    pub time_s: &'a [f64],
    pub limits: RangeParams,
}

/// A correction with everything that it is made of.
pub(crate) struct Corrector<const D: usize> {
    rows: Vec<[f64; D]>,
    scales: [InputScale<f64>; D],
    pub direct: PortableProcess,
    pub residual: PortableProcess,
    limits: RangeParams,
    strain_variance: f64,
    variance_factor: f64,
}

/// Examples on the scale that their inputs have, and the targets of both processes.
struct Prepared<const D: usize> {
    rows: Vec<[f64; D]>,
    scales: [InputScale<f64>; D],
    residuals: Vec<f64>,
    strain_variance: f64,
}

impl<const D: usize> Prepared<D> {
    fn new(examples: Examples<D>) -> Self {
        let scales: [InputScale<f64>; D] = std::array::from_fn(|i| scale(examples.inputs.iter().map(|row| row[i])));
        let standardised = |row: &[f64; D]| std::array::from_fn(|i| (row[i] - scales[i].mean) / scales[i].sd);
        Self {
            rows: examples.inputs.iter().map(standardised).collect(),
            scales,
            residuals: examples.inputs.iter().zip(examples.strain).map(|(row, strain)| strain - row[0]).collect(),
            strain_variance: scale(examples.strain.iter().copied()).sd.powi(2),
        }
    }

    /// Lets `learn` see the examples of the direct and of the residual process.
    fn taught<X>(&self, examples: Examples<D>, learn: impl Fn(Lessons, Which) -> Option<X>) -> Option<[X; 2]> {
        let time_s = examples.time_s;
        let features: Vec<&[f64]> = self.rows.iter().map(|row| &row[OUTPUTS..]).collect();
        let all: Vec<&[f64]> = self.rows.iter().map(<[f64; D]>::as_slice).collect();
        let direct = learn(Lessons { inputs: &features, targets: examples.strain, time_s }, Which::Direct)?;
        let residual = learn(Lessons { inputs: &all, targets: &self.residuals, time_s }, Which::Residual)?;
        Some([direct, residual])
    }

    fn least_variance(&self, which: Which) -> f64 {
        self.strain_variance * if which == Which::Direct { LEAST_DIRECT } else { LEAST_RESIDUAL }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Which {
    Direct,
    Residual,
}

/// Mean, deviation and range of values; a value that never changes tells nothing, however far from it another one is.
fn scale(values: impl Iterator<Item = f64> + Clone) -> InputScale<f64> {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let sd = (values.clone().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    let (lower, upper) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    InputScale { mean, sd: if upper > lower { sd } else { f64::INFINITY }, lower, upper }
}

impl CorrectorParams {
    /// Learns from examples; none if there is nothing to learn from them.
    pub(crate) fn fit<const D: usize>(examples: Examples<D>) -> Option<Self> {
        let prepared = Prepared::new(examples);
        let [direct, residual] = prepared.taught(examples, |lessons, which| {
            let settings = lessons.best_settings()?;
            let process = GaussianProcess::new(lessons, settings)?;
            let left_out = process.left_out(BLOCKS)?;
            let base = |k: usize| if which == Which::Direct { 0.0 } else { examples.inputs[k][0] };
            let least = prepared.least_variance(which);
            let said = |(k, row): (usize, &LeftOutRow)| {
                let variance = row.unknown * row.prior.max(least) + process.noise * process.variance();
                let mean = (base(k) + row.mean).clamp(examples.limits.lower, examples.limits.upper);
                Gaussian { mean, variance }
            };
            let said: Vec<Gaussian<f64>> = left_out.iter().enumerate().map(said).collect();
            let sd_scale = sd_scale_up_to(&deviations(&said, examples.strain), WIDEST_PROCESS);
            Some((ProcessParams { sd_scale, ..settings }, said))
        })?;
        let widened = |(params, said): &(ProcessParams, Vec<Gaussian<f64>>), k: usize| Gaussian {
            variance: said[k].variance * params.sd_scale.powi(2),
            ..said[k]
        };
        let mixed: Vec<Gaussian<f64>> =
            (0..examples.strain.len()).map(|k| mixture(widened(&direct, k), widened(&residual, k))).collect();
        let sd_scale = joint_scale(&deviations(&mixed, examples.strain).concat());
        Some(Self { sd_scale, direct: direct.0, residual: residual.0 })
    }
}

/// Errors in units of their deviations, block by block.
fn deviations(said: &[Gaussian<f64>], strain: &[f64]) -> Vec<Vec<f64>> {
    let n = said.len();
    let of_row = |k: usize| (said[k].mean - strain[k]).abs() / said[k].sd();
    (0..BLOCKS).map(|block| (block * n / BLOCKS..(block + 1) * n / BLOCKS).map(of_row).collect()).collect()
}

impl<const D: usize> Corrector<D> {
    /// Makes weights of examples; none if the covariances are not positive definite.
    pub(crate) fn new(params: &CorrectorParams, examples: Examples<D>) -> Option<Self> {
        let prepared = Prepared::new(examples);
        let settings = |which: Which| if which == Which::Direct { params.direct } else { params.residual };
        let kernels = prepared.taught(examples, |lessons, which| {
            GaussianProcess::new(lessons, settings(which)).map(|process| process.kernel().clone())
        })?;
        let inducing = inducing_rows(&(&kernels[0] + &kernels[1]), INDUCING);
        let order = inducing_first(&inducing, prepared.rows.len());
        let [direct, residual] = prepared.taught(examples, |lessons, which| {
            let settings = settings(which);
            let process = GaussianProcess::new(lessons, settings)?;
            let weights: Vec<f64> = process.weights().collect();
            Some(PortableProcess {
                length: settings.length,
                mean: process.centre,
                weights: order.iter().map(|&row| weights[row]).collect(),
                explained: process.explained(&inducing)?,
                variance: process.variance(),
                noise: process.noise * process.variance(),
                widening: settings.sd_scale.powi(2),
                least_variance: prepared.least_variance(which),
            })
        })?;
        Some(Self {
            rows: order.iter().map(|&row| prepared.rows[row]).collect(),
            scales: prepared.scales,
            direct,
            residual,
            limits: examples.limits,
            strain_variance: prepared.strain_variance,
            variance_factor: params.sd_scale.powi(2),
        })
    }

    /// As it runs.
    pub(crate) fn correction(&self) -> Correction<'_, f64, D> {
        Correction {
            rows: &self.rows,
            scales: &self.scales,
            direct: self.direct.process(),
            residual: self.residual.process(),
            limits: self.limits.to_model(),
            strain_variance: self.strain_variance,
            variance_factor: self.variance_factor,
        }
    }
}

impl PortableProcess {
    fn process(&self) -> Process<'_, f64> {
        Process {
            length: self.length,
            mean: self.mean,
            weights: &self.weights,
            explained: &self.explained,
            variance: self.variance,
            noise: self.noise,
            widening: self.widening,
            least_variance: self.least_variance,
        }
    }
}

/// All rows, these first.
fn inducing_first(inducing: &[usize], rows: usize) -> Vec<usize> {
    let others = (0..rows).filter(|row| !inducing.contains(row));
    inducing.iter().copied().chain(others).collect()
}

#[cfg(test)]
mod tests;
