use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, StrainRange};

use crate::belief::gaussian::Real;
use crate::ekf::update;
use crate::estimator::Innovation;
use crate::mixture::lineage::{Birth, Recorder};
use crate::mixture::{Added, Component, Mixture};
use crate::{Belief, Phased, Reading, StepError};

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

/// What one step of a filter of hypotheses computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureStep<T, const N: usize, const L: usize, const K: usize> {
    /// The hypotheses after the reading.
    pub posterior: Mixture<T, N, L, K>,
    /// Log density of the reading under the mixture, tempered if the filter tempers; zero if it was missing.
    pub log_likelihood: T,
    /// Squared innovation over its variance under the mixture's mean and variance; `None` if the reading was missing.
    pub nis: Option<T>,
    /// The reading compared with the mixture's mean and variance of it; `None` if it was missing.
    pub innovation: Option<Innovation<T>>,
}

/// Collects the children of all hypotheses: predicts, updates, weighs and merges them one by one.
pub(crate) struct Candidates<'a, T, M, R, const N: usize, const L: usize, const K: usize> {
    model: &'a M,
    evidence: &'a Evidence<T>,
    reading: Option<Reading<T>>,
    recorder: R,
    children: Mixture<T, N, L, K>,
    predicted: Predicted<T>,
    density: LogSum<T>,
}

/// The reading compared with all predictions of it. Innovations are summed around the first of them: their spread shall not
/// be the small difference of two squares of the distance to the reading.
#[derive(Clone, Copy)]
pub(crate) struct Predicted<T> {
    weight: T,
    around: T,
    distance: T,
    square: T,
    variance: T,
}

impl<T: Scalar> Predicted<T> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        let zero = T::zero();
        Self { weight: zero, around: zero, distance: zero, square: zero, variance: zero }
    }

    /// One hypothesis of probability `weight`: its innovation, and the variance of that.
    #[inline(always)]
    pub(crate) fn add(&mut self, weight: T, innovation: T, variance: T) {
        if self.weight.is_zero() {
            self.around = innovation;
        }
        let distance = innovation - self.around;
        self.weight += weight;
        self.distance += weight * distance;
        self.square += weight * distance * distance;
        self.variance += weight * variance;
    }

    /// Probability of all of them.
    pub(crate) const fn weight(&self) -> &T {
        &self.weight
    }

    /// Mean and variance of the innovation.
    pub(crate) fn moments(&self) -> (T, T) {
        let mean = self.distance / self.weight;
        let spread = (self.square / self.weight - mean * mean).max(T::zero());
        (self.around + mean, self.variance / self.weight + spread)
    }
}

/// A sum of weighted exponentials of which no single one need be a number.
#[derive(Clone, Copy)]
struct LogSum<T> {
    most: T,
    sum: T,
}

impl<T: Scalar> LogSum<T> {
    fn add(&mut self, weight: T, exponent: T) {
        if self.sum.is_zero() || exponent > self.most {
            self.sum *= if self.sum.is_zero() { T::one() } else { (self.most - exponent).exp() };
            self.most = exponent;
        }
        self.sum += weight * (exponent - self.most).exp();
    }
}

/// What a child is made of.
pub(crate) struct Origin<'a, T, const N: usize, const L: usize> {
    /// The parent and its place.
    pub parent: (usize, &'a Component<T, N, L>),
    /// The belief it starts from: the parent's, with rates drawn anew if a phase begins.
    pub from: &'a Belief<T, N, L>,
    pub begins: bool,
    pub course: Course,
    pub phase: Phase,
    /// Probability that the parent has this child.
    pub probability: T,
}

/// What a hypothesis says of the direction over a step.
#[derive(Clone, Copy)]
pub(crate) enum Course {
    /// That of its phase.
    Known,
    /// The rate had the sign of this phase at the start, and has that of its own at the end.
    After(Phase),
    /// Nothing: the rate may have either sign.
    Open,
}

/// A cut that leaves less than this of a prediction is not followed: its moments would be those of a far tail.
pub(crate) const LEAST_MASS: f64 = 1e-3;

