use ohmstrain_model::{Phase, StrainRange};

use crate::gaussian::Real;
use crate::mixture::{Component, Mixture, with_rate_in};
use crate::mixture_step::{Candidates, Evidence, MixtureStep};
use crate::{Belief, Dwell, Phased, Reading, StepError};

/// Gaussian hypotheses split by the sign of the rate.
///
/// Each predicted Gaussian is cut at rate zero. The masses of the halves are the probabilities of stretching and
/// releasing, and each half drives the branches with its own gains. With a [`Dwell`] there is a hold phase besides,
/// entered and left by the chain's probabilities; its moving phases turn around by crossing rate zero, not by the chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignSplit<T, M> {
    model: M,
    hold: Option<Dwell<T>>,
    evidence: Evidence<T>,
}

impl<T: Real, M> SignSplit<T, M> {
    /// - `hold`: how long holds and movements last; `None` for a body that never rests.
    /// - `evidence`: what weighs the hypotheses.
    pub const fn new(model: M, hold: Option<Dwell<T>>, evidence: Evidence<T>) -> Self {
        Self { model, hold, evidence }
    }

    /// The model.
    pub const fn model(&self) -> &M {
        &self.model
    }

    /// Predicts over a prepared step of `dt_s ≥ 0` seconds, then takes the reading.
    ///
    /// # Errors
    /// See [`StepError`]; the mixture passed in is untouched.
    pub fn step_prepared<const N: usize, const L: usize, const K: usize>(
        &self,
        mixture: &Mixture<T, N, L, K>,
        prepared: &M::Prepared,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<MixtureStep<T, N, L, K>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading);
        let chain = self.hold.map(|dwell| dwell.probabilities(dt_s));
        for parent in mixture.components() {
            let [extends, holds, retracts] = match (&chain, parent.phase) {
                (None, _) => [T::one(), T::zero(), T::one()],
                (Some(chain), Phase::Hold) => chain[1],
                // Whether a moving body stretches or releases is for the cut to say.
                (Some(chain), _) => [T::one() - chain[0][1], chain[0][1], T::one() - chain[0][1]],
            };
            self.spawn(parent, prepared, Phase::Extend, extends, &mut candidates)?;
            self.spawn(parent, prepared, Phase::Retract, retracts, &mut candidates)?;
            if holds > T::zero() {
                candidates.add(parent, &parent.belief, prepared, Phase::Hold, holds, |prior| (prior, T::one()))?;
            }
        }
        candidates.finish()
    }

    /// One child of a hypothesis, moving in one direction.
    fn spawn<const N: usize, const L: usize, const K: usize>(
        &self,
        parent: &Component<T, N, L>,
        prepared: &M::Prepared,
        phase: Phase,
        probability: T,
        candidates: &mut Candidates<'_, T, M, N, L, K>,
    ) -> Result<(), StepError>
    where
        M: Phased<T, N, L>,
    {
        let infinite = T::one() / T::zero();
        let rates = match phase {
            Phase::Retract => StrainRange { lower: -infinite, upper: T::zero() },
            _ => StrainRange { lower: T::zero(), upper: infinite },
        };
        let from: Belief<T, N, L> = if parent.phase == Phase::Hold && self.hold.is_some() {
            self.model.enter(&parent.belief, phase)
        } else {
            parent.belief
        };
        candidates.add(parent, &from, prepared, phase, probability, |prior| with_rate_in(&prior, &rates))
    }
}
