//! Examples on the scale of their inputs, and the rows on which the learned correction is judged.

use std::ops::Range;

use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::correction::{InputScale, mixture};
use ohmstrain_sensor::correction::{ProcessKind, standardised};

use super::criterion::Criterion;
use super::examples::{AllRows, Examples};
use super::gaussian_process::{BLOCKS, GaussianProcess, LeftOutRow, Settings, TrainingSet};
use super::sparse::{Population, Sums};
use crate::order::{extent, mean_sd};
use crate::sd_scale::{joint_scale_of, sd_scale_up_to};

/// Least prior variance of the strain given the direct process, and of the filter's error given the residual process, in units of the
/// strain's variance. The filter has seen the rows, so the variances of the targets themselves would be too small for other motions.
const LEAST_DIRECT: f64 = 0.5;
const LEAST_RESIDUAL: f64 = 0.07;
/// Multiples of all length scales, and noises in standard deviations of the targets, tried on held-out recordings.
const LENGTH_FACTORS: [f64; 3] = [1.0, 2.0, 4.0];
const NOISES: [f64; 3] = [0.1, 0.3, 1.0];
/// Largest factor on a process' standard deviation: held-out blocks of recordings with long holds have little in common with the others.
const WIDEST_PROCESS: f64 = 3.0;

/// Settings of a process, before it is conditioned on rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chosen {
    /// Indices of its inputs.
    pub inputs: Vec<usize>,
    pub settings: Settings,
    /// Factor on its standard deviation, from held-out blocks.
    pub sd_scale: f64,
}

/// Options for choosing the processes of a corrector.
#[derive(Clone, Copy)]
pub(super) struct Choosing {
    pub(super) criterion: Criterion,
    /// True if the factor on a process' standard deviation covers the worst block, false if it covers all blocks together.
    pub(super) covers_worst: bool,
}

impl Choosing {
    /// Factors weigh members against each other; the mixture has its own factor for its interval. A filter has two members, and a single
    /// unusual block must not silence one of them everywhere. A smoother has four, one of which is usually better, so the caution pays
    /// there.
    pub(super) const fn of_sides(sides: usize) -> Self {
        let is_smoother = sides > 0;
        let criterion = if is_smoother { Criterion::LeftOut } else { Criterion::LeftOutAndEvidence };
        Self { criterion, covers_worst: is_smoother }
    }
}

/// Returns the least prior variance of a process, in units of the strain's variance.
const fn least_variance(kind: ProcessKind) -> f64 {
    match kind {
        ProcessKind::Residual => LEAST_RESIDUAL,
        _ => LEAST_DIRECT,
    }
}

/// Examples with standardised inputs.
pub(crate) struct Prepared<'a, const D: usize> {
    pub(super) examples: Examples<'a, D>,
    pub(super) rows: Vec<[f64; D]>,
    pub(super) scales: [InputScale<f64>; D],
    pub(super) strain_variance: f64,
    pub(super) judged: Judged<'a, D>,
}

/// Rows on which a correction is judged, each by what was learned without its block: all rows of several recordings, or else the examples
/// in fifths.
pub(super) struct Judged<'a, const D: usize> {
    /// Standardised inputs.
    pub(super) rows: Vec<[f64; D]>,
    inputs: &'a [[f64; D]],
    pub(super) strain: &'a [f64],
    pub(super) blocks: Vec<Range<usize>>,
}

/// Predictions of the judged rows: mean, unexplained fraction of the prior variance, and variance of the noise.
struct LeftOut {
    rows: Vec<LeftOutRow>,
    noise: f64,
}

impl<'a, const D: usize> Prepared<'a, D> {
    pub(crate) fn new(examples: Examples<'a, D>) -> Self {
        let scales: [InputScale<f64>; D] = std::array::from_fn(|i| scale(examples.inputs.iter().map(|row| row[i])));
        let strain_variance = scale(examples.strain.iter().copied()).sd.powi(2);
        let on_scale = |inputs: &[[f64; D]]| inputs.iter().map(|row| standardised(&scales, row)).collect::<Vec<_>>();
        let n = examples.strain.len();
        let judged = match examples.all {
            Some(AllRows { inputs, strain, recordings, .. }) => {
                Judged { rows: on_scale(inputs), inputs, strain, blocks: recordings.to_vec() }
            }
            None => Judged {
                rows: on_scale(examples.inputs),
                inputs: examples.inputs,
                strain: examples.strain,
                blocks: (0..BLOCKS).map(|block| block * n / BLOCKS..(block + 1) * n / BLOCKS).collect(),
            },
        };
        Self { rows: on_scale(examples.inputs), examples, scales, strain_variance, judged }
    }

