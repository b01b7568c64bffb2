//! Path that the direction of motion leaves open over a step: of a rate whose sign is not known, or that turns around on the way.
//!
//! Branches are driven by the path of the body, each way with a gain of its own. A Gaussian knows the net move and
//! the probability of its direction; this module adds the rest of the path, as a mean and a variance.

use nalgebra::SVector;

use crate::motion::MOTION_STATES as M;
use crate::phase::{Direction, Turning};
use crate::{Branch, Motion, Phase, Scalar, SwitchedModel, SwitchedStep, Symmetric};

/// `1 - r²` of neighbouring steps from which on it counts as no less: a persistence of 10⁴ steps.
pub const LEAST_LEFT: f64 = 2e-4;

/// Mean path beyond the net move with the sign at the end, ¼, for a Brownian rate that passes zero with unit density and
/// changes by one standard deviation over a step of unit length. Below, the variance of that path given the rates
/// at both ends, by simulation.
const BROWNIAN_EXCESS: f64 = 0.25;
const BROWNIAN_VARIANCE: f64 = 0.0537;
/// Distance from zero, in standard deviations of its change over the step, at which a rate starts that turns around: if its density
/// falls off within that distance, fewer rates turn around. 1.27 from an exponential density, 0 from a flat one.
const REACH: f64 = 0.6;
/// A rate that changes evenly by w and passes zero: the path beyond the net move's is `a²/w` if `a` of w lie beyond zero, in
/// the mean `w/3`; times the probability w that it passes.
const EVEN_EXCESS: f64 = 1.0 / 3.0;
/// Deviations from zero at which no rate turns around.
const CLEAR: f64 = 4.5;
/// Longest step over the time in which the rate changes.
const LONGEST: f64 = 1.0 / 3.0;
/// 1/√(2π).
const NORMAL_DENSITY: f64 = 0.398_942_280_401_432_7;

/// Factor on the steps' persistence for a step that is no longer short against the motion's memory. With it the variance
/// that the direction leaves open grows at one rate without readings, whatever the step. A rate with white acceleration
/// correlates as exp(-t/T_v) and its direction as the square of that, whose steps sum up to coth(h/T_v).
pub(crate) fn averaging<T: Scalar>(motion: &Motion<T>, dt_s: T) -> T {
    let x = dt_s * motion.restoring()[1];
    if x < T::of(1e-3) { T::one() } else { x.tanh() / x }
}

impl<T: Scalar> Direction<T> {
    /// Returns the factor by which variance over steps exceeds that of errors drawn anew in each.
    pub(crate) fn persistence(self) -> T {
        if let Self::Uncertain { persistence, .. } = self { persistence } else { T::one() }
    }
}

impl<T: Scalar, const B: usize, const N: usize> SwitchedModel<T, B, N> {
    /// Returns the direction over a step as one Gaussian knows it, from the covariance at the step's start.
    ///
    /// The rate's variance is that in the middle of the step. The error of the linearised switch follows the error of the
    /// rate, and lasts as long: the squares of that error's correlations from step to step are summed up, a
    /// geometric series.
    #[must_use]
    pub fn uncertain_direction<const L: usize>(
        &self,
        step: &SwitchedStep<T, B>,
        covariance: &Symmetric<T, N, L>,
    ) -> Direction<T> {
        let (now, ahead) = (covariance[(1, 1)].max(T::zero()), self.rate_variance(step, covariance));
        let rate_sd = (T::of(0.5) * (now + ahead)).sqrt();
        let steps = if !(ahead > T::zero() && step.dt_s() > T::zero()) {
            T::one()
        } else {
            let change = &step.response().motion_change[1];
            let with = |i: usize| (0..M).fold(covariance[(i, 1)], |sum, j| sum + change[j] * covariance[(i, j)]);
            let fresh = (0..M).fold(step.response().motion_noise[1][1], |sum, i| sum + change[i] * with(i));
            correlated_steps(ahead, with(1), fresh)
        };
        Direction::Uncertain { rate_sd, persistence: step.averaging * steps }
    }

    /// The longest step, s, for which what the direction leaves open is worked out well: a third of the time in which the rate
    /// changes. Infinite where stretching and releasing do the same.
    #[must_use]
    pub fn longest_step_s(&self) -> T {
        let same = |branch: &Branch<T>| {
            branch.extend_gain == branch.retract_gain && branch.extend_gain_slope == branch.retract_gain_slope
        };
        let per_time = self.motion().restoring()[1];
        if self.law().branches.iter().all(same) { T::one() / T::zero() } else { T::of(LONGEST) / per_time }
    }

