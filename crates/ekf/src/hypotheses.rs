use ohmstrain_model::Phase;

use crate::gaussian::Real;
use crate::mixture::Mixture;
use crate::mixture_step::{Candidates, Evidence, MixtureStep};
use crate::{Dwell, Phased, Reading, StepError};

/// The best phase histories, each with a Kalman filter of its own: for protocols of ramps and long holds.
///
/// Unlike [`Imm`](crate::Imm) it does not mix histories before a step; it keeps those that explain the readings and
/// merges the ones that have become alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypotheses<T, M> {
    model: M,
    dwell: Dwell<T>,
    evidence: Evidence<T>,
}

impl<T: Real, M> Hypotheses<T, M> {
    /// - `dwell`: how long phases last and what follows them.
    /// - `evidence`: what weighs the hypotheses.
    pub const fn new(model: M, dwell: Dwell<T>, evidence: Evidence<T>) -> Self {
        Self { model, dwell, evidence }
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
        let chain = self.dwell.probabilities(dt_s);
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading);
        for parent in mixture.components() {
            for phase in Phase::ALL {
                let begins = phase != Phase::Hold && parent.phase != phase;
                let from = if begins { self.model.enter(&parent.belief, phase) } else { parent.belief };
                let probability = chain[parent.phase.index()][phase.index()];
                candidates.add(parent, &from, prepared, phase, probability, |prior| (prior, T::one()))?;
            }
        }
        candidates.finish()
    }
}
