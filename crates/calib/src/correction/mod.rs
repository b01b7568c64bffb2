//! The learned correction: choosing its processes, and making of a sensor's rows what `ohmstrain_ekf::correction` runs.

mod criterion;
mod gaussian_process;
pub(crate) mod owned;
mod settings;
pub(crate) mod simulated;

use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{
    FEATURES, FILTER_INPUTS, INDUCING, InputScale, OUTPUTS, Process, Triangle, consensus, mixture,
};
use owned::{OwnedCorrection, OwnedProcess};

use crate::order::extent;
use crate::params::RangeParams;
use crate::params::correction::{CorrectorParams, ProcessParams, SIDES, SMOOTHER_INPUTS, SimulatedParams};
use crate::sd_scale::{joint_scale_of, sd_scale_up_to};
use criterion::Criterion;
use gaussian_process::{GaussianProcess, LeftOutRow, Lessons, inducing_rows, relevance};

/// Blocks of rows that are left out in turn.
const BLOCKS: usize = 5;
/// Where nothing is known, the variance of the strain that the direct process leaves, and of the filter's error that the
/// residual process leaves, in variances of the strain. The targets' own variances, of a filter that has seen the rows,
/// promise too much for other motions.
const LEAST_DIRECT: f64 = 0.5;
const LEAST_RESIDUAL: f64 = 0.07;
/// Widest factor on a process' deviation: block left out of recordings that hold still for long are worlds of their own.
const WIDEST_PROCESS: f64 = 3.0;

/// What a correction learns from: inputs with the filter's outputs first, the true strain, and times, s, row by row.
#[derive(Clone, Copy)]
pub(crate) struct Examples<'a, const D: usize> {
    pub inputs: &'a [[f64; D]],
    pub strain: &'a [f64],
    pub time_s: &'a [f64],
    pub limits: RangeParams,
}

/// A process of a correction.
#[derive(Clone, Copy, PartialEq)]
enum Which {
    Direct,
    Past,
    Future,
    Residual,
}

/// How the processes of a corrector are chosen.
#[derive(Clone, Copy)]
struct Choosing {
    criterion: Criterion,
    /// Whether the factor on a process' deviation is the one that covers the worst block, or all of them together.
    covers_worst: bool,
}

impl Choosing {
    /// Factors weigh voices against each other; the mixture's own sees to its interval. Of a filter's two voices one is not to be
    /// silenced everywhere by a block that is a world of its own. A smoother has four, one of which is mostly better: there the
    /// caution pays.
    const fn of_sides(sides: usize) -> Self {
        let is_smoother = sides > 0;
        let criterion = if is_smoother { Criterion::LeftOut } else { Criterion::LeftOutAndEvidence };
        Self { criterion, covers_worst: is_smoother }
    }
}

/// Direct processes that see one side of time, in order.
const ONE_SIDED: [Which; SIDES] = [Which::Past, Which::Future];

impl Which {
    /// Which of so many inputs it sees.
    fn places(self, inputs: usize) -> Vec<usize> {
        match self {
            Which::Direct => (OUTPUTS..inputs).collect(),
            Which::Past => (OUTPUTS..OUTPUTS + FEATURES).collect(),
            Which::Future => std::iter::once(OUTPUTS).chain(OUTPUTS + FEATURES..inputs).collect(),
            Which::Residual => (0..inputs).collect(),
        }
    }

    const fn least_variance(self) -> f64 {
        match self {
            Which::Residual => LEAST_RESIDUAL,
            _ => LEAST_DIRECT,
        }
    }

    fn params(self, of: &CorrectorParams) -> Option<&ProcessParams> {
        match self {
            Which::Direct => Some(&of.direct),
            Which::Past => of.one_sided.first(),
            Which::Future => of.one_sided.get(1),
            Which::Residual => Some(&of.residual),
        }
    }
}

/// Examples on the scale that their inputs have.
struct Prepared<'a, const D: usize> {
    examples: Examples<'a, D>,
    rows: Vec<[f64; D]>,
    scales: [InputScale<f64>; D],
    strain_variance: f64,
}

impl<'a, const D: usize> Prepared<'a, D> {
    fn new(examples: Examples<'a, D>) -> Self {
        let scales: [InputScale<f64>; D] = std::array::from_fn(|i| scale(examples.inputs.iter().map(|row| row[i])));
        let strain_variance = scale(examples.strain.iter().copied()).sd.powi(2);
        let prepared = Self { examples, rows: vec![], scales, strain_variance };
        Self { rows: examples.inputs.iter().map(|row| prepared.on_scale(row)).collect(), ..prepared }
    }

