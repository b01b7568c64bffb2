//! The learned correction: strain from a filter's outputs and the readings' recent past, by two Gaussian processes.
//!
//! The law's error is systematic, and the strain's error that it causes can be learned from the rows that a sensor was
//! calibrated on. A *direct* process predicts strain from features of the readings alone; a *residual* process predicts the error
//! of the filter's strain, from the filter's outputs and the same features. A smoother has two more direct processes, one
//! of the readings' past and one of their future: neither is as easily led astray by a motion that begins as a known one
//! and ends as another. Their predictions are combined by [`consensus`]. Far from the training rows the residual process returns the
//! filter's strain, its variance is no smaller than the filter's, and the mixture's grows. There a last process counts, which
//! has learned the law's answer to motions that the sensor was not seen in. It cannot lose its way as a filter can.
//!
//! # Policy
//! - Configuration, borrowed as slices that may lie in flash, is apart from state ([`ReadingFeatures`]); no heap, no panic.
//! - Inputs are moved into the range of the training rows; how far they were outside makes the variance grow. Numbers that
//!   are not finite come from nowhere but a filter that has failed, and give a result that is not finite.
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
pub use low_pass::{Decay, LowPass};
use process::{Kernels, Prediction};
pub use process::{LINEAR, Process, kernel};
pub use quadratic::Quadratic;
pub use rows::{BLOCK, InputRows, RowBlock, block_of};
pub use triangle::{Triangle, stripe_places, stripes};

/// Number of a filter's outputs that a correction sees: strain, its rate, relaxation, baseline, and the probabilities of
/// stretching and releasing.
pub const OUTPUTS: usize = 6;
/// Inputs of a filter's correction: its outputs, and the features of the readings up to now.
pub const FILTER_INPUTS: usize = OUTPUTS + FEATURES;
/// The inputs of a filter's correction.
#[must_use]
pub fn filter_inputs<T: Real>(outputs: &[T; OUTPUTS], features: &[T; FEATURES]) -> [T; FILTER_INPUTS] {
    let mut inputs = [T::zero(); FILTER_INPUTS];
    inputs.iter_mut().zip(outputs.iter().chain(features)).for_each(|(place, input)| *place = *input);
    inputs
}

/// Most inducing rows.
pub const INDUCING: usize = 64;

/// Variance per square of the inputs' distance from the training range, in variances of the strain; in this distance a standard
/// deviation of the first input that a process sees counts as one, the others by their relevance.
const FAR: f64 = 0.03;
/// Variance of a result whose inputs are nothing like the training rows, in variances of the strain, on top of all else.
const NOVEL: f64 = 0.06;
/// The square of that distance beyond which inputs are new.
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
    /// An input on this scale, moved into the range, and the square of how far it was outside.
    #[inline(always)]
    pub(crate) fn standardised(&self, input: T) -> (T, T) {
        let inside = input.max(self.lower).min(self.upper);
        let excess = (input - inside) / self.sd;
        ((inside - self.mean) / self.sd, excess * excess)
    }
}

/// A learned correction with D inputs: the filter's [`OUTPUTS`], then features of the readings, those of their future last.
/// S is 2 if it has one-sided processes, a smoother's, and 0 otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, T, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first are the inducing rows, at most [`INDUCING`].
    pub rows: InputRows<'a, T, D>,
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// Strain from all features; outputs of the filter are not seen, whatever their relevance.
    pub direct: Process<'a, T, D>,
    /// Strain from features of the past, and strain from features of the future. Neither sees outputs.
    pub one_sided: [OneSided<'a, T, D>; S],
    /// Strain minus the filter's strain, from all inputs.
    pub residual: Process<'a, T, D>,
    /// Strain from the features, as the law has it where the sensor has not been.
    pub simulated: Option<Simulated<'a, T, D>>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance, from training rows left out.
    pub variance_factor: T,
}

/// A process that sees features of one side of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneSided<'a, T, const D: usize> {
    /// The Gaussian process.
    pub process: Process<'a, T, D>,
    /// The input that the linear part of its kernel takes.
    pub first: usize,
}

