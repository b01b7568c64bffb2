use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, StrainRange};

use crate::Real;
use crate::kernel::{Falls, Lanes, Parts, RateSpread, Several};
use crate::mixture::LEAST_INSIDE;
use crate::mixture::predicted::Predicted;
use crate::{Curve, Innovation, Reading, Residual, SparseEkf, StepError, Switch};

/// Evidence that weighs hypotheses, in every filter that keeps several.
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
        if below.is_zero() || self.factor.is_zero() { self.factor } else { self.factor * below.falling() }
    }
}

impl<T: Real> Weighing<T> {
    pub(crate) fn new(evidence: Evidence<T>) -> Self {
        let rounding = T::default_epsilon();
        let clear = T::of(-2.0) * rounding.ln();
        Self { limits: evidence.limits, tempering: evidence.tempering, clear }
    }

    /// Creates a weighing with unchecked limits; in `f32` each may be a placeholder of an input.
    #[cfg(feature = "record")]
    pub(crate) fn of_any_limits(lower: T, upper: T) -> Self {
        Self::new(Evidence { limits: StrainRange { lower, upper }, tempering: T::one() })
    }

    /// A prior probability times the likelihood of a reading to the power of the tempering, without the constant
    /// `(2π)^(-tempering/2)`.
    #[inline(always)]
    pub(crate) fn likelihood<V, X>(&self, prior: V, residual: &Residual<V>) -> Weight<V>
    where
        V: Several<Number = T>,
        X: Switch<V>,
    {
        let (half, Residual { variance, nis, .. }) = (T::of(-0.5) * self.tempering, *residual);
        if self.tempering == T::one() {
            return Weight { factor: prior.over(X::root(variance)), exponent: nis.scale(half) };
        }
        let [logarithm] = variance.build(|lane| [variance.at(lane).ln()]);
        Weight { factor: prior, exponent: (nis + logarithm).scale(half) }
    }

    /// Probability of the limits over what `per_inside` is one over, and one over the probability itself, where it is `wanted`.
    #[inline(always)]
    pub(crate) fn of_limits<V, X>(&self, (strain, variance): (V, V), per_inside: V, wanted: V::Mask) -> [V; 2]
    where
        V: Falls<Number = T>,
        X: Switch<V>,
    {
        let one = strain.literal(1.0);
        let (lower, upper) = (strain.with(self.limits.lower), strain.with(self.limits.upper));
        let ends = [strain - lower, upper - strain];
        let reach = variance.scale(self.clear);
        let [from_lower, from_upper] = [self.is_clear(ends[0], reach), self.is_clear(ends[1], reach)];
        // Mostly nothing is near a limit.
        let near = V::without(wanted, V::either(V::both(from_lower, from_upper), (-variance).not_negative()));
        if V::none(near) {
            return [per_inside, one];
        }
        let inside = if V::WIDTH > 1 {
            self.inside_near::<V, X>(ends, variance, near)
        } else {
            self.inside_near_apart::<V, X>(ends, variance, near)
        };
        let inside = V::pick(near, inside, one);
        [inside * per_inside, one.over(inside)]
    }

    #[inline(always)]
    fn is_clear<V: Falls<Number = T>>(&self, distance: V, reach: V) -> V::Mask {
        V::both(distance.nothing().less(distance), reach.less(distance * distance))
    }

    /// Calls [`Self::inside_near`] out of line, apart from numbers that are not near a limit.
    #[inline(never)]
    fn inside_near_apart<V: Falls<Number = T>, X: Switch<V>>(&self, ends: [V; 2], variance: V, near: V::Mask) -> V {
        self.inside_near::<V, X>(ends, variance, near)
    }