    pub(super) fn least_variance(&self, kind: ProcessKind) -> f64 {
        self.strain_variance * least_variance(kind)
    }

    /// Calls `learn` with the training set of a process.
    fn with_training_set<X>(
        &self,
        (kind, places): (ProcessKind, &[usize]),
        learn: impl Fn(TrainingSet) -> Option<X>,
    ) -> Option<X> {
        let (inputs, targets) = (seen(places, &self.rows), targets(kind, self.examples.inputs, self.examples.strain));
        learn(TrainingSet { inputs: &as_slices(&inputs), targets: &targets, time_s: self.examples.time_s })
    }

    /// Returns the sums over all rows of several recordings; `None` if there are not several.
    fn sums(&self, (kind, places): (ProcessKind, &[usize]), lengths: &[f64]) -> Option<Sums> {
        let AllRows { step_s, .. } = self.examples.all?;
        let (few, inputs) = (seen(places, &self.rows), seen(places, &self.judged.rows));
        let targets = targets(kind, self.judged.inputs, self.judged.strain);
        let (few, inputs, recordings) = (&as_slices(&few), &as_slices(&inputs), &self.judged.blocks);
        Some(Sums::new(Population { few, inputs, targets: &targets, recordings, step_s }, lengths))
    }

    /// Chooses a process. The examples determine the relevance of its inputs; held-out recordings, if there are several, the common factor
    /// on the length scales and the noise.
    pub(super) fn chosen(&self, kind: ProcessKind, by: Choosing) -> Option<Chosen> {
        let inputs = kind.places(D);
        let settings = self.with_training_set((kind, &inputs), |training| training.best_settings(by.criterion))?;
        let settings = match self.examples.all {
            Some(_) => self.best_of_recordings((kind, &inputs), &settings)?,
            None => settings,
        };
        let chosen = Chosen { inputs, settings, sd_scale: 1.0 };
        let blocks = self.deviations(&self.left_out(kind, &chosen)?);
        let blocks = if by.covers_worst { blocks } else { vec![blocks.concat()] };
        Some(Chosen { sd_scale: sd_scale_up_to(&blocks, WIDEST_PROCESS), ..chosen })
    }

