//! The learned correction: strain from a filter's outputs and the readings' recent past, by two Gaussian processes.
//!
//! The law's error is systematic, so the resulting error of the strain can be learned from the calibration rows. A *direct* process
//! predicts strain from features of the readings alone; a *residual* process predicts the error of the filter's strain, from the
//! filter's outputs and the same features. A smoother has two more direct processes, one of the readings' past and one of their
//! future: these are less easily misled by a motion that begins like one known motion and ends like another. Their predictions are
//! combined by [`consensus`]. Far from the training rows, the residual process returns the filter's strain with at least the
//! filter's variance, and the mixture's variance grows. There another process counts, trained on the law's response to simulated
//! motions that the recordings do not contain. Unlike a filter, it cannot diverge.
//!
//! # Policy
//! - Configuration, borrowed as slices that may lie in flash, is separate from state ([`ReadingFeatures`]); no heap, no
//!   panic.
//! - Inputs are clamped to the range of the training rows; the variance grows with their distance outside. Non-finite
//!   inputs come only from a filter that has failed, and give a non-finite result.
//! - With n rows of D inputs, m inducing rows and p processes a correction costs about n (D + p (D + exp)) + p m²/2
//!   multiplications.

mod features;
mod low_pass;
mod process;
mod quadratic;
mod rows;
mod triangle;

use ohmstrain_model::StrainRange;

use crate::kernel::{Several, Work};
use crate::{Gaussian, Real, Recordable};
pub use features::{FARTHEST, FEATURES, FeatureScale, RATE_GAIN, ReadingFeatures, Starts, TIME_CONSTANTS_S, settled};
pub use low_pass::Decay;
use process::{Kernels, Prediction};
pub use process::{LINEAR, Process, kernel};
pub use quadratic::Quadratic;
pub use rows::{BLOCK, InputRows, RowBlock, block_of};
pub use triangle::{Triangle, stripe_places, stripes};

/// Number of a filter's outputs that a correction uses: strain, its rate, relaxation, baseline, and the probabilities of
/// stretching and releasing.
pub const OUTPUTS: usize = 6;
/// Number of inputs of a filter's correction: its outputs, and the features of the readings up to now.
pub const FILTER_INPUTS: usize = OUTPUTS + FEATURES;
/// Returns the inputs of a filter's correction.
#[must_use]
pub fn filter_inputs<T: Real>(outputs: &[T; OUTPUTS], features: &[T; FEATURES]) -> [T; FILTER_INPUTS] {
    let mut inputs = [T::zero(); FILTER_INPUTS];
    inputs.iter_mut().zip(outputs.iter().chain(features)).for_each(|(place, input)| *place = *input);
    inputs
}

/// Maximum number of inducing rows.
pub const INDUCING: usize = 64;

/// Variance per squared distance of the inputs from the training range, in variances of the strain. In this distance a standard
/// deviation of a process' first input counts as one, the others in proportion to their relevance.
const FAR: f64 = 0.03;
/// Additional variance of a result whose inputs do not resemble the training rows at all, in variances of the strain.
const NOVEL: f64 = 0.06;
/// Squared distance over which inputs become novel.
const NEW: f64 = 5.0;

/// Distribution of an input over the training rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputScale<T> {
    /// Mean.
    pub mean: T,
    /// Standard deviation, positive.
    pub sd: T,
    /// Smallest.
    pub lower: T,
    /// Largest.
    pub upper: T,
}

impl<T: Recordable> InputScale<T> {
    /// Returns an input on this scale, clamped to the range, and its squared distance outside.
    #[inline(always)]
    pub(crate) fn standardised(&self, input: T) -> (T, T) {
        let inside = input.max(self.lower).min(self.upper);
        let excess = (input - inside) / self.sd;
        ((inside - self.mean) / self.sd, excess * excess)
    }
}

/// A learned correction with D inputs: the filter's [`OUTPUTS`], then features of the readings, those of the future last. S
/// is 2 for a smoother's correction, which has one-sided processes, and 0 otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, T, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first are the inducing rows, at most [`INDUCING`].
    pub rows: InputRows<'a, T, D>,
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// Strain from all features; the filter's outputs are not used, whatever their relevance.
    pub direct: Process<'a, T, D>,
    /// Strain from features of the past, and strain from features of the future. Neither uses the filter's outputs.
    pub one_sided: [OneSided<'a, T, D>; S],
    /// Strain minus the filter's strain, from all inputs.
    pub residual: Process<'a, T, D>,
    /// Strain from the features, according to the law, in motions absent from the recordings.
    pub simulated: Option<Simulated<'a, T, D>>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance, from held-out training rows.
    pub variance_factor: T,
}