/// A process that sees features alone, of readings that a law gave in simulated motions. Its variance is its noise.
#[derive(Clone, Copy, Debug)]
pub struct Simulated<'a, T, const D: usize> {
    /// Standardised inputs of the rows; outputs of a filter are not seen.
    pub rows: InputRows<'a, T, D>,
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// The Gaussian process of the rows.
    pub process: Process<'a, T, D>,
}

/// A corrected strain and what it was made of.
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
    /// Novelty: 0 if the inputs resemble the training rows, 1 if they do not at all.
    pub novelty: T,
}

/// An input on the scale of the training rows.
struct Standardised<T, const D: usize> {
    /// Moved into their range.
    inputs: [T; D],
    /// Squares of how far it was outside.
    outside: [T; D],
}

impl<T: Real, const D: usize, const S: usize> Correction<'_, T, D, S> {
    /// Corrects the strain of a filter. `inputs` are the filter's outputs, the strain first, and the features of the
    /// readings; `filtered` is the filter's strain with its deviation; `birge` is by how much its innovations have been larger than it
    /// states, a factor on the variance of all that has learned from it.
    #[must_use]
    pub fn correct(&self, inputs: &[T; D], filtered: Gaussian<T>, birge: T) -> Corrected<T, S> {
        let work = Correcting { correction: self, inputs, filtered, birge };
        T::in_vectors(work).unwrap_or_else(|| work.with_lanes(T::zero()))
    }

    /// Inputs on the scale of the training rows, moved into their range.
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

    /// The residual process beside a filter: it knows no more than that one where nothing is known.
    pub(crate) fn residual_beside(&self, filtered: Gaussian<T>) -> Process<'_, T, D> {
        Process { least_variance: self.residual.least_variance.max(filtered.variance), ..self.residual }
    }

    /// Returns the corrected strain from the mixture of the members.
    pub(crate) fn learned(&self, mixed: Gaussian<T>, novelty: T, birge: T) -> Gaussian<T> {
        let variance = mixed.variance * self.variance_factor + T::of(NOVEL) * self.strain_variance * novelty;
        let anywhere = self.limits.variance_of_anywhere();
        Gaussian { mean: mixed.mean, variance: (variance * birge).min(anywhere).max(variance) }
    }

    /// A process' strain on top of `base`, within the limits, with all that its variance gets.
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

/// An input; zero where there is none.
fn at<T: Recordable, const D: usize>(inputs: &[T; D], place: usize) -> T {
    inputs.get(place).copied().unwrap_or(T::zero())
}

/// The correction of one strain; training rows stand in lanes.
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

/// Combines the members of a correction. A filter's two members are combined as a [`mixture`]. A smoother's are, too, after each member's
/// variance has grown by the part of its squared distance from the mixture of the others that both variances do not explain. Of four
/// members with different inputs, one that contradicts all others is more likely wrong than it states; of two, nobody knows which
/// one is wrong.
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

/// Mean and variance of the mixture of Gaussians, each weighted by its variance to the power −3/2: more than the inverse
/// variance that is due to independent members, since several may be wrong together, and the surest is the least so. One that is
/// exact is all that counts; nothing mixed is exactly zero.
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

    /// Three rows more than fill vectors, inducing rows that do not.
    #[test]
    fn vectors_of_training_rows_say_what_numbers_say() {
        const ROWS: usize = 4 * INDUCING + 3;
        const INPUTS: usize = OUTPUTS + FEATURES + 2;
        let number = |k: usize| (0.37 * k as f64).sin() + 0.5 * (1.93 * k as f64).sin();
        let row = |k: usize| core::array::from_fn(|i| number(29 * k + i));
        let block = |k: usize| block_of::<_, INPUTS>(&[0, 1, 2, 3].map(|lane| row(BLOCK * k + lane))).unwrap();
        let rows: [RowBlock<f64, INPUTS>; ROWS.div_ceil(BLOCK)] = core::array::from_fn(block);
        let weights: [f64; ROWS] = core::array::from_fn(|k| number(7 * k));
        // 21 rows: stripes of 21, 17, 13, 9, 5 columns and of one.
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