    /// Returns the settings with the common factor on the length scales and the noise that are best on held-out recordings.
    fn best_of_recordings(&self, of: (ProcessKind, &[usize]), settings: &Settings) -> Option<Settings> {
        let mut best: Option<(f64, Settings)> = None;
        for factor in LENGTH_FACTORS {
            let lengths: Vec<f64> = settings.lengths.iter().map(|length| factor * length).collect();
            let sums = self.sums(of, &lengths)?;
            for noise in NOISES {
                let Some(cost) = sums.cost(noise) else { continue };
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, Settings { lengths: lengths.clone(), noise, ..*settings }));
                }
            }
        }
        best.map(|(_, settings)| settings)
    }

    /// Returns the prediction of a process for every judged row, without the row's block.
    pub(super) fn left_out(&self, kind: ProcessKind, chosen: &Chosen) -> Option<Vec<Gaussian<f64>>> {
        let (Settings { lengths, noise, .. }, of) = (&chosen.settings, (kind, chosen.inputs.as_slice()));
        let LeftOut { rows, noise } = match self.sums(of, lengths) {
            Some(sums) => {
                let (_, variance) = sums.weights(*noise)?;
                let of_variance = |row: LeftOutRow| LeftOutRow { prior: row.prior * variance, ..row };
                let rows = sums.left_out(*noise)?.into_iter().map(of_variance).collect();
                LeftOut { rows, noise: Sums::unpredicted(*noise) * variance }
            }
            None => self.with_training_set(of, |training| {
                let process = GaussianProcess::new(training, &chosen.settings)?;
                Some(LeftOut { rows: process.left_out(BLOCKS)?, noise: process.noise * process.variance() })
            })?,
        };
        let (limits, least) = (self.examples.limits, self.least_variance(kind));
        let predicted = |(k, row): (usize, LeftOutRow)| {
            let variance = row.unknown * row.prior.max(least) + noise;
            let mean = (base(kind, &self.judged.inputs[k]) + row.mean).clamp(limits.lower, limits.upper);
            Gaussian { mean, variance: variance * chosen.sd_scale.powi(2) }
        };
        Some(rows.into_iter().enumerate().map(predicted).collect())
    }

    /// Returns the errors of the predictions of judged rows, in units of their standard deviations, block by block.
    fn deviations(&self, predicted: &[Gaussian<f64>]) -> Vec<Vec<f64>> {
        let of_row = |k: usize| {
            (predicted[k].mean - self.judged.strain[k]).hypot(self.examples.reference_sd) / predicted[k].sd()
        };
        self.judged.blocks.iter().map(|block| block.clone().map(of_row).collect()).collect()
    }

    /// Returns the factor on the standard deviation of the predictions of judged rows at which intervals have their nominal coverage, mixed
    /// with `last`.
    pub(super) fn scale_beside(&self, predicted: &[Gaussian<f64>], last: &[Gaussian<f64>]) -> f64 {
        joint_scale_of(|scale| {
            let scaled =
                |predicted: &Gaussian<f64>| Gaussian { variance: predicted.variance * scale.powi(2), ..*predicted };
            let mixed_with = |(k, of_row)| mixture(std::iter::once(scaled(of_row)).chain(last.get(k).copied()));
            let mixed: Vec<Gaussian<f64>> = predicted.iter().enumerate().map(mixed_with).collect();
            self.deviations(&mixed).concat()
        })
    }

    /// Conditions a process on the examples, or on all rows that they represent.
    pub(super) fn conditioned(
        &self,
        kind: ProcessKind,
        Chosen { inputs, settings, .. }: &Chosen,
    ) -> Option<Conditioned> {
        if let Some(sums) = self.sums((kind, inputs), &settings.lengths) {
            let (weights, variance) = sums.weights(settings.noise)?;
            let noise = Sums::unpredicted(settings.noise) * variance;
            let known = Known::All(sums, settings.noise);
            return Some(Conditioned { weights, variance, noise, known });
        }
        let process = self.with_training_set((kind, inputs), |training| GaussianProcess::new(training, settings))?;
        let (weights, variance) = (process.weights().collect(), process.variance());
        Some(Conditioned { weights, variance, noise: process.noise * variance, known: Known::Examples(process) })
    }
}

/// A process conditioned on its rows.
pub(super) struct Conditioned {
    pub(super) weights: Vec<f64>,
    pub(super) variance: f64,
    pub(super) noise: f64,
    known: Known,
}

/// The rows on which it is conditioned.
enum Known {
    Examples(GaussianProcess),
    All(Sums, f64),
}

impl Conditioned {
    pub(super) fn centre(&self) -> f64 {
        match &self.known {
            Known::Examples(process) => process.centre,
            Known::All(sums, _) => sums.centre,
        }
    }

    pub(super) fn explained(&self, inducing: &[usize]) -> Option<Vec<f64>> {
        match &self.known {
            Known::Examples(process) => process.explained(inducing),
            Known::All(sums, noise) => sums.explained(*noise, inducing),
        }
    }
}

/// Returns the strain to which a process adds its mean.
fn base<const D: usize>(kind: ProcessKind, inputs: &[f64; D]) -> f64 {
    if kind == ProcessKind::Residual { inputs[0] } else { 0.0 }
}

/// Returns the targets of a process.
fn targets<const D: usize>(kind: ProcessKind, inputs: &[[f64; D]], strain: &[f64]) -> Vec<f64> {
    strain.iter().zip(inputs).map(|(strain, inputs)| strain - base(kind, inputs)).collect()
}

/// Returns the inputs of a process.
pub(super) fn seen<const D: usize>(places: &[usize], rows: &[[f64; D]]) -> Vec<Vec<f64>> {
    rows.iter().map(|row| places.iter().map(|&i| row[i]).collect()).collect()
}

fn as_slices(rows: &[Vec<f64>]) -> Vec<&[f64]> {
    rows.iter().map(Vec::as_slice).collect()
}

/// Returns mean, standard deviation and range of values. A constant input gets an infinite standard deviation, so that it has no effect
/// even at values far from it.
pub(super) fn scale(values: impl Iterator<Item = f64> + Clone) -> InputScale<f64> {
    let (mean, sd) = mean_sd(values.clone());
    let (lower, upper) = extent(values);
    InputScale { mean, sd: if upper > lower { sd } else { f64::INFINITY }, lower, upper }
}
