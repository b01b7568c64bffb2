use ohmstrain_model::Phase;

use crate::belief::gaussian::Real;
use crate::ekf::stand_still;
use crate::mixture::lineage::{Birth, Lineage, Recorder};
use crate::mixture::step::{Candidates, Course, Evidence, MixtureStep, Origin, mixture_estimator};
use crate::mixture::switching::enter;
use crate::mixture::{Component, Mixture};
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

    /// A phase changes at the beginning of a step: steps are short against phases, and against what the model asks for.
    fn longest_s<const N: usize, const L: usize>(&self) -> T
    where
        M: Phased<T, N, L>,
    {
        self.model.longest_step_s().min(self.dwell.longest_step_s())
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
        self.step_recorded(mixture, &(*prepared, dt_s), reading, &mut ())
    }

    fn step_recorded<R: Recorder<T, N, L>, const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, 3>,
        (prepared, dt_s): &(M::Prepared, T),
        reading: Option<Reading<T>>,
        recorder: &mut R,
    ) -> Result<MixtureStep<T, N, L, 3>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let chain = self.dwell.probabilities(*dt_s);
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading, recorder);
        for parent in self.mix_all(mixture, &chain).components().iter().enumerate() {
            let (from, phase) = (&parent.1.belief, parent.1.phase);
            let origin = Origin { parent, from, begins: false, course: Course::Known, phase, probability: T::one() };
            candidates.add(&origin, prepared, |_| T::one())?;
        }
        candidates.finish()
    }

    /// One step backwards: along the three filters to the mixed beliefs they started from, then through the mixing.
    fn smooth_step<const N: usize, const L: usize>(
        &self,
        filtered: &Mixture<T, N, L, 3>,
        prepared: &(M::Prepared, T),
        reading: Option<Reading<T>>,
        next: &Mixture<T, N, L, 3>,
    ) -> Result<Mixture<T, N, L, 3>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let chain = self.dwell.probabilities(prepared.1);
        let mixed = self.mix_all(filtered, &chain);
        let mut lineage = Lineage::new(&self.model);
        let step = self.step_recorded(filtered, prepared, reading, &mut lineage)?;
        let smoothed = lineage.smooth(&mixed, &step.posterior, next);
        let mut mixing = Lineage::new(&self.model);
        for (heir, phase) in mixed.components().iter().map(|component| component.phase).enumerate() {
            for (parent, component) in filtered.components().iter().enumerate() {
                let (entered, begins) = &enter(&self.model, component, phase);
                let transition = &stand_still(entered);
                let log_weight = comes_from(&chain, component, phase).ln();
                let (from, predicted, posterior, begins) = (entered, entered, entered, *begins);
                let birth = Birth { parent, phase, from, begins, transition, predicted, posterior, log_weight };
                mixing.born(&birth, heir);
            }
        }
        Ok(mixing.smooth(filtered, &mixed, &smoothed))
    }

    /// What is known of the state at the beginning of a step, for every phase that the step may have.
    fn mix_all<const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, 3>,
        chain: &[[T; 3]; 3],
    ) -> Mixture<T, N, L, 3>
    where
        M: Phased<T, N, L>,
    {
        let mut mixed = Mixture::empty();
        for phase in Phase::ALL {
            if let Some(component) = self.mix(mixture, chain, phase) {
                mixed.push(component);
            }
        }
        mixed
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
        let total = mixture.components().iter().fold(T::zero(), |sum, from| sum + comes_from(chain, from, phase));
        if !(total > T::zero()) {
            return None;
        }
        let mut entered = Mixture::<T, N, L, 3>::empty();
        let mut per_inside = T::zero();
        for from in mixture.components() {
            let weight = comes_from(chain, from, phase) / total;
            let (belief, _) = enter(&self.model, from, phase);
            entered.push(Component { log_weight: weight.ln(), belief, ..*from });
            per_inside += weight * from.per_inside;
        }
        Some(Component { log_weight: total.ln(), phase, belief: entered.moments(), per_inside })
    }
}

/// Probability that `phase` follows and that it follows this hypothesis.
fn comes_from<T: Real, const N: usize, const L: usize>(
    chain: &[[T; 3]; 3],
    from: &Component<T, N, L>,
    phase: Phase,
) -> T {
    chain[from.phase.index()][phase.index()] * from.log_weight.exp()
}

mixture_estimator!(Imm<T, M>, 3);
