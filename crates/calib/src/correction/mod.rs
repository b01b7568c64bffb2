//! The learned correction: choosing its processes, and conditioning them on rows.

mod criterion;
pub(crate) mod gaussian_process;
mod settings;
pub(crate) mod simulated;

use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{FILTER_INPUTS, INDUCING, InputScale, consensus, mixture};
use ohmstrain_sensor::correction::{ONE_SIDED, ProcessKind, SIDES, SMOOTHER_INPUTS, standardised};
use ohmstrain_sensor::{CorrectorParams, InputScales, ProcessParams, RangeParams, SimulatedParams};

use crate::digits::significant;
use crate::order::extent;
use crate::sd_scale::{joint_scale_of, sd_scale_up_to};
use criterion::Criterion;
use gaussian_process::{GaussianProcess, LeftOutRow, Lessons, Settings, inducing_rows};

/// Blocks of rows that are left out in turn.
const BLOCKS: usize = 5;
/// Where nothing is known, the variance of the strain that the direct process leaves, and of the filter's error that the
/// residual process leaves, in variances of the strain. The targets' own variances, of a filter that has seen the rows,
/// promise too much for other motions.
const LEAST_DIRECT: f64 = 0.5;
const LEAST_RESIDUAL: f64 = 0.07;
/// Significant digits of weights: kernels of a few hundred rows have conditions up to 1e6, and what they say is to have six digits.
const WEIGHT_DIGITS: usize = 12;
/// Significant digits of what inducing rows explain, a share of the variance.
const EXPLAINED_DIGITS: usize = 9;
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

/// A process, before it has seen rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chosen {
    pub settings: Settings,
    /// Factor on its standard deviation, from blocks left out.
    pub sd_scale: f64,
}

/// The processes of a corrector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choices {
    /// Factor on the standard deviation of what they say together.
    pub sd_scale: f64,
    pub direct: Chosen,
    pub residual: Chosen,
    pub one_sided: Vec<Chosen>,
}

impl Choices {
    fn of(&self, kind: ProcessKind) -> Option<&Chosen> {
        match kind {
            ProcessKind::Direct => Some(&self.direct),
            ProcessKind::Residual => Some(&self.residual),
            ProcessKind::Past => self.one_sided.first(),
            ProcessKind::Future => self.one_sided.get(1),
        }
    }
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

/// Least prior variance of a process, in variances of the strain.
const fn least_variance(kind: ProcessKind) -> f64 {
    match kind {
        ProcessKind::Residual => LEAST_RESIDUAL,
        _ => LEAST_DIRECT,
    }
}

/// Examples on the scale that their inputs have.
pub(crate) struct Prepared<'a, const D: usize> {
    examples: Examples<'a, D>,
    rows: Vec<[f64; D]>,
    scales: [InputScale<f64>; D],
    strain_variance: f64,
}

impl<'a, const D: usize> Prepared<'a, D> {
    pub(crate) fn new(examples: Examples<'a, D>) -> Self {
        let scales: [InputScale<f64>; D] = std::array::from_fn(|i| scale(examples.inputs.iter().map(|row| row[i])));
        let strain_variance = scale(examples.strain.iter().copied()).sd.powi(2);
        let rows = examples.inputs.iter().map(|row| standardised(&scales, row)).collect();
        Self { examples, rows, scales, strain_variance }
    }

    /// What a process adds its mean to.
    fn base(&self, kind: ProcessKind, row: usize) -> f64 {
        if kind == ProcessKind::Residual { self.examples.inputs[row][0] } else { 0.0 }
    }

    fn least_variance(&self, kind: ProcessKind) -> f64 {
        self.strain_variance * least_variance(kind)
    }

    /// Lets `learn` see the examples of a process.
    fn taught<X>(&self, kind: ProcessKind, learn: impl Fn(Lessons) -> Option<X>) -> Option<X> {
        let places = kind.places(D);
        let seen = |row: &[f64; D]| places.iter().map(|&i| row[i]).collect();
        let inputs: Vec<Vec<f64>> = self.rows.iter().map(seen).collect();
        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let target = |(row, strain): (usize, &f64)| strain - self.base(kind, row);
        let targets: Vec<f64> = self.examples.strain.iter().enumerate().map(target).collect();
        learn(Lessons { inputs: &inputs, targets: &targets, time_s: self.examples.time_s })
    }

    /// Chooses a process.
    fn chosen(&self, kind: ProcessKind, by: Choosing) -> Option<Chosen> {
        let settings = self.taught(kind, |lessons| lessons.best_settings(by.criterion))?;
        let chosen = Chosen { settings, sd_scale: 1.0 };
        let blocks = deviations(&self.left_out(kind, &chosen)?, self.examples.strain);
        let blocks = if by.covers_worst { blocks } else { vec![blocks.concat()] };
        Some(Chosen { sd_scale: sd_scale_up_to(&blocks, WIDEST_PROCESS), ..chosen })
    }