    /// Returns the open path of a rate whose sign is known at the start of a step, and again at its end.
    ///
    /// The density of the rate at zero determines how often it turns around. The density of a belief that was cut there is not the
    /// Gaussian's, but between an exponential's and the Gaussian's: `exp(1 - u²)/σ` at u deviations has both ends, and is 2 % off for
    /// one half of a Gaussian.
    #[must_use]
    pub fn turning<const L: usize>(
        &self,
        step: &SwitchedStep<T, B>,
        mean: &SVector<T, N>,
        covariance: &Symmetric<T, N, L>,
        before: Phase,
    ) -> Turning<T> {
        let side = if before == Phase::Retract { -T::one() } else { T::one() };
        let change = &step.response().motion_change[1];
        let push = step.response().input[1] * self.push(Direction::Known(before));
        let expected = (0..M).fold(push, |sum, j| sum + change[j] * mean[j]);
        let mut spread = T::zero();
        for i in 0..M {
            for j in 0..M {
                spread += change[i] * change[j] * covariance[(i, j)];
            }
        }
        let noise = step.response().motion_noise[1][1];
        let change = RateChange { expected: side * expected, spread, noise };
        Turning::new(side * mean[1], covariance[(1, 1)], &change, |square| square.sqrt())
    }
}

/// `(1 + r²)/(1 - r²)` of a rate whose errors at both ends of a step correlate with r: squared correlations summed over all
/// steps. `ahead` is the variance at the end, `together` the covariance of both ends, `fresh` their difference, which the
/// caller has without subtracting them.
#[inline(always)]
pub fn correlated_steps<T: Scalar>(ahead: T, together: T, fresh: T) -> T {
    let (square, both) = (ahead * ahead, together * together);
    let both = if both < square { both } else { square };
    let (left, least) = (fresh * (ahead + together), T::of(LEAST_LEFT) * square);
    (square + both) / if left > least { left } else { least }
}

/// Change of a rate over a step, positive away from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RateChange<T> {
    /// Expected, 1/s.
    pub expected: T,
    /// Variance from what is not known at the start of the step, and from chance on the way; 1/s².
    pub spread: T,
    /// Variance from chance on the way, as of a Brownian rate.
    pub noise: T,
}

/// The numbers in [`Turning::new`], for programs that write it in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurningNumbers {
    /// Deviations from zero at which no rate turns around.
    pub clear: f64,
    /// Distance from zero at which a rate starts that turns around, in deviations of its change.
    pub reach: f64,
    /// Path beyond the net move's of an even change, over the product of the change and its probability.
    pub even_excess: f64,
    /// Excess of a Brownian rate, and its variance.
    pub brownian: (f64, f64),
    /// 1/√(2π).
    pub normal_density: f64,
}

/// The numbers in [`Turning::new`].
pub const TURNING: TurningNumbers = TurningNumbers {
    clear: CLEAR,
    reach: REACH,
    even_excess: EVEN_EXCESS,
    brownian: (BROWNIAN_EXCESS, BROWNIAN_VARIANCE),
    normal_density: NORMAL_DENSITY,
};

impl<T: Scalar> Turning<T> {
    /// Computes the open path of a rate, positive away from zero, with its variance. A microcontroller passes its own square root as `root`.
    #[inline(always)]
    pub fn new(rate: T, rate_variance: T, change: &RateChange<T>, root: impl Fn(T) -> T) -> Self {
        let zero = T::zero();
        if !(rate_variance > zero) || rate > zero && rate * rate > T::of(CLEAR * CLEAR) * rate_variance {
            return Self { excess: zero, variance: zero };
        }
        let per_sd = T::one() / root(rate_variance);
        let u = rate * per_sd;
        let square = if u > T::one() { u * u } else { T::one() };
        let cut = (T::one() - square).exp();
        let gaussian = T::of(NORMAL_DENSITY) * (T::of(-0.5) * square).exp();
        let density = if cut > gaussian { cut } else { gaussian } * per_sd;

        let RateChange { expected, spread, noise } = *change;
        let even = if expected < zero { expected * expected } else { zero };
        let total = noise + even + spread;
        let change_sd = root(total);
        let thinner = T::one() + T::of(REACH) * change_sd * per_sd;
        // Half of an even change of unknown sign leads toward zero.
        let evenly = T::of(EVEN_EXCESS) * (even + T::of(0.5) * spread);
        let by_chance = T::of(BROWNIAN_EXCESS) * noise;
        Self {
            excess: density * (evenly + by_chance),
            variance: T::of(BROWNIAN_VARIANCE) * density * total * change_sd / thinner,
        }
    }
}