/// A process of the features of one side of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneSided<'a, T, const D: usize> {
    /// The Gaussian process.
    pub process: Process<'a, T, D>,
    /// The input that the linear part of its kernel takes.
    pub first: usize,
}

/// A process of features alone, trained on readings of a law in simulated motions. Its variance is its noise.
#[derive(Clone, Copy, Debug)]
pub struct Simulated<'a, T, const D: usize> {
    /// Standardised inputs of the rows; outputs of a filter are not used.
    pub rows: InputRows<'a, T, D>,
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// The Gaussian process of the rows.
    pub process: Process<'a, T, D>,
}

/// A corrected strain and its components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected<T, const S: usize = 0> {
    /// The result.
    pub strain: Gaussian<T>,
    /// Strain by the direct process.
    pub direct: Gaussian<T>,
    /// Strains by the one-sided processes.
    pub one_sided: [Gaussian<T>; S],
    /// Strain by the filter and the residual process together.
    pub residual: Gaussian<T>,
    /// Strain by the process of the simulated rows.
    pub simulated: Option<Gaussian<T>>,
    /// Novelty: from 0 if the inputs resemble the training rows to 1 if they do not at all.
    pub novelty: T,
}

/// An input on the scale of the training rows.
struct Standardised<T, const D: usize> {
    /// Inputs clamped to the range of the training rows.
    inputs: [T; D],
    /// Squared distances outside that range.
    outside: [T; D],
}

impl<T: Real, const D: usize, const S: usize> Correction<'_, T, D, S> {
    /// Corrects the strain of a filter. `inputs` are the filter's outputs, the strain first, and the features of the
    /// readings; `filtered` is the filter's strain with its variance. `birge` is the ratio of observed to stated innovation
    /// variance, a factor on the variance of the learned strain.
    #[must_use]
    pub fn correct(&self, inputs: &[T; D], filtered: Gaussian<T>, birge: T) -> Corrected<T, S> {
        let work = Correcting { correction: self, inputs, filtered, birge };
        T::in_vectors(work).unwrap_or_else(|| work.with_lanes(T::zero()))
    }

    /// Returns the inputs on the scale of the training rows, clamped to their range.
    #[must_use]
    pub fn standardised(&self, inputs: &[T; D]) -> [T; D] {
        standardised(self.scales, inputs).inputs
    }

    /// Returns the strain by the process of the simulated rows.
    #[inline(always)]
    fn of_simulated<V: Several<Number = T>>(&self, like: V, inputs: &[T; D], of: &Simulated<'_, T, D>) -> Gaussian<T> {
        let Standardised { inputs: x, outside } = standardised(of.scales, inputs);
        let reading = at(&x, OUTPUTS);
        let mut kernels = Kernels::new(&of.process);
        of.rows.side_by_side(like, |rows| {
            let mut squares = [like.nothing(); D];
            for i in OUTPUTS..D {
                squares[i] = rows.squares(i, x[i]);
            }
            let kernel = of.process.kernels(&squares, OUTPUTS, rows.column(OUTPUTS).scale(reading));
            kernels.add(&of.process, kernel, rows.count);
        });
        let predicted = kernels.prediction(like, &of.process, reading);
        self.widened(predicted, &of.process, of.process.distance(&outside, OUTPUTS), T::zero())
    }
}

impl<T: Recordable, const D: usize, const S: usize> Correction<'_, T, D, S> {
    /// Returns the strain by the filter and the residual process together, and the novelty of the inputs.
    pub(crate) fn of_residual(&self, predicted: Prediction<T>, outside: T, filtered: T) -> (Gaussian<T>, T) {
        let novelty = T::one() - (T::one() - predicted.unknown) * (-outside / T::of(NEW)).falling();
        (self.widened(predicted, &self.residual, outside, filtered), novelty)
    }

    /// Returns the residual process for use with a filter: its variance without any information is at least that of the
    /// filter.
    pub(crate) fn residual_beside(&self, filtered: Gaussian<T>) -> Process<'_, T, D> {
        Process { least_variance: self.residual.least_variance.max(filtered.variance), ..self.residual }
    }

    /// Returns the corrected strain from the mixture of the members.
    pub(crate) fn learned(&self, mixed: Gaussian<T>, novelty: T, birge: T) -> Gaussian<T> {
        let variance = mixed.variance * self.variance_factor + T::of(NOVEL) * self.strain_variance * novelty;
        let anywhere = self.limits.variance_of_anywhere();
        Gaussian { mean: mixed.mean, variance: (variance * birge).min(anywhere).max(variance) }
    }

    /// Returns a process' strain plus `base`, within the limits, with its widened variance.
    pub(crate) fn widened(
        &self,
        predicted: Prediction<T>,
        process: &Process<'_, T, D>,
        outside: T,
        base: T,
    ) -> Gaussian<T> {
        let variance = predicted.strain.variance * process.widening + T::of(FAR) * self.strain_variance * outside;
        Gaussian { mean: self.limits.clamp(base + predicted.strain.mean), variance }
    }
}