    /// What a process says of every row from the blocks that the row is not in.
    fn left_out(&self, kind: ProcessKind, chosen: &Chosen) -> Option<Vec<Gaussian<f64>>> {
        self.taught(kind, |lessons| {
            let process = GaussianProcess::new(lessons, &chosen.settings)?;
            let (limits, least) = (self.examples.limits, self.least_variance(kind));
            let said = |(k, row): (usize, LeftOutRow)| {
                let variance = row.unknown * row.prior.max(least) + process.noise * process.variance();
                let mean = (self.base(kind, k) + row.mean).clamp(limits.lower, limits.upper);
                Gaussian { mean, variance: variance * chosen.sd_scale.powi(2) }
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

/// What corrects a filter, from examples, beside what simulated rows say; none if there is nothing to learn from them.
pub(crate) fn filter_corrector(
    examples: Examples<FILTER_INPUTS>,
    simulated: &SimulatedParams,
) -> Option<CorrectorParams> {
    let prepared = Prepared::new(examples);
    Choices::fit::<_, 0>(&prepared, &prepared.heard(simulated))?.learned::<_, 0>(&prepared)
}

/// The same of a smoother, with its one-sided processes.
pub(crate) fn smoother_corrector(examples: Examples<SMOOTHER_INPUTS>) -> Option<CorrectorParams> {
    let prepared = Prepared::new(examples);
    Choices::fit::<_, SIDES>(&prepared, &[])?.learned::<_, SIDES>(&prepared)
}

impl Choices {
    /// With S one-sided processes; `last` is what is mixed in last of every row, if anything is.
    pub(crate) fn fit<const D: usize, const S: usize>(prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<Self> {
        let chosen = |kind: ProcessKind| prepared.chosen(kind, Choosing::of_sides(S));
        let (direct, residual) = (chosen(ProcessKind::Direct)?, chosen(ProcessKind::Residual)?);
        let one_sided = ONE_SIDED[..S].iter().map(|side| chosen(*side)).collect::<Option<_>>()?;
        let of = Self { sd_scale: 1.0, direct, residual, one_sided };
        Some(Self { sd_scale: of.scale_of::<_, S>(prepared, last)?, ..of })
    }

    /// The factor on the deviation of what its processes say together.
    fn scale_of<const D: usize, const S: usize>(&self, prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<f64> {
        let said = |kind: ProcessKind| prepared.left_out(kind, self.of(kind)?);
        let (direct, residual) = (said(ProcessKind::Direct)?, said(ProcessKind::Residual)?);
        let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| said(*side)).collect::<Option<_>>()?;
        let one_sided = |k: usize| std::array::from_fn::<_, S, _>(|side| sides[side][k]);
        let together = |k: usize| consensus(direct[k], residual[k], one_sided(k));
        let said: Vec<Gaussian<f64>> = (0..prepared.rows.len()).map(together).collect();
        Some(scale_beside(&said, last, prepared.examples.strain))
    }

    /// Conditions the processes on the examples; none if a covariance is not positive definite.
    pub(crate) fn learned<const D: usize, const S: usize>(&self, prepared: &Prepared<D>) -> Option<CorrectorParams> {
        let made = |kind: ProcessKind| {
            prepared.taught(kind, |lessons| GaussianProcess::new(lessons, &self.of(kind)?.settings))
        };
        let (direct, residual) = (made(ProcessKind::Direct)?, made(ProcessKind::Residual)?);
        let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| made(*side)).collect::<Option<_>>()?;
        let kernels = sides.iter().fold(direct.kernel() + residual.kernel(), |sum, side| sum + side.kernel());
        let inducing = inducing_rows(&kernels, INDUCING);
        let order = inducing_first(&inducing, prepared.rows.len());
        let params = |kind: ProcessKind, process: &GaussianProcess| {
            let Chosen { settings, sd_scale } = self.of(kind)?;
            let weights: Vec<f64> = process.weights().collect();
            Some(ProcessParams {
                sd_scale: *sd_scale,
                mean: process.centre,
                sd: process.variance().sqrt(),
                least_sd: prepared.least_variance(kind).sqrt(),
                noise_sd: (process.noise * process.variance()).sqrt(),
                lengths: settings.lengths.clone(),
                weights: order.iter().map(|&row| weight(weights[row])).collect(),
                explained: process
                    .explained(&inducing)?
                    .into_iter()
                    .map(|x| significant(x, EXPLAINED_DIGITS))
                    .collect(),
            })
        };
        let one_sided = ONE_SIDED.iter().zip(&sides).map(|(kind, side)| params(*kind, side));
        Some(CorrectorParams {
            sd_scale: self.sd_scale,
            strain_sd: prepared.strain_variance.sqrt(),
            inputs: input_scales(&prepared.scales),
            direct: params(ProcessKind::Direct, &direct)?,
            residual: params(ProcessKind::Residual, &residual)?,
            one_sided: one_sided.collect::<Option<_>>()?,
            order,
        })
    }
}

/// A weight with the digits that are kept.
fn weight(value: f64) -> f64 {
    significant(value, WEIGHT_DIGITS)
}

fn input_scales<const D: usize>(scales: &[InputScale<f64>; D]) -> InputScales {
    let column = |of: fn(&InputScale<f64>) -> f64| scales.iter().map(of).collect();
    InputScales {
        mean: column(|scale| scale.mean),
        sd: column(|scale| if scale.sd.is_finite() { scale.sd } else { 0.0 }),
        lower: column(|scale| scale.lower),
        upper: column(|scale| scale.upper),
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

/// All rows, these first.
fn inducing_first(inducing: &[usize], rows: usize) -> Vec<usize> {
    let others = (0..rows).filter(|row| !inducing.contains(row));
    inducing.iter().copied().chain(others).collect()
}

#[cfg(test)]
mod tests;
