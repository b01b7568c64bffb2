//! The learned correction: strain from a filter's outputs and the readings' recent past, by two Gaussian processes.
//!
//! The law's error is systematic, and what it leaves of the strain can be learned from the rows that a sensor was
//! calibrated on. A *direct* process says strain from features of the readings alone; a *residual* process says what the
//! filter's strain lacks, from what the filter says and the same features. A smoother has two more direct processes, one
//! of the readings' past and one of their future: neither is as easily led astray by a motion that begins as a known one
//! and ends as none. The result is the [`mixture`] of all. Far from the training rows the residual process says what the
//! filter says, its variance is no smaller than the filter's, and the result's grows.
//!
//! # Policy
//! - Configuration, borrowed as slices that may lie in flash, is apart from state ([`ReadingFeatures`]); no heap, no panic.
//! - Inputs are moved into the range of the training rows; how far they were outside makes the variance grow. Numbers that
//!   are not finite come from nowhere but a filter that has failed, and give a result that is not finite.
//! - With n rows of D inputs, m inducing rows and p processes a correction costs about n (3 D + p exp) + p m²/2
//!   multiplications.

mod features;
mod low_pass;
mod process;

use ohmstrain_model::StrainRange;

use crate::kernel::{Lanes, MOST_LANES, Several, Work};
use crate::{Gaussian, Real};
pub use features::{
    FARTHEST, FEATURES, FeatureScale, PASSED_OVER, RATE_GAIN, ReadingFeatures, Starts, TIME_CONSTANTS_S, settled,
};
pub use low_pass::LowPass;
use process::{Kernels, Said};
pub use process::{LINEAR, Process, kernel};

/// Number of a filter's outputs that a correction sees: strain, its rate, relaxation, baseline, and the probabilities of
/// stretching and releasing.
pub const OUTPUTS: usize = 6;
/// With the features of the readings up to now.
const FILTER_INPUTS: usize = OUTPUTS + FEATURES;
/// Most inducing rows.
pub const INDUCING: usize = 48;

/// Variance per square of a standardised input's distance from the training range, in variances of the strain.
pub const FAR: f64 = 0.03;
/// Variance of a result whose inputs are nothing like the training rows, in variances of the strain, on top of all else.
pub const NOVEL: f64 = 0.06;
/// Squared distance from the training range beyond which an input is new, in squared standard deviations.
pub const NEW: f64 = 5.0;

/// Where an input lay in the training rows.
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

/// A learned correction with D inputs: the filter's [`OUTPUTS`], then features of the readings, those of their future last.
/// S is 2 if it has one-sided processes, a smoother's, and 0 otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Correction<'a, T, const D: usize, const S: usize = 0> {
    /// Standardised inputs of the training rows; the first are the inducing rows, at most [`INDUCING`].
    pub rows: &'a [[T; D]],
    /// Scales of the inputs.
    pub scales: &'a [InputScale<T>; D],
    /// Strain from all features.
    pub direct: Process<'a, T>,
    /// Strain from the features of the past, and strain from the reading and the features of the future.
    pub one_sided: [Process<'a, T>; S],
    /// Strain minus the filter's strain, from all inputs.
    pub residual: Process<'a, T>,
    /// Limits of the output.
    pub limits: StrainRange<T>,
    /// Variance of the strain over the training rows.
    pub strain_variance: T,
    /// Factor on the mixture's variance, from training rows left out.
    pub variance_factor: T,
}

/// A corrected strain and what it was made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corrected<T, const S: usize = 0> {
    /// The result.
    pub strain: Gaussian<T>,
    /// What the direct process says.
    pub direct: Gaussian<T>,
    /// What the one-sided processes say.
    pub one_sided: [Gaussian<T>; S],
    /// What filter and residual process say together.
    pub residual: Gaussian<T>,
    /// How little the inputs resemble the training rows, 0 to 1.
    pub novelty: T,
}

/// An input on the scale of the training rows.
struct Standardised<T, const D: usize> {
    inputs: [T; D],
    /// From the training range.
    outside: SquaredDistance<T>,
}

/// A squared distance of inputs, in parts.
struct SquaredDistance<T> {
    outputs: T,
    reading: T,
    /// With the reading.
    past: T,
    /// Without it.
    future: T,
}

