//! The learned correction: choosing its processes, and conditioning them on rows.

mod criterion;
mod examples;
pub(crate) mod gaussian_process;
mod prepared;
mod settings;
pub(crate) mod simulated;
mod sparse;

use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{FILTER_INPUTS, INDUCING, InputScale, consensus};
use ohmstrain_sensor::correction::{ONE_SIDED, ProcessKind, SIDES, SMOOTHER_INPUTS};
use ohmstrain_sensor::{CorrectorParams, InputScales, ProcessParams, SimulatedParams};

use rayon::prelude::*;

use crate::digits::significant;
pub(crate) use examples::{AllRows, Examples};
use gaussian_process::{inducing_rows, kernel_of};
use prepared::{Choosing, Conditioned, seen};
pub(crate) use prepared::{Chosen, Prepared};

/// Significant digits of weights: kernels of a few hundred rows have condition numbers up to 1e6, and predictions need six digits.
const WEIGHT_DIGITS: usize = 12;
/// Significant digits of the explained fraction of the variance.
const EXPLAINED_DIGITS: usize = 9;
/// The processes of a corrector.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choices {
    /// Factor on the standard deviation of their joint prediction.
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

/// Learns the corrector of a filter from examples, beside a process of simulated rows; `None` if there is nothing to learn from them.
pub(crate) fn filter_corrector(
    examples: Examples<FILTER_INPUTS>,
    simulated: &SimulatedParams,
) -> Option<CorrectorParams> {
    let prepared = Prepared::new(examples);
    Choices::fit::<_, 0>(&prepared, &prepared.simulated_predictions(simulated))?.learned::<_, 0>(&prepared)
}

/// Learns the corrector of a smoother, with its one-sided processes.
pub(crate) fn smoother_corrector(examples: Examples<SMOOTHER_INPUTS>) -> Option<CorrectorParams> {
    let prepared = Prepared::new(examples);
    Choices::fit::<_, SIDES>(&prepared, &[])?.learned::<_, SIDES>(&prepared)
}

impl Choices {
    /// Chooses the processes, S one-sided ones among them. `last` is mixed into every row at the end, if given.
    pub(crate) fn fit<const D: usize, const S: usize>(prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<Self> {
        let chosen = |kind: ProcessKind| prepared.chosen(kind, Choosing::of_sides(S));
        let both = || rayon::join(|| chosen(ProcessKind::Direct), || chosen(ProcessKind::Residual));
        let sides = || ONE_SIDED[..S].par_iter().map(|side| chosen(*side)).collect::<Option<_>>();
        let ((direct, residual), one_sided) = rayon::join(both, sides);
        let (direct, residual, one_sided) = (direct?, residual?, one_sided?);
        let of = Self { sd_scale: 1.0, direct, residual, one_sided };
        Some(Self { sd_scale: of.scale_of::<_, S>(prepared, last)?, ..of })
    }

    /// Returns the factor on the standard deviation of the processes' joint prediction.
    fn scale_of<const D: usize, const S: usize>(&self, prepared: &Prepared<D>, last: &[Gaussian<f64>]) -> Option<f64> {
        let predicted = |kind: ProcessKind| prepared.left_out(kind, self.of(kind)?);
        let (direct, residual) = (predicted(ProcessKind::Direct)?, predicted(ProcessKind::Residual)?);
        let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| predicted(*side)).collect::<Option<_>>()?;
        let one_sided = |k: usize| std::array::from_fn::<_, S, _>(|side| sides[side][k]);
        let together = |k: usize| consensus(direct[k], residual[k], one_sided(k));
        let predicted: Vec<Gaussian<f64>> = (0..prepared.judged.rows.len()).map(together).collect();
        Some(prepared.scale_beside(&predicted, last))
    }

    /// Conditions the processes on the examples; `None` if a covariance is not positive definite.
    pub(crate) fn learned<const D: usize, const S: usize>(&self, prepared: &Prepared<D>) -> Option<CorrectorParams> {
        let made = |kind: ProcessKind| prepared.conditioned(kind, self.of(kind)?);
        let (direct, residual) = (made(ProcessKind::Direct)?, made(ProcessKind::Residual)?);
        let sides: Vec<_> = ONE_SIDED[..S].iter().map(|side| made(*side)).collect::<Option<_>>()?;
        let all = [&self.direct, &self.residual].into_iter().chain(&self.one_sided);
        let kernels = all.map(|one| kernel_of(&seen(&one.inputs, &prepared.rows), &one.settings));
        let inducing = inducing_rows(&kernels.reduce(|sum, one| sum + one)?, INDUCING);
        let order = inducing_first(&inducing, prepared.rows.len());
        let params = |kind: ProcessKind, process: &Conditioned| {
            let Chosen { inputs, settings, sd_scale } = self.of(kind)?;
            Some(ProcessParams {
                sd_scale: *sd_scale,
                mean: process.centre(),
                sd: process.variance.sqrt(),
                least_sd: prepared.least_variance(kind).sqrt(),
                noise_sd: process.noise.sqrt(),
                inputs: inputs.clone(),
                lengths: settings.lengths.clone(),
                weights: order.iter().map(|&row| weight(process.weights[row])).collect(),
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

/// Rounds a weight to the digits that are stored.
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

/// Returns all rows, the inducing ones first.
fn inducing_first(inducing: &[usize], rows: usize) -> Vec<usize> {
    let others = (0..rows).filter(|row| !inducing.contains(row));
    inducing.iter().copied().chain(others).collect()
}

#[cfg(test)]
mod tests;