    fn on_scale(&self, row: &[f64; D]) -> [f64; D] {
        std::array::from_fn(|i| (row[i] - self.scales[i].mean) / self.scales[i].sd)
    }

    /// What a process adds its mean to.
    fn base(&self, which: Which, row: usize) -> f64 {
        if which == Which::Residual { self.examples.inputs[row][0] } else { 0.0 }
    }

    fn least_variance(&self, which: Which) -> f64 {
        self.strain_variance * which.least_variance()
    }

    /// Lets `learn` see the examples of a process.
    fn taught<X>(&self, which: Which, learn: impl Fn(Lessons) -> Option<X>) -> Option<X> {
        let places = which.places(D);
        let seen = |row: &[f64; D]| places.iter().map(|&i| row[i]).collect();
        let inputs: Vec<Vec<f64>> = self.rows.iter().map(seen).collect();
        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let target = |(row, strain): (usize, &f64)| strain - self.base(which, row);
        let targets: Vec<f64> = self.examples.strain.iter().enumerate().map(target).collect();
        learn(Lessons { inputs: &inputs, targets: &targets, time_s: self.examples.time_s })
    }

    /// Chooses a process.
    fn chosen(&self, which: Which, by: Choosing) -> Option<ProcessParams> {
        let settings = self.taught(which, |lessons| lessons.best_settings(by.criterion))?;
        let blocks = deviations(&self.left_out(which, &settings)?, self.examples.strain);
        let blocks = if by.covers_worst { blocks } else { vec![blocks.concat()] };
        Some(ProcessParams { sd_scale: sd_scale_up_to(&blocks, WIDEST_PROCESS), ..settings })
    }

    /// What a process says of every row from the blocks that the row is not in.
    fn left_out(&self, which: Which, settings: &ProcessParams) -> Option<Vec<Gaussian<f64>>> {
        self.taught(which, |lessons| {
            let process = GaussianProcess::new(lessons, settings)?;
            let (limits, least) = (self.examples.limits, self.least_variance(which));
            let said = |(k, row): (usize, LeftOutRow)| {
                let variance = row.unknown * row.prior.max(least) + process.noise * process.variance();
                let mean = (self.base(which, k) + row.mean).clamp(limits.lower, limits.upper);
                Gaussian { mean, variance: variance * settings.sd_scale.powi(2) }
            };
            Some(process.left_out(BLOCKS)?.into_iter().enumerate().map(said).collect())
        })
    }
}