impl<'a, T, M, R, const N: usize, const L: usize, const K: usize> Candidates<'a, T, M, R, N, L, K>
where
    T: Real,
    M: Phased<T, N, L>,
    R: Recorder<T, N, L>,
{
    pub(crate) fn new(model: &'a M, evidence: &'a Evidence<T>, reading: Option<Reading<T>>, recorder: R) -> Self {
        let density = LogSum { most: T::zero(), sum: T::zero() };
        Self { model, evidence, reading, recorder, children: Mixture::empty(), predicted: Predicted::new(), density }
    }

    /// A child; `cut` restricts its prediction in place and says how much of it that leaves.
    pub(crate) fn add(
        &mut self,
        origin: &Origin<'_, T, N, L>,
        prepared: &M::Prepared,
        cut: impl FnOnce(&mut Belief<T, N, L>) -> T,
    ) -> Result<(), StepError> {
        let Origin { parent: (place, parent), from, begins, course, phase, probability } = *origin;
        if !(probability > T::zero()) {
            return Ok(());
        }
        let transition = match course {
            Course::After(before) => self.model.transition_between(prepared, from, before, phase),
            Course::Known => self.model.transition(prepared, from, Some(phase)),
            Course::Open => self.model.transition(prepared, from, None),
        };
        let covariance = self.model.propagate(&from.covariance, &transition);
        let predicted = Belief { mean: transition.mean, covariance };
        let mut child =
            Component { log_weight: parent.log_weight, phase, belief: predicted, per_inside: parent.per_inside };
        let mass = cut(&mut child.belief);
        if !(mass > T::of(LEAST_MASS)) {
            return Ok(());
        }
        child.log_weight += (probability * mass).ln();
        if let Some(reading) = self.reading {
            self.update(&mut child, reading)?;
        }
        if !child.belief.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        child.weigh_limits(&self.evidence.limits);
        let birth = Birth {
            parent: place,
            phase,
            from,
            begins,
            transition: &transition,
            predicted: &predicted,
            posterior: &child.belief,
            log_weight: child.log_weight,
        };
        let added = self.children.add(&child);
        match self.recorder.place(place, phase, added) {
            Added::To(heir) => self.recorder.born(&birth, heir),
            Added::InsteadOf(heir, into) => {
                self.recorder.renumbered(|place| if place == heir { into } else { Some(place) });
                self.recorder.born(&birth, heir);
            }
            Added::Nowhere => {}
        }
        Ok(())
    }

    fn update(&mut self, child: &mut Component<T, N, L>, reading: Reading<T>) -> Result<(), StepError> {
        let observation = self.model.observe(&child.belief, Some(child.phase));
        let (posterior, update) = update(&child.belief, observation, reading)?;
        let (weight, likelihood) = (child.log_weight.exp(), self.evidence.tempering * update.log_likelihood);
        self.predicted.add(weight, update.innovation, update.innovation_variance);
        self.density.add(weight, likelihood);
        child.belief = posterior;
        child.log_weight += likelihood;
        Ok(())
    }

    pub(crate) fn finish(mut self) -> Result<MixtureStep<T, N, L, K>, StepError> {
        self.children.normalise(&mut self.recorder)?;
        // Neither limits nor what there is no room for say anything of the reading.
        let density = || (self.density.sum / *self.predicted.weight()).ln() + self.density.most;
        let log_likelihood = if self.reading.is_some() { density() } else { T::zero() };
        let innovation = self.reading.map(|_| {
            let (value, variance) = self.predicted.moments();
            Innovation { value, variance, log_likelihood }
        });
        let nis = innovation.map(|innovation| innovation.nis());
        Ok(MixtureStep { posterior: self.children, log_likelihood, nis, innovation })
    }
}

