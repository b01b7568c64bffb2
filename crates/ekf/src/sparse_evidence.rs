use ohmstrain_model::{Phase, Scalar, StrainRange};

use crate::gaussian::Real;
use crate::mixture::LEAST_INSIDE;
use crate::mixture_step::Predicted;
use crate::sparse_parts::Parts;
use crate::switch::RateSpread;
use crate::tail::upper_tail;
use crate::{Curve, Evidence, Reading, Residual, SparseEkf, StepError, Switch};

/// What weighs the Gaussians of a sparse mixture: as [`Evidence`] does, in factors instead of logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weighing<T> {
    limits: StrainRange<T>,
    tempering: T,
    /// Squared number of deviations beyond which a tail adds less to 1 than rounding: `Q(z) ≤ exp(-z²/2)/2 = ε/2`.
    clear: T,
    /// Below this, `ln(1 - x) = -x - x²/2` to rounding: the next term is `x³/3 = ε/2`.
    slight: T,
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
        let slight = ((T::of(1.5) * rounding).ln() / T::of(3.0)).exp();
        Self { limits: evidence.limits, tempering: evidence.tempering, clear, slight }
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

    /// Logarithm of the probability that a strain lies within the limits, as the generic filters have it.
    #[inline(always)]
    pub(crate) fn log_inside<S: Switch<T>>(&self, strain: T, variance: T) -> T {
        let (above_lower, below_upper) = (strain - self.limits.lower, self.limits.upper - strain);
        let reach = self.clear * variance;
        let clear = |distance: T| distance > T::zero() && distance * distance > reach;
        if variance <= T::zero() || (clear(above_lower) && clear(below_upper)) {
            return T::zero();
        }
        self.log_inside_near::<S>(above_lower, below_upper, variance)
    }

    /// The same where a tail counts.
    #[inline(never)]
    fn log_inside_near<S: Switch<T>>(&self, above_lower: T, below_upper: T, variance: T) -> T {
        let per_sd = T::one() / S::root(variance);
        let (near, far) =
            if above_lower < below_upper { (above_lower, below_upper) } else { (below_upper, above_lower) };
        let far_is_clear = far > T::zero() && far * far > self.clear * variance;
        let beyond_far = if far_is_clear { T::zero() } else { upper_tail(far * per_sd) };
        if near > T::zero() {
            let outside = upper_tail(near * per_sd) + beyond_far;
            if outside < self.slight {
                return -outside - T::of(0.5) * outside * outside;
            }
            return log_of_inside(T::one() - outside);
        }
        // Beyond the near end the mass inside is the small number, and is to keep its digits.
        log_of_inside(upper_tail(-near * per_sd) - beyond_far)
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
    /// Growth of the logarithm of its probability of the limits, which weighs it too but says nothing of the reading.
    pub more_inside: T,
    /// The logarithm itself.
    pub log_inside: T,
}

/// A child that has been predicted, before the reading.
pub(crate) struct Newborn<T: Real, S: Switch<T>> {
    pub phase: Phase,
    pub prior: T,
    /// What its prediction returned.
    pub spread: RateSpread<T, S>,
    /// Its parent's.
    pub log_inside: T,
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
        let Newborn { phase, prior, spread, log_inside } = newborn;
        let mut weight = Weight { factor: prior, exponent: T::zero() };
        if let Some(reading) = reading {
            let residual = self.update(child, reading, Some(phase), spread)?;
            weight = weighing.likelihood::<S>(prior, &residual);
            predicted.add(prior, residual.innovation, residual.variance);
        } else if !child.is_sound::<N>(child.variances::<N>()) {
            return Err(StepError::NonFiniteState);
        }
        let inside = weighing.log_inside::<S>(child.strain, child.strain_variance);
        Ok(Weighed { weight, more_inside: inside - log_inside, log_inside: inside })
    }
}

/// What has left the limits altogether is no less likely than [`LEAST_INSIDE`].
fn log_of_inside<T: Real>(mass: T) -> T {
    let least = T::of(LEAST_INSIDE);
    if mass > least { mass.ln() } else { least.ln() }
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

    /// Log density of the reading under the mixture, tempered if the filter tempers: what
    /// [`MixtureStep`](crate::MixtureStep) calls by this name.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        self.factor.ln() + self.exponent - T::of(0.5) * self.tempering * T::two_pi().ln()
    }
}