/// Mean, deviation and range of values; a value that never changes tells nothing, however far from it another one is.
fn scale(values: impl Iterator<Item = f64> + Clone) -> InputScale<f64> {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let sd = (values.clone().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    let (lower, upper) = extent(values);
    InputScale { mean, sd: if upper > lower { sd } else { f64::INFINITY }, lower, upper }
}

impl CorrectorParams {
    /// What corrects a filter, from examples, beside what simulated rows say; none if there is nothing to learn from them.
    pub(crate) fn of_filter(examples: Examples<FILTER_INPUTS>, simulated: &SimulatedParams) -> Option<Self> {
        let prepared = Prepared::new(examples);
        Self::fit::<_, 0>(&prepared, &prepared.heard(&prepared.simulated(simulated)?))
    }

    /// The same of a smoother, with its one-sided processes.
    pub(crate) fn of_smoother(examples: Examples<SMOOTHER_INPUTS>) -> Option<Self> {
        Self::fit::<_, SIDES>(&Prepared::new(examples), &[])
    }

    /// With S one-sided processes; `last` is what is mixed in last of every row, if anything is.
    fn fit<const D: usize, const S: usize>(prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<Self> {
        let chosen = |which: Which| prepared.chosen(which, Choosing::of_sides(S));
        let (direct, residual) = (chosen(Which::Direct)?, chosen(Which::Residual)?);
        let one_sided = ONE_SIDED[..S].iter().map(|side| chosen(*side)).collect::<Option<_>>()?;
        let of = Self { sd_scale: 1.0, direct, residual, one_sided };
        Some(Self { sd_scale: of.scale_of::<_, S>(prepared, last)?, ..of })
    }

    /// The factor on the deviation of what its processes say together.
    fn scale_of<const D: usize, const S: usize>(&self, prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<f64> {
        let said = |which: Which| prepared.left_out(which, which.params(self)?);
        let (direct, residual) = (said(Which::Direct)?, said(Which::Residual)?);
        let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| said(*side)).collect::<Option<_>>()?;
        let one_sided = |k: usize| std::array::from_fn::<_, S, _>(|side| sides[side][k]);
        let together = |k: usize| consensus(direct[k], residual[k], one_sided(k));
        let said: Vec<Gaussian<f64>> = (0..prepared.rows.len()).map(together).collect();
        Some(scale_beside(&said, last, prepared.examples.strain))
    }
}

/// The factor on the deviation of what is said of rows that makes intervals right, beside what is mixed in last.
fn scale_beside(said: &[Gaussian<f64>], last: &[Gaussian<f64>], strain: &[f64]) -> f64 {
    joint_scale_of(|scale| {
        let scaled = |said: &Gaussian<f64>| Gaussian { variance: said.variance * scale.powi(2), ..*said };
        let heard = |(k, of_row)| mixture(std::iter::once(scaled(of_row)).chain(last.get(k).copied()));
        let mixed: Vec<Gaussian<f64>> = said.iter().enumerate().map(heard).collect();
        deviations(&mixed, strain).concat()
    })
}

/// Errors in units of their deviations, block by block.
fn deviations(said: &[Gaussian<f64>], strain: &[f64]) -> Vec<Vec<f64>> {
    let n = said.len();
    let of_row = |k: usize| (said[k].mean - strain[k]).abs() / said[k].sd();
    (0..BLOCKS).map(|block| (block * n / BLOCKS..(block + 1) * n / BLOCKS).map(of_row).collect()).collect()
}

/// [`learned`] for the filter, beside what simulated rows say.
pub(crate) fn learned_with_simulated(
    params: &CorrectorParams,
    examples: Examples<FILTER_INPUTS>,
    simulated: &SimulatedParams,
) -> Option<OwnedCorrection<f64, FILTER_INPUTS>> {
    let simulated = Prepared::new(examples).simulated(simulated)?;
    Some(OwnedCorrection { simulated: Some(simulated), ..learned(params, examples)? })
}

/// Makes weights of examples; none if the covariances are not positive definite.
pub(crate) fn learned<const D: usize, const S: usize>(
    params: &CorrectorParams,
    examples: Examples<D>,
) -> Option<OwnedCorrection<f64, D, S>> {
    let prepared = Prepared::new(examples);
    let made = |which: Which| prepared.taught(which, |lessons| GaussianProcess::new(lessons, which.params(params)?));
    let (direct, residual) = (made(Which::Direct)?, made(Which::Residual)?);
    let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| made(*side)).collect::<Option<_>>()?;
    let kernels = sides.iter().fold(direct.kernel() + residual.kernel(), |sum, side| sum + side.kernel());
    let inducing = inducing_rows(&kernels, INDUCING);
    let order = inducing_first(&inducing, prepared.rows.len());
    let owned = |which: Which, process: &GaussianProcess| {
        let settings = which.params(params)?;
        let weights: Vec<f64> = process.weights().collect();
        let mut of_inputs = [0.0; D];
        for (place, length) in which.places(D).into_iter().zip(&settings.lengths) {
            of_inputs[place] = relevance(*length);
        }
        let numbers = Process {
            relevance: of_inputs,
            mean: process.centre,
            weights: &[],
            explained: Triangle::NONE,
            variance: process.variance(),
            noise: process.noise * process.variance(),
            widening: settings.sd_scale.powi(2),
            least_variance: prepared.least_variance(which),
        };
        let weights = order.iter().map(|&row| weights[row]).collect();
        Some(OwnedProcess { weights, explained: process.explained(&inducing)?, numbers })
    };
    let one_sided = ONE_SIDED.iter().zip(&sides).map(|(which, side)| owned(*which, side));
    Some(OwnedCorrection {
        rows: order.iter().map(|&row| prepared.rows[row]).collect(),
        scales: prepared.scales,
        direct: owned(Which::Direct, &direct)?,
        one_sided: one_sided.collect::<Option<Vec<_>>>()?.try_into().ok()?,
        residual: owned(Which::Residual, &residual)?,
        simulated: None,
        limits: examples.limits.to_model(),
        strain_variance: prepared.strain_variance,
        variance_factor: params.sd_scale.powi(2),
    })
}

/// All rows, these first.
fn inducing_first(inducing: &[usize], rows: usize) -> Vec<usize> {
    let others = (0..rows).filter(|row| !inducing.contains(row));
    inducing.iter().copied().chain(others).collect()
}

#[cfg(test)]
mod tests;
