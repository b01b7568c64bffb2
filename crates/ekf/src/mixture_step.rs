use ohmstrain_model::{Phase, StrainRange};

use crate::ekf::update;
use crate::gaussian::Real;
use crate::mixture::{Component, Mixture};
use crate::{Belief, Phased, Reading, StepError};

/// What weighs hypotheses, in every filter that keeps some.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence<T> {
    /// Strains beyond these limits are unlikely.
    pub limits: StrainRange<T>,
    /// Power, 0 to 1, to which the likelihood of a reading enters the weights; below 1 it allows for model error that is
    /// correlated from reading to reading.
    pub tempering: T,
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
}

/// Collects the children of all hypotheses: predicts, updates, weighs and merges them one by one.
pub(crate) struct Candidates<'a, T, M, const N: usize, const L: usize, const K: usize> {
    model: &'a M,
    evidence: &'a Evidence<T>,
    reading: Option<Reading<T>>,
    children: Mixture<T, N, L, K>,
    /// Moments of the predicted reading: sum of probabilities, of values, of squares and variances.
    predicted: [T; 3],
}

/// A cut that leaves less than this of a prediction is not followed: its moments would be those of a far tail.
const LEAST_MASS: f64 = 1e-3;

impl<'a, T: Real, M: Phased<T, N, L>, const N: usize, const L: usize, const K: usize> Candidates<'a, T, M, N, L, K> {
    pub(crate) fn new(model: &'a M, evidence: &'a Evidence<T>, reading: Option<Reading<T>>) -> Self {
        Self { model, evidence, reading, children: Mixture::empty(), predicted: [T::zero(); 3] }
    }

    /// The child of `parent` that starts at `from` and moves in `phase`; `cut` restricts its prediction and says how
    /// much of it that leaves.
    pub(crate) fn add(
        &mut self,
        parent: &Component<T, N, L>,
        from: &Belief<T, N, L>,
        prepared: &M::Prepared,
        phase: Phase,
        probability: T,
        cut: impl FnOnce(Belief<T, N, L>) -> (Belief<T, N, L>, T),
    ) -> Result<(), StepError> {
        let transition = self.model.transition(prepared, from, Some(phase));
        let covariance = self.model.propagate(&from.covariance, &transition);
        let (prior, mass) = cut(Belief { mean: transition.mean, covariance });
        if !(mass > T::of(LEAST_MASS) && probability > T::zero()) {
            return Ok(());
        }
        let mut child = Component {
            log_weight: parent.log_weight + (probability * mass).ln(),
            phase,
            belief: prior,
            log_inside: parent.log_inside,
        };
        if let Some(reading) = self.reading {
            let observation = self.model.observe(&prior, Some(phase));
            let (posterior, update) = update(&prior, observation, reading)?;
            let weight = child.log_weight.exp();
            let expected = update.observation.value;
            self.predicted[0] += weight;
            self.predicted[1] += weight * expected;
            self.predicted[2] += weight * (update.innovation_variance + expected * expected);
            child.belief = posterior;
            child.log_weight += self.evidence.tempering * update.log_likelihood;
        }
        if !child.belief.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        child.weigh_limits(&self.evidence.limits);
        self.children.add(child);
        Ok(())
    }

    pub(crate) fn finish(mut self) -> Result<MixtureStep<T, N, L, K>, StepError> {
        let log_likelihood = self.children.normalise()?;
        let [total, first, second] = self.predicted;
        let nis = self.reading.map(|reading| {
            let mean = first / total;
            let variance = second / total - mean * mean;
            (reading.value - mean) * (reading.value - mean) / variance
        });
        Ok(MixtureStep { posterior: self.children, log_likelihood, nis })
    }
}
