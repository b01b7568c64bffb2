use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, StrainRange};

use crate::belief::gaussian::Real;
use crate::belief::tail::upper_tail;
use crate::kernel::{Parts, RateSpread};
use crate::mixture::LEAST_INSIDE;
use crate::mixture::predicted::Predicted;
use crate::{Curve, Innovation, Reading, Residual, SparseEkf, StepError, Switch};

/// What weighs hypotheses, in every filter that keeps some.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Evidence<T> {
    /// Strains beyond these limits are unlikely.
    pub limits: StrainRange<T>,
    /// Power, 0 to 1, to which the likelihood of a reading enters the weights; below 1 it allows for model error that is
    /// correlated from reading to reading.
    pub tempering: T,
}

impl<T: Scalar> Evidence<T> {
    /// Limits and tempering, checked.
    ///
    /// # Errors
    /// If the limits are not in order, or the tempering is not a number from 0 to 1.
    pub fn new(limits: StrainRange<T>, tempering: T) -> Result<Self, ParameterError> {
        if !(limits.lower < limits.upper) {
            return Err(ParameterError::new("limits", Problem::OutOfRange));
        }
        if !(tempering >= T::zero() && tempering <= T::one()) {
            return Err(ParameterError::new("tempering", Problem::OutOfRange));
        }
        Ok(Self { limits, tempering })
    }
}

/// [`Evidence`] in factors instead of logarithms.
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
        let rounding = T::default_epsilon();
        let clear = T::of(-2.0) * rounding.ln();
        Self { limits: evidence.limits, tempering: evidence.tempering, clear }
    }

    /// A prior probability times the likelihood of a reading to the power of the tempering, without the constant
    /// `(2π)^(-tempering/2)`.
    #[inline(always)]
    pub(crate) fn likelihood<S: Switch<T>>(&self, prior: T, residual: &Residual<T>) -> Weight<T> {
        let half = T::of(-0.5) * self.tempering;
        if self.tempering == T::one() {
            return Weight { factor: prior / S::root(residual.variance), exponent: half * residual.nis };
        }
        Weight { factor: prior, exponent: half * (residual.nis + residual.variance.ln()) }
    }

    /// Probability that a strain lies within the limits.
    #[inline(always)]
    pub(crate) fn inside<S: Switch<T>>(&self, strain: T, variance: T) -> T {
        let (above_lower, below_upper) = (strain - self.limits.lower, self.limits.upper - strain);
        let reach = self.clear * variance;
        let clear = |distance: T| distance > T::zero() && distance * distance > reach;
        if variance <= T::zero() || (clear(above_lower) && clear(below_upper)) {
            return T::one();
        }
        self.inside_near::<S>(above_lower, below_upper, variance)
    }

    /// The same where a tail counts. What has left the limits altogether is no less likely than [`LEAST_INSIDE`].
    #[inline(never)]
    fn inside_near<S: Switch<T>>(&self, above_lower: T, below_upper: T, variance: T) -> T {
        let per_sd = T::one() / S::root(variance);
        let (near, far) =
            if above_lower < below_upper { (above_lower, below_upper) } else { (below_upper, above_lower) };
        let far_is_clear = far > T::zero() && far * far > self.clear * variance;
        let beyond_far = if far_is_clear { T::zero() } else { upper_tail(far * per_sd) };
        // Beyond the near end the mass inside is the small number, and is to keep its digits.
        let inside = if near > T::zero() {
            T::one() - (upper_tail(near * per_sd) + beyond_far)
        } else {
            upper_tail(-near * per_sd) - beyond_far
        };
        let least = T::of(LEAST_INSIDE);
        if inside > least { inside } else { least }
    }

    /// Probability of the limits over what `per_inside` is one over, and one over the probability itself.
    #[inline(always)]
    pub(crate) fn of_limits<S: Switch<T>, const B: usize>(&self, parts: &Parts<T, B>, per_inside: T) -> (T, T) {
        let inside = self.inside::<S>(parts.strain, parts.strain_variance);
        // Mostly nothing is near a limit.
        if inside == T::one() { (per_inside, inside) } else { (inside * per_inside, T::one() / inside) }
    }

    pub(crate) fn tempering(&self) -> T {
        self.tempering
    }

    /// Squared deviations beyond which a tail does not count.
    pub(crate) fn clear(&self) -> T {
        self.clear
    }
}

/// What a child counts for.
pub(crate) struct Weighed<T> {
    /// Its prior probability times the likelihood of the reading.
    pub weight: Weight<T>,
    /// Its probability of the limits over its parent's, which weighs it too but says nothing of the reading.
    pub more_inside: T,
    /// One over the probability itself.
    pub per_inside: T,
}

/// A child that has been predicted, before the reading.
pub(crate) struct Newborn<T: Real, S: Switch<T>> {
    pub phase: Phase,
    pub prior: T,
    /// What its prediction returned.
    pub spread: RateSpread<T, S>,
    /// One over its parent's probability of the limits.
    pub per_inside: T,
}

impl<T: Real, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Gives a child the reading.
    #[inline(always)]
    pub(crate) fn weigh(
        &self,
        child: &mut Parts<T, B>,
        newborn: Newborn<T, S>,
        reading: Option<Reading<T>>,
        weighing: &Weighing<T>,
        predicted: &mut Predicted<T>,
    ) -> Result<Weighed<T>, StepError> {
        let Newborn { phase, prior, spread, per_inside } = newborn;
        let mut weight = Weight { factor: prior, exponent: T::zero() };
        if let Some(reading) = reading {
            let residual = self.update(child, reading, Some(phase), spread)?;
            weight = weighing.likelihood::<S>(prior, &residual);
            predicted.add(prior, residual.innovation, residual.variance);
        } else if !child.is_sound::<N>(child.variances::<N>()) {
            return Err(StepError::NonFiniteState);
        }
        let (more_inside, per_inside) = weighing.of_limits::<S, B>(child, per_inside);
        Ok(Weighed { weight, more_inside, per_inside })
    }
}

/// How a reading compares with the prediction of a whole mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureResidual<T> {
    /// Reading minus the mixture's mean of it, and the mixture's variance of it.
    pub residual: Residual<T>,
    /// The density, less what does not depend on the reading, as a weight.
    factor: T,
    exponent: T,
    tempering: T,
}

impl<T: Scalar> MixtureResidual<T> {
    /// `density`: sum of all prior weights times likelihoods.
    pub(crate) fn new(predicted: &Predicted<T>, density: Weight<T>, tempering: T) -> Self {
        let (innovation, variance) = predicted.moments();
        let residual = Residual { innovation, variance, nis: innovation * innovation / variance };
        Self { residual, factor: density.factor / *predicted.weight(), exponent: density.exponent, tempering }
    }

    /// Log density of the reading under the mixture, tempered if the filter tempers.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        self.factor.ln() + self.exponent - T::of(0.5) * self.tempering * T::two_pi().ln()
    }

    /// The same for [`Estimator`](crate::Estimator). What overflows a square is no reading.
    pub(crate) fn innovation(&self) -> Result<Innovation<T>, StepError> {
        let Residual { innovation, variance, nis } = self.residual;
        let innovation = Innovation { value: innovation, variance, log_likelihood: self.log_likelihood() };
        if nis.is_finite() { Ok(innovation) } else { Err(StepError::NonFiniteState) }
    }
}
