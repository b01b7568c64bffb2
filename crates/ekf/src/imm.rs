use ohmstrain_model::Phase;

use crate::gaussian::Real;
use crate::mixture::{Component, Mixture};
use crate::mixture_step::{Candidates, Evidence, MixtureStep};
use crate::{Dwell, Phased, Reading, StepError};

/// Interacting multiple models: one Gaussian per phase (extend, hold, retract), mixed before every step by the
/// probabilities of changing phase.
///
/// Source: Blom & Bar-Shalom, *IEEE Trans. Autom. Control* 33 (1988) 780.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imm<T, M> {
    model: M,
    dwell: Dwell<T>,
    evidence: Evidence<T>,
}

impl<T: Real, M> Imm<T, M> {
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
    pub fn step_prepared<const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, 3>,
        prepared: &M::Prepared,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<MixtureStep<T, N, L, 3>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let chain = self.dwell.probabilities(dt_s);
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading);
        for phase in Phase::ALL {
            if let Some(mixed) = self.mix(mixture, &chain, phase) {
                candidates.add(&mixed, &mixed.belief, prepared, phase, T::one(), |prior| (prior, T::one()))?;
            }
        }
        candidates.finish()
    }

    /// What is known of the state if `phase` begins or goes on now.
    fn mix<const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, 3>,
        chain: &[[T; 3]; 3],
        phase: Phase,
    ) -> Option<Component<T, N, L>>
    where
        M: Phased<T, N, L>,
    {
        let comes_from = |from: &Component<T, N, L>| chain[from.phase.index()][phase.index()] * from.log_weight.exp();
        let total = mixture.components().iter().fold(T::zero(), |sum, from| sum + comes_from(from));
        if !(total > T::zero()) {
            return None;
        }
        let mut entered = Mixture::<T, N, L, 3>::empty();
        let mut log_inside = T::zero();
        for from in mixture.components() {
            let weight = comes_from(from) / total;
            let begins = phase != Phase::Hold && from.phase != phase;
            let belief = if begins { self.model.enter(&from.belief, phase) } else { from.belief };
            entered.push(Component { log_weight: weight.ln(), belief, ..*from });
            log_inside += weight * from.log_inside;
        }
        Some(Component { log_weight: total.ln(), phase, belief: entered.moments(), log_inside })
    }
}
