//! Uncertain path over a step of a rate whose sign is unknown, or that turns around within the step.
//!
//! Branches are driven by the path of the body, with a separate gain for each direction. A Gaussian gives the net
//! displacement and the probability of its direction; this module adds the mean and variance of the remaining path.

use nalgebra::SVector;

use crate::motion::MOTION_STATES as M;
use crate::phase::{Direction, Turning};
use crate::{Branch, Motion, Phase, Scalar, SwitchedModel, SwitchedStep, Symmetric};

/// Smallest value used for `1 - r²` of neighbouring steps: a persistence of 10⁴ steps.
pub const LEAST_LEFT: f64 = 2e-4;

/// Mean path beyond the net displacement, in the direction of the final sign, ¼, for a Brownian rate that passes zero
/// with unit density and changes by one standard deviation over a step of unit length. The constant below is the
/// variance of that path given the rates at both ends, from simulation.
const BROWNIAN_EXCESS: f64 = 0.25;
const BROWNIAN_VARIANCE: f64 = 0.0537;
/// Distance from zero at which a rate that turns around starts, in standard deviations of its change over the step. If the density
/// falls off within that distance, fewer rates turn around. 1.27 for an exponential density, 0 for a flat one.
const REACH: f64 = 0.6;
/// Mean excess path, as a fraction of w², of a rate that changes evenly by w and crosses zero. The path beyond the net
/// displacement is `a²/w` if `a` of w lies beyond zero, on average `w/3`; the probability of crossing is w.
const EVEN_EXCESS: f64 = 1.0 / 3.0;
/// Deviations from zero at which no rate turns around.
const CLEAR: f64 = 4.5;
/// Longest step, as a fraction of the correlation time of the rate.
const LONGEST: f64 = 1.0 / 3.0;
/// 1/√(2π).
const NORMAL_DENSITY: f64 = 0.398_942_280_401_432_7;

/// Returns the factor on the persistence for a step that is not short compared with the correlation time of the rate.
/// With it, the variance due to the uncertain direction grows at the same rate without readings, whatever the step
/// length. A rate with white acceleration correlates as exp(-t/T_v), its direction as the square of that; the sum over
/// steps is coth(h/T_v).
pub(crate) fn averaging<T: Scalar>(motion: &Motion<T>, dt_s: T) -> T {
    let x = dt_s * motion.restoring()[1];
    if x < T::of(1e-3) { T::one() } else { x.tanh() / x }
}

impl<T: Scalar> Direction<T> {
    /// Returns the factor by which the variance over steps exceeds that of errors independent from step to step.
    pub(crate) fn persistence(self) -> T {
        if let Self::Uncertain { persistence, .. } = self { persistence } else { T::one() }
    }
}

impl<T: Scalar, const B: usize, const N: usize> SwitchedModel<T, B, N> {
    /// Returns the direction over a step given one Gaussian, from the covariance at the step's start.
    ///
    /// The rate's variance is that in the middle of the step. The error of the linearised switch follows the error of the
    /// rate, and lasts as long: the squared correlations of that error from step to step are summed as a geometric
    /// series.
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

    /// Longest step, s, for which the uncertainty due to direction is computed accurately: a third of the correlation time of
    /// the rate. Infinite if the gains of stretching and releasing are equal.
    #[must_use]
    pub fn longest_step_s(&self) -> T {
        let same = |branch: &Branch<T>| {
            branch.extend_gain == branch.retract_gain && branch.extend_gain_slope == branch.retract_gain_slope
        };
        let per_time = self.motion().restoring()[1];
        if self.law().branches.iter().all(same) { T::one() / T::zero() } else { T::of(LONGEST) / per_time }
    }

    /// Returns the excess path of a rate whose sign is known at the start and at the end of a step.
    ///
    /// The density of the rate at zero determines how often it turns around. The density of a belief truncated there lies between
    /// an exponential and the Gaussian: `exp(1 - u²)/σ` at u deviations has both as limits, and is 2 % off for one half of a
    /// Gaussian.
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

/// Returns `(1 + r²)/(1 - r²)`, the sum of squared correlations over all steps, for a rate whose errors at both ends of a
/// step have correlation r. `ahead` is the variance at the end, `together` the covariance of both ends, and `fresh` their
/// difference, which the caller computes without subtraction.
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
    /// Mean, 1/s.
    pub expected: T,
    /// Variance due to the uncertainty at the start of the step, 1/s².
    pub spread: T,
    /// Variance due to process noise over the step, as of a Brownian rate, 1/s².
    pub noise: T,
}

/// Constants of [`Turning::new`], for programs that generate it in another language.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurningNumbers {
    /// Deviations from zero at which no rate turns around.
    pub clear: f64,
    /// Distance from zero at which a rate that turns around starts, in standard deviations of its change.
    pub reach: f64,
    /// Excess path of an even change, divided by the product of the change and its probability.
    pub even_excess: f64,
    /// Excess of a Brownian rate, and its variance.
    pub brownian: (f64, f64),
    /// 1/√(2π).
    pub normal_density: f64,
}

/// Constants of [`Turning::new`].
pub const TURNING: TurningNumbers = TurningNumbers {
    clear: CLEAR,
    reach: REACH,
    even_excess: EVEN_EXCESS,
    brownian: (BROWNIAN_EXCESS, BROWNIAN_VARIANCE),
    normal_density: NORMAL_DENSITY,
};

impl<T: Scalar> Turning<T> {
    /// Computes the excess path of a rate, positive away from zero, with its variance. A microcontroller passes its own square root
    /// as `root`.
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
        // Half of an even change of unknown sign is toward zero.
        let evenly = T::of(EVEN_EXCESS) * (even + T::of(0.5) * spread);
        let by_chance = T::of(BROWNIAN_EXCESS) * noise;
        Self {
            excess: density * (evenly + by_chance),
            variance: T::of(BROWNIAN_VARIANCE) * density * total * change_sd / thinner,
        }
    }
}