impl<V: Lanes> SquaredDistance<V> {
    /// Of inputs, of which there are `D`, that are so far apart.
    #[inline(always)]
    fn new<const D: usize>(zero: V, apart: impl Fn(usize) -> V) -> Self {
        let (mut outputs, mut reading, mut past, mut future) = (zero, zero, zero, zero);
        for i in 0..D {
            let apart = apart(i);
            let square = apart * apart;
            if i < OUTPUTS {
                outputs += square;
            } else if i == OUTPUTS {
                (reading, past) = (square, square);
            } else if i < FILTER_INPUTS {
                past += square;
            } else {
                future += square;
            }
        }
        Self { outputs, reading, past, future }
    }

    #[inline(always)]
    fn of_features(&self) -> V {
        self.past + self.future
    }

    #[inline(always)]
    fn of_all(&self) -> V {
        self.outputs + self.of_features()
    }

    /// Of what the one-sided processes see.
    #[inline(always)]
    fn of_sides(&self) -> [V; 2] {
        [self.past, self.reading + self.future]
    }
}

impl<T: Real, const D: usize, const S: usize> Correction<'_, T, D, S> {
    /// Corrects the strain of a filter. `inputs` are the filter's outputs, the strain first, and the features of the
    /// readings; `filtered` is the filter's strain with its deviation.
    #[must_use]
    pub fn correct(&self, inputs: &[T; D], filtered: Gaussian<T>) -> Corrected<T, S> {
        let work = Correcting { correction: self, inputs, filtered };
        T::in_vectors(work).unwrap_or_else(|| work.with_lanes(T::zero()))
    }

    #[inline(always)]
    fn standardised(&self, inputs: &[T; D]) -> Standardised<T, D> {
        let (mut x, mut excess) = ([T::zero(); D], [T::zero(); D]);
        for ((x, excess), (input, scale)) in x.iter_mut().zip(&mut excess).zip(inputs.iter().zip(self.scales)) {
            let inside = input.max(scale.lower).min(scale.upper);
            *x = (inside - scale.mean) / scale.sd;
            *excess = (*input - inside) / scale.sd;
        }
        Standardised { inputs: x, outside: SquaredDistance::new::<D>(T::zero(), |i| excess[i]) }
    }

    /// A process' strain on top of `base`, within the limits, with all that its variance gets.
    fn widened(&self, said: Said<T>, process: &Process<'_, T>, outside: T, base: T) -> Gaussian<T> {
        let variance = said.strain.variance * process.widening + T::of(FAR) * self.strain_variance * outside;
        Gaussian { mean: self.limits.clamp(base + said.strain.mean), variance }
    }
}

/// The correction of one strain; training rows stand in lanes.
#[derive(Clone, Copy)]
struct Correcting<'a, T, const D: usize, const S: usize> {
    correction: &'a Correction<'a, T, D, S>,
    inputs: &'a [T; D],
    filtered: Gaussian<T>,
}

impl<T: Real, const D: usize, const S: usize> Work<T> for Correcting<'_, T, D, S> {
    type Said = Corrected<T, S>;

    #[inline(always)]
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> Corrected<T, S> {
        let Self { correction: of, inputs, filtered } = self;
        let Standardised { inputs: x, outside } = of.standardised(inputs);
        let (mut direct, mut residual) = (Kernels::new(&of.direct), Kernels::new(&of.residual));
        let mut sides = of.one_sided.each_ref().map(Kernels::new);
        let of_residual = Process { least_variance: of.residual.least_variance.max(filtered.variance), ..of.residual };
        let (reading, strain) = (x.get(OUTPUTS).copied().unwrap_or(T::zero()), x[0]);
        for rows in of.rows.chunks(V::WIDTH) {
            let Some(first) = rows.first() else { break };
            // Lanes that are left have the first one's numbers.
            let mut side_by_side = [first; MOST_LANES];
            for lane in 1..V::WIDTH {
                side_by_side[lane] = rows.get(lane).unwrap_or(first);
            }
            let column = |i: usize| {
                let [column] = like.build(|lane| [side_by_side[lane].get(i).copied().unwrap_or(T::zero())]);
                column
            };
            let distance = SquaredDistance::new::<D>(like.nothing(), |i| like.with(x[i]) - column(i));
            let readings = column(OUTPUTS).scale(reading);
            direct.add(&of.direct, distance.of_features(), readings, rows.len());
            for ((kernels, process), square) in sides.iter_mut().zip(&of.one_sided).zip(distance.of_sides()) {
                kernels.add(process, square, readings, rows.len());
            }
            residual.add(&of.residual, distance.of_all(), column(0).scale(strain), rows.len());
        }
        let direct = of.widened(direct.said(like, &of.direct, reading), &of.direct, outside.of_features(), T::zero());
        let mut of_sides = of.one_sided.iter().zip(outside.of_sides());
        let one_sided = sides.map(|kernels| match of_sides.next() {
            Some((process, outside)) => of.widened(kernels.said(like, process, reading), process, outside, T::zero()),
            None => direct,
        });
        let said = residual.said(like, &of_residual, strain);
        let novelty = T::one() - (T::one() - said.unknown) * (-outside.of_all() / T::of(NEW)).exp();
        let residual = of.widened(said, &of.residual, outside.of_all(), filtered.mean);
        let mixed = mixture([direct, residual].into_iter().chain(one_sided));
        let variance = mixed.variance * of.variance_factor + T::of(NOVEL) * of.strain_variance * novelty;
        Corrected { strain: Gaussian { mean: mixed.mean, variance }, direct, one_sided, residual, novelty }
    }
}

