use ohmstrain_model::{Scalar, StrainRange};

use crate::gaussian::{Real, upper_tail};
use crate::mixture::LEAST_INSIDE;
use crate::{Evidence, Residual};

/// What weighs the Gaussians of a sparse mixture: as [`Evidence`] does, in factors instead of logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weighing<T> {
    limits: StrainRange<T>,
    tempering: T,
    /// Squared number of deviations beyond which a tail adds less to 1 than rounding: `Q(z) ≤ exp(-z²/2)/2 = ε/2`.
    clear: T,
}

/// A weight as `factor · exp(exponent)`: factors have the size of probabilities, exponents any.
#[derive(Clone, Copy)]
pub(crate) struct Weight<T> {
    pub factor: T,
    pub exponent: T,
}

impl<T: Real> Weight<T> {
    /// The weight in units of `exp(exponent)`, which is no smaller than its own exponential.
    #[inline(always)]
    pub(crate) fn relative_to(&self, exponent: T) -> T {
        let below = self.exponent - exponent;
        if below.is_zero() || self.factor.is_zero() { self.factor } else { self.factor * below.exp() }
    }
}

impl<T: Real> Weighing<T> {
    pub(crate) fn new(evidence: Evidence<T>) -> Self {
        let clear = T::of(-2.0) * T::default_epsilon().ln();
        Self { limits: evidence.limits, tempering: evidence.tempering, clear }
    }

    /// A prior probability times the likelihood of a reading to the power of the tempering, without the constant
    /// `(2π)^(-tempering/2)`.
    #[inline(always)]
    pub(crate) fn likelihood(&self, prior: T, residual: &Residual<T>) -> Weight<T> {
        let half = T::of(-0.5) * self.tempering;
        if self.tempering == T::one() {
            return Weight { factor: prior / residual.variance.sqrt(), exponent: half * residual.nis };
        }
        Weight { factor: prior, exponent: half * (residual.nis + residual.variance.ln()) }
    }

    /// Logarithm of the probability that a strain lies within the limits, as the generic filters have it.
    #[inline(always)]
    pub(crate) fn log_inside(&self, strain: T, variance: T) -> T {
        let (above_lower, below_upper) = (strain - self.limits.lower, self.limits.upper - strain);
        let reach = self.clear * variance;
        let clear = |distance: T| distance > T::zero() && distance * distance > reach;
        if variance <= T::zero() || (clear(above_lower) && clear(below_upper)) {
            return T::zero();
        }
        self.log_inside_near(above_lower, below_upper, variance)
    }

    /// The same where a tail counts.
    #[inline(never)]
    fn log_inside_near(&self, above_lower: T, below_upper: T, variance: T) -> T {
        let per_sd = T::one() / variance.sqrt();
        // The end that is nearer, or beyond which the strain lies, decides which side keeps its digits.
        let (near, far) =
            if above_lower < below_upper { (above_lower, below_upper) } else { (below_upper, above_lower) };
        let outside =
            if far > T::zero() && far * far > self.clear * variance { T::zero() } else { upper_tail(far * per_sd) };
        (upper_tail(-near * per_sd) - outside).max(T::of(LEAST_INSIDE)).ln()
    }

    pub(crate) fn tempering(&self) -> T {
        self.tempering
    }

    /// Squared deviations beyond which a tail does not count.
    pub(crate) fn clear(&self) -> T {
        self.clear
    }
}

/// How a reading compares with the prediction of a whole mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureResidual<T> {
    /// Reading minus the mixture's mean of it, and the mixture's variance of it.
    pub residual: Residual<T>,
    /// The density, less what does not depend on the reading, as a weight.
    pub(crate) factor: T,
    pub(crate) exponent: T,
    pub(crate) tempering: T,
}

impl<T: Scalar> MixtureResidual<T> {
    /// Log density of the reading under the mixture, limits and tempering included: what
    /// [`MixtureStep`](crate::MixtureStep) calls by this name.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        self.factor.ln() + self.exponent - T::of(0.5) * self.tempering * T::two_pi().ln()
    }
}

/// Gathers the residuals of all predictions. Sums are taken of innovations, not of predicted readings: a variance is not
/// to be the small difference of two squares.
#[derive(Clone, Copy)]
pub(crate) struct Predicted<T> {
    weight: T,
    innovation: T,
    square: T,
}

impl<T: Real> Predicted<T> {
    pub(crate) fn new() -> Self {
        Self { weight: T::zero(), innovation: T::zero(), square: T::zero() }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, weight: T, residual: &Residual<T>) {
        self.weight += weight;
        self.innovation += weight * residual.innovation;
        self.square += weight * (residual.variance + residual.innovation * residual.innovation);
    }

    /// `total`: sum of all weights after the reading.
    pub(crate) fn residual(&self, total: Weight<T>, tempering: T) -> MixtureResidual<T> {
        let per_weight = T::one() / self.weight;
        let innovation = self.innovation * per_weight;
        let variance = self.square * per_weight - innovation * innovation;
        let Weight { factor, exponent } = total;
        let nis = innovation * innovation / variance;
        MixtureResidual { residual: Residual { innovation, variance, nis }, factor, exponent, tempering }
    }
}