#[inline(always)]
fn standardised<T: Recordable, const D: usize>(scales: &[InputScale<T>; D], inputs: &[T; D]) -> Standardised<T, D> {
    let (mut x, mut outside) = ([T::zero(); D], [T::zero(); D]);
    for ((x, outside), (input, scale)) in x.iter_mut().zip(&mut outside).zip(inputs.iter().zip(scales)) {
        (*x, *outside) = scale.standardised(*input);
    }
    Standardised { inputs: x, outside }
}

/// Returns an input; zero if there is none.
fn at<T: Recordable, const D: usize>(inputs: &[T; D], place: usize) -> T {
    inputs.get(place).copied().unwrap_or(T::zero())
}

/// The correction of one strain, with training rows in lanes.
#[derive(Clone, Copy)]
struct Correcting<'a, T, const D: usize, const S: usize> {
    correction: &'a Correction<'a, T, D, S>,
    inputs: &'a [T; D],
    filtered: Gaussian<T>,
    birge: T,
}

impl<T: Real, const D: usize, const S: usize> Work<T> for Correcting<'_, T, D, S> {
    type Output = Corrected<T, S>;

    #[inline(always)]
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> Corrected<T, S> {
        let Self { correction: of, inputs, filtered, birge } = self;
        let Standardised { inputs: x, outside } = standardised(of.scales, inputs);
        let (mut direct, mut residual) = (Kernels::new(&of.direct), Kernels::new(&of.residual));
        let mut sides = of.one_sided.each_ref().map(|side| Kernels::new(&side.process));
        let of_residual = of.residual_beside(filtered);
        let (reading, strain) = (at(&x, OUTPUTS), x[0]);
        of.rows.side_by_side(like, |rows| {
            let mut squares = [like.nothing(); D];
            for i in 0..D {
                squares[i] = rows.squares(i, x[i]);
            }
            let readings = rows.column(OUTPUTS).scale(reading);
            direct.add(&of.direct, of.direct.kernels(&squares, OUTPUTS, readings), rows.count);
            for k in 0..S {
                let OneSided { process, first } = &of.one_sided[k];
                let linear = rows.column(*first).scale(at(&x, *first));
                sides[k].add(process, process.kernels(&squares, OUTPUTS, linear), rows.count);
            }
            let kernel = of.residual.kernels(&squares, 0, rows.column(0).scale(strain));
            residual.add(&of.residual, kernel, rows.count);
        });
        let of_readings = |kernels: Kernels<T>, process, first| {
            let predicted = kernels.prediction(like, process, at(&x, first));
            of.widened(predicted, process, process.distance(&outside, first), T::zero())
        };
        let direct = of_readings(direct, &of.direct, OUTPUTS);
        let mut of_sides = of.one_sided.iter();
        let one_sided =
            sides.map(|kernels| of_sides.next().map_or(direct, |side| of_readings(kernels, &side.process, side.first)));
        let predicted = residual.prediction(like, &of_residual, strain);
        let (residual, novelty) = of.of_residual(predicted, of.residual.distance(&outside, 0), filtered.mean);
        let learned = of.learned(consensus(direct, residual, one_sided), novelty, birge);
        let simulated = of.simulated.map(|simulated| of.of_simulated(like, inputs, &simulated));
        let strain = simulated.map_or(learned, |simulated| mixture([learned, simulated]));
        Corrected { strain, direct, one_sided, residual, simulated, novelty }
    }
}

/// Combines the members of a correction. A filter's two members are combined as a [`mixture`]. So are a smoother's four, but first
/// each member's variance grows by the part of its squared distance from the mixture of the others that both variances do not
/// explain. Among four members with different inputs, one that contradicts all others is probably less accurate than it states; of
/// two, it is unknown which one is wrong.
#[must_use]
pub fn consensus<T: Real, const S: usize>(
    direct: Gaussian<T>,
    residual: Gaussian<T>,
    one_sided: [Gaussian<T>; S],
) -> Gaussian<T> {
    let members = [direct, residual].into_iter().chain(one_sided);
    if S == 0 {
        return mixture(members);
    }
    let doubted = |place: usize, member: Gaussian<T>| {
        let others = members.clone().enumerate().filter(|(other, _)| *other != place).map(|(_, other)| other);
        let others = mixture(others);
        let apart = member.mean - others.mean;
        let unexplained = (apart * apart - member.variance - others.variance).max(T::zero());
        Gaussian { variance: member.variance + unexplained, ..member }
    };
    let sides = core::array::from_fn::<_, S, _>(|side| doubted(2 + side, one_sided[side]));
    mixture([doubted(0, direct), doubted(1, residual)].into_iter().chain(sides))
}