/// Mean and variance of the mixture of Gaussians, each weighted by its variance to the power −3/2: more than the inverse
/// variance that is due to independent voices, since several may be wrong together, and the surest is the least so. One that is
/// exact is all that counts; nothing mixed is exactly zero.
#[must_use]
pub fn mixture<T: Real>(voices: impl IntoIterator<Item = Gaussian<T>, IntoIter: Clone>) -> Gaussian<T> {
    let voices = voices.into_iter();
    let none = Gaussian { mean: T::zero(), variance: T::zero() };
    let surest = voices.clone().reduce(|a, b| if b.variance < a.variance { b } else { a }).unwrap_or(none);
    if surest.variance <= T::zero() {
        return surest;
    }
    let weighted = |voice: Gaussian<T>| {
        let ratio = surest.variance / voice.variance;
        (ratio * ratio.sqrt(), voice)
    };
    let weighted = voices.map(weighted);
    let total = weighted.clone().fold(T::zero(), |sum, (weight, _)| sum + weight);
    let mean = weighted.clone().fold(T::zero(), |sum, (weight, voice)| sum + weight / total * voice.mean);
    let spread = |voice: Gaussian<T>| voice.variance + (voice.mean - mean) * (voice.mean - mean);
    let variance = weighted.fold(T::zero(), |sum, (weight, voice)| sum + weight / total * spread(voice));
    Gaussian { mean, variance }
}

#[cfg(all(test, feature = "simd"))]
mod tests {
    use super::{Correcting, Correction, FILTER_INPUTS, INDUCING, InputScale, Process, StrainRange};
    use crate::Gaussian;
    use crate::kernel::Work;

    /// Three rows more than fill vectors, inducing rows that do not.
    #[test]
    fn vectors_of_training_rows_say_what_numbers_say() {
        const ROWS: usize = 4 * INDUCING + 3;
        let number = |k: usize| (0.37 * k as f64).sin() + 0.5 * (1.93 * k as f64).sin();
        let rows: [[f64; FILTER_INPUTS + 2]; ROWS] =
            core::array::from_fn(|k| core::array::from_fn(|i| number(29 * k + i)));
        let weights: [f64; ROWS] = core::array::from_fn(|k| number(7 * k));
        let explained: [f64; 21 * 11] = core::array::from_fn(|k| 0.2 * number(3 * k));
        let process = |length: f64| Process {
            length,
            mean: 0.1,
            weights: &weights,
            explained: &explained,
            variance: 0.4,
            noise: 0.01,
            widening: 1.2,
            least_variance: 0.3,
        };
        let correction = Correction {
            rows: &rows,
            scales: &[InputScale { mean: 0.1, sd: 0.8, lower: -1.0, upper: 1.2 }; FILTER_INPUTS + 2],
            direct: process(2.0),
            one_sided: [process(1.5), process(0.7)],
            residual: process(3.0),
            limits: StrainRange { lower: -9.0, upper: 9.0 },
            strain_variance: 0.7,
            variance_factor: 1.1,
        };
        for trial in 0..100 {
            let inputs = core::array::from_fn(|i| number(1000 + 31 * trial + i));
            let filtered = Gaussian { mean: inputs[0], variance: 0.1 };
            let number_by_number = Correcting { correction: &correction, inputs: &inputs, filtered }.with_lanes(0.0);
            assert_eq!(correction.correct(&inputs, filtered), number_by_number, "{trial}");
        }
    }
}