    /// Probability that a strain lies within the limits, so far above the lower and below the upper, where a tail counts. What has
    /// left the limits altogether is no less likely than [`LEAST_INSIDE`].
    #[inline(always)]
    fn inside_near<V, X>(&self, [above_lower, below_upper]: [V; 2], variance: V, wanted: V::Mask) -> V
    where
        V: Falls<Number = T>,
        X: Switch<V>,
    {
        let (zero, one) = (variance.nothing(), variance.literal(1.0));
        let per_sd = X::root(variance).recip();
        let lower_is_near = above_lower.less(below_upper);
        let near = V::pick(lower_is_near, above_lower, below_upper);
        let far = V::pick(lower_is_near, below_upper, above_lower);
        let far_counts = V::without(wanted, self.is_clear(far, variance.scale(self.clear)));
        let mut beyond_far = zero;
        if !V::none(far_counts) {
            beyond_far = V::pick(far_counts, (far * per_sd).tail(far_counts).mass, zero);
        }
        // Beyond the near end the mass inside is the small number, and is to keep its digits.
        let is_inside = zero.less(near);
        let beyond_near = (V::pick(is_inside, near, -near) * per_sd).tail(wanted).mass;
        let inside = V::pick(is_inside, one - (beyond_near + beyond_far), beyond_near - beyond_far);
        let least = variance.literal(LEAST_INSIDE);
        V::pick(least.less(inside), inside, least)
    }

    pub(crate) fn tempering(&self) -> T {
        self.tempering
    }

    /// Squared deviations beyond which a tail does not count.
    pub(crate) fn clear(&self) -> T {
        self.clear
    }
}

/// Weight of a child.
pub(crate) struct Weighed<T> {
    /// Its prior probability times the likelihood of the reading.
    pub weight: Weight<T>,
    /// Its probability of the limits over its parent's, which weighs it too but carries no information on the reading.
    pub more_inside: T,
    /// One over the probability itself.
    pub per_inside: T,
}

impl<V: Several> Weighed<V> {
    /// Returns the weight in a lane.
    #[inline(always)]
    pub(crate) fn in_lane(&self, lane: usize) -> Weighed<V::Number> {
        let Weight { factor, exponent } = &self.weight;
        Weighed {
            weight: Weight { factor: factor.at(lane), exponent: exponent.at(lane) },
            more_inside: self.more_inside.at(lane),
            per_inside: self.per_inside.at(lane),
        }
    }
}

/// Children that have been predicted, before the reading.
pub(crate) struct PredictedChildren<'a, V: Lanes, X: Switch<V>, const B: usize> {
    pub parts: &'a mut Parts<V, B>,
    pub phase: Phase,
    pub prior: V,
    /// Spread of the rate that their prediction returned.
    pub spread: RateSpread<V, X>,
    /// One over their parents' probability of the limits.
    pub per_inside: V,
    /// Lanes that hold a child.
    pub alive: V::Mask,
}

/// Children after the reading.
pub(crate) struct UpdatedChildren<V: Lanes> {
    pub prior: V,
    pub alive: V::Mask,
    /// Lanes whose numbers are sound.
    pub sound: V::Mask,
    /// Zero without a reading.
    pub residual: Residual<V>,
    pub weighed: Weighed<V>,
}

impl<T: Real, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Gives children the reading.
    #[inline(always)]
    pub(crate) fn weigh<V: Several<Number = T>, X: Switch<V>>(
        &self,
        children: PredictedChildren<'_, V, X, B>,
        reading: Option<Reading<V>>,
        weighing: &Weighing<T>,
    ) -> UpdatedChildren<V> {
        let PredictedChildren { parts, phase, prior, spread, per_inside, alive } = children;
        let nothing = prior.nothing();
        let mut residual = Residual { innovation: nothing, variance: nothing, nis: nothing };
        let mut weight = Weight { factor: prior, exponent: nothing };
        let sound;
        if let Some(reading) = reading {
            (residual, sound) = self.update_where(parts, reading, Some(phase), spread, alive);
            weight = weighing.likelihood::<V, X>(prior, &residual);
        } else {
            sound = parts.is_sound::<N>(parts.variances::<N>());
        }
        let strain = (parts.strain, parts.strain_variance);
        let [more_inside, per_inside] = weighing.of_limits::<V, X>(strain, per_inside, alive);
        UpdatedChildren { prior, alive, sound, residual, weighed: Weighed { weight, more_inside, per_inside } }
    }
}

/// Comparison of a reading with the prediction of a whole mixture.
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

    /// Converts it for [`Estimator`](crate::Estimator).
    pub(crate) fn innovation(&self) -> Result<Innovation<T>, StepError> {
        self.residual.with_log_likelihood(self.log_likelihood())
    }
}