/// Returns mean and variance of the mixture of Gaussians, each weighted by its variance to the power −3/2. That favours the most
/// certain member more than the inverse variances of independent members do, because several may be wrong together. A member of
/// zero variance is returned alone; without members, both numbers are zero.
#[must_use]
pub fn mixture<T: Recordable>(members: impl IntoIterator<Item = Gaussian<T>, IntoIter: Clone>) -> Gaussian<T> {
    let members = members.into_iter();
    let none = Gaussian { mean: T::zero(), variance: T::zero() };
    let least = members.clone().map(|member| member.variance).reduce(T::min).unwrap_or(T::zero());
    if least <= T::zero() {
        return members.reduce(|a, b| if b.variance < a.variance { b } else { a }).unwrap_or(none);
    }
    let weighted = |member: Gaussian<T>| {
        let ratio = least / member.variance;
        (ratio * ratio.sqrt(), member)
    };
    let weighted = members.map(weighted);
    let total = weighted.clone().fold(T::zero(), |sum, (weight, _)| sum + weight);
    let mean = weighted.clone().fold(T::zero(), |sum, (weight, member)| sum + weight / total * member.mean);
    let spread = |member: Gaussian<T>| member.variance + (member.mean - mean) * (member.mean - mean);
    let variance = weighted.fold(T::zero(), |sum, (weight, member)| sum + weight / total * spread(member));
    Gaussian { mean, variance }
}

#[cfg(all(test, feature = "simd"))]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::{
        BLOCK, Correcting, Correction, FEATURES, INDUCING, InputRows, InputScale, OUTPUTS, OneSided, Process, RowBlock,
        Simulated, StrainRange, Triangle, block_of, stripes,
    };
    use crate::Gaussian;
    use crate::kernel::Work;

    /// The training rows leave a remainder of three, and the inducing rows do not fill vectors.
    #[test]
    fn vectors_of_training_rows_say_what_numbers_say() {
        const ROWS: usize = 4 * INDUCING + 3;
        const INPUTS: usize = OUTPUTS + FEATURES + 2;
        let number = |k: usize| (0.37 * k as f64).sin() + 0.5 * (1.93 * k as f64).sin();
        let row = |k: usize| core::array::from_fn(|i| number(29 * k + i));
        let block = |k: usize| block_of::<_, INPUTS>(&[0, 1, 2, 3].map(|lane| row(BLOCK * k + lane))).unwrap();
        let rows: [RowBlock<f64, INPUTS>; ROWS.div_ceil(BLOCK)] = core::array::from_fn(block);
        let weights: [f64; ROWS] = core::array::from_fn(|k| number(7 * k));
        // 21 rows: stripes of 21, 17, 13, 9, 5 and 1 columns.
        let mut columns = stripes(21, |i, j| 0.2 * number(3 * (21 * i + j)));
        let explained: [[f64; BLOCK]; 66] = core::array::from_fn(|_| columns.next().unwrap());
        let process = |length: f64| Process {
            relevance: core::array::from_fn(|i| (1.0 + 0.5 * number(11 * i)) / (length * length)),
            mean: 0.1,
            weights: &weights,
            explained: Triangle::new(&explained, 21),
            variance: 0.4,
            noise: 0.01,
            widening: 1.2,
            least_variance: 0.3,
        };
        let scales = [InputScale { mean: 0.1, sd: 0.8, lower: -1.0, upper: 1.2 }; INPUTS];
        let correction = Correction {
            rows: InputRows::new(&rows, ROWS),
            scales: &scales,
            direct: process(2.0),
            one_sided: [(process(1.5), OUTPUTS), (process(0.7), OUTPUTS + FEATURES + 1)]
                .map(|(process, first)| OneSided { process, first }),
            residual: process(3.0),
            simulated: Some(Simulated {
                rows: InputRows::new(&rows[3..], ROWS - 3 * BLOCK),
                scales: &scales,
                process: process(2.5),
            }),
            limits: StrainRange { lower: -9.0, upper: 9.0 },
            strain_variance: 0.7,
            variance_factor: 1.1,
        };
        for trial in 0..100 {
            let inputs = core::array::from_fn(|i| number(1000 + 31 * trial + i));
            let filtered = Gaussian { mean: inputs[0], variance: 0.1 };
            let number_by_number =
                Correcting { correction: &correction, inputs: &inputs, filtered, birge: 1.7 }.with_lanes(0.0);
            assert_eq!(correction.correct(&inputs, filtered, 1.7), number_by_number, "{trial}");
        }
    }
}
