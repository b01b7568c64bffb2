use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, StrainRange};

use crate::Real;
use crate::kernel::{Falls, Lanes, Parts, RateSpread, Several};
use crate::mixture::LEAST_INSIDE;
use crate::mixture::predicted::Predicted;
use crate::{Curve, Innovation, Reading, Residual, SparseEkf, StepError, Switch};

/// Evidence that weighs the hypotheses of a filter.
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
    /// Creates evidence from limits and tempering.
    ///
    /// # Errors
    /// If the limits are not in order, or the tempering is not in the range 0 to 1.
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

/// [`Evidence`] as factors instead of logarithms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weighing<T> {
    limits: StrainRange<T>,
    tempering: T,
    /// Squared number of standard deviations beyond which a tail is below the rounding of 1:
    /// `Q(z) ≤ exp(-z²/2)/2 = ε/2`.
    clear: T,
}

/// A weight `factor · exp(exponent)`: factors are of the size of probabilities, exponents of any size.
#[derive(Clone, Copy)]
pub(crate) struct Weight<T> {
    pub factor: T,
    pub exponent: T,
}

impl<T: Real> Weight<T> {
    /// Returns the weight in units of `exp(exponent)`, where `exponent` is at least its own.
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

    /// Creates a weighing with unchecked limits, which may be placeholders of inputs in `f32`.
    #[cfg(feature = "record")]
    pub(crate) fn of_any_limits(lower: T, upper: T) -> Self {
        Self::new(Evidence { limits: StrainRange { lower, upper }, tempering: T::one() })
    }

    /// Returns a prior probability times the likelihood of a reading to the power of the tempering, without the
    /// constant `(2π)^(-tempering/2)`.
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

    /// Returns the probability of the limits times `per_inside`, the inverse of the parent's, and the inverse of the
    /// probability itself, in the lanes `wanted`.
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
        // Usually nothing is near a limit.
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

    /// Calls [`Self::inside_near`] out of line, separate from the common path for numbers far from the limits.
    #[inline(never)]
    fn inside_near_apart<V: Falls<Number = T>, X: Switch<V>>(&self, ends: [V; 2], variance: V, near: V::Mask) -> V {
        self.inside_near::<V, X>(ends, variance, near)
    }

    /// Returns the probability that a strain lies within the limits, from its distances above the lower and below the upper limit,
    /// if a tail counts. It is at least [`LEAST_INSIDE`], even far outside the limits.
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
        // Beyond the near limit the mass inside is small, and must keep its digits.
        let is_inside = zero.less(near);
        let beyond_near = (V::pick(is_inside, near, -near) * per_sd).tail(wanted).mass;
        let inside = V::pick(is_inside, one - (beyond_near + beyond_far), beyond_near - beyond_far);
        let least = variance.literal(LEAST_INSIDE);
        V::pick(least.less(inside), inside, least)
    }

    pub(crate) fn tempering(&self) -> T {
        self.tempering
    }

    /// Returns the squared number of standard deviations beyond which a tail does not count.
    pub(crate) fn clear(&self) -> T {
        self.clear
    }
}

/// Weight of a child.
pub(crate) struct Weighed<T> {
    /// Prior probability times the likelihood of the reading.
    pub weight: Weight<T>,
    /// Ratio of its probability of the limits to its parent's, which also enters the weight but carries no information
    /// on the reading.
    pub more_inside: T,
    /// Inverse of its probability of the limits.
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

/// Predicted children, before the reading.
pub(crate) struct PredictedChildren<'a, V: Lanes, X: Switch<V>, const B: usize> {
    pub parts: &'a mut Parts<V, B>,
    pub phase: Phase,
    pub prior: V,
    /// Spread of the rate returned by their prediction.
    pub spread: RateSpread<V, X>,
    /// Inverse of their parents' probability of the limits.
    pub per_inside: V,
    /// Lanes that hold a child.
    pub alive: V::Mask,
}

/// Children after the reading.
pub(crate) struct UpdatedChildren<V: Lanes> {
    pub prior: V,
    pub alive: V::Mask,
    /// Lanes with valid numbers.
    pub sound: V::Mask,
    /// Zero without a reading.
    pub residual: Residual<V>,
    pub weighed: Weighed<V>,
}

impl<T: Real, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Updates children with the reading.
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
            (residual, sound) = self.update(parts, reading, Some(phase), spread, alive, |_| true);
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
    /// Innovation with respect to the mixture's mean prediction, and its variance under the mixture.
    pub residual: Residual<T>,
    /// Density of the reading without its constant, as factor and exponent of a weight.
    factor: T,
    exponent: T,
    tempering: T,
}

impl<T: Scalar> MixtureResidual<T> {
    /// Compares a reading with the mixture; `density` is the sum of all prior weights times likelihoods.
    pub(crate) fn new(predicted: &Predicted<T>, density: Weight<T>, tempering: T) -> Self {
        let (innovation, variance) = predicted.moments();
        let residual = Residual { innovation, variance, nis: innovation * innovation / variance };
        Self { residual, factor: density.factor / *predicted.weight(), exponent: density.exponent, tempering }
    }

    /// Returns the log density of the reading under the mixture, tempered if the filter tempers.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        self.factor.ln() + self.exponent - T::of(0.5) * self.tempering * T::two_pi().ln()
    }

    /// Converts it for [`Estimator`](crate::Estimator).
    pub(crate) fn innovation(&self) -> Result<Innovation<T>, StepError> {
        self.residual.with_log_likelihood(self.log_likelihood())
    }
}