/// [`Estimator`](crate::Estimator) for a filter of hypotheses: they differ in their type and capacity only.
macro_rules! mixture_estimator {
    ($filter:ident<T, M $(, $k:ident)?>, $capacity:expr) => {
        impl<T, M, $(const $k: usize,)? const N: usize, const L: usize> $crate::Estimator<T, N, L>
            for $filter<T, M $(, $k)?>
        where
            T: $crate::Real,
            M: $crate::Phased<T, N, L>,
        {
            type State = $crate::Mixture<T, N, L, { $capacity }>;
            /// The model's step, and its length for the chain of phases.
            type Prepared = (M::Prepared, T);

            fn prepare(&self, dt_s: T) -> Self::Prepared {
                (self.model.prepare(dt_s), dt_s)
            }

            fn longest_step_s(&self) -> T {
                self.longest_s::<N, L>()
            }

            fn advance(
                &self,
                state: &Self::State,
                prepared: &Self::Prepared,
                reading: Option<$crate::Reading<T>>,
            ) -> Result<$crate::Advanced<Self::State, T>, $crate::StepError> {
                let step = self.step_recorded(state, prepared, reading, &mut ())?;
                Ok($crate::Advanced { state: step.posterior, innovation: step.innovation })
            }

            fn smooth_back(
                &self,
                filtered: &Self::State,
                prepared: &Self::Prepared,
                reading: Option<$crate::Reading<T>>,
                next: &Self::State,
            ) -> Result<Option<Self::State>, $crate::StepError> {
                self.smooth_step(filtered, prepared, reading, next).map(Some)
            }
        }
    };
}
pub(crate) use mixture_estimator;

/// One step backwards of a filter that does not mix before a step.
macro_rules! smooth_step {
    () => {
        fn smooth_step<const N: usize, const L: usize>(
            &self,
            filtered: &Mixture<T, N, L, K>,
            prepared: &(M::Prepared, T),
            reading: Option<Reading<T>>,
            next: &Mixture<T, N, L, K>,
        ) -> Result<Mixture<T, N, L, K>, StepError>
        where
            M: Phased<T, N, L>,
        {
            let mut lineage = Lineage::new(&self.model);
            let step = self.step_recorded(filtered, prepared, reading, &mut lineage)?;
            Ok(lineage.smooth(filtered, &step.posterior, next))
        }
    };
}
pub(crate) use smooth_step;

#[cfg(test)]
mod tests {
    use super::{LogSum, Predicted};

    /// Mean `Σ w ν / Σ w` and variance `Σ w (S + ν²) / Σ w - mean²`, which is exact as far from the reading as here; and in
    /// `f32` at a distance at which these squares leave nothing of the variance.
    #[test]
    fn the_innovation_of_a_mixture_has_its_moments() {
        let parts = [(0.2, 1.0, 0.5), (0.1, -2.0, 0.3), (0.4, 0.25, 0.7)];
        let mut predicted = Predicted::new();
        parts.iter().for_each(|(weight, innovation, variance)| predicted.add(*weight, *innovation, *variance));
        let sum = |of: fn(f64, f64, f64) -> f64| parts.iter().map(|(w, nu, s)| of(*w, *nu, *s)).sum::<f64>();
        let total = sum(|w, _, _| w);
        let mean = sum(|w, nu, _| w * nu) / total;
        let variance = sum(|w, nu, s| w * (s + nu * nu)) / total - mean * mean;
        let found = predicted.moments();
        assert!((found.0 - mean).abs() < 1e-15 && (found.1 - variance).abs() < 1e-15, "{found:?} {mean} {variance}");
        let mut far = Predicted::<f32>::new();
        far.add(0.5, 3e4, 1e-4);
        far.add(0.5, 3e4 + 0.25, 1e-4);
        // A quarter is a multiple of rounding there: nothing is rounded.
        assert_eq!(far.moments(), (30_000.125, 1e-4 + 0.015_625));
    }

    /// `ln Σ w exp(x)`, in any order and where no single exponential is a number.
    #[test]
    fn a_sum_of_exponentials_needs_no_exponential() {
        for shift in [0.0, -2000.0, 2000.0] {
            for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
                let parts = [(0.2, 0.0), (0.5, -1.0), (0.3, 2.0)];
                let mut sum = LogSum { most: 0.0, sum: 0.0 };
                order.iter().for_each(|k| sum.add(parts[*k].0, parts[*k].1 + shift));
                let expected =
                    parts.iter().map(|(weight, exponent): &(f64, f64)| weight * exponent.exp()).sum::<f64>().ln();
                assert!((sum.sum.ln() + sum.most - shift - expected).abs() < 1e-12, "{shift} {order:?}");
            }
        }
    }
}
