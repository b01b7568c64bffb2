use ohmstrain_model::Phase;

use crate::belief::gaussian::Real;
use crate::mixture::Mixture;
use crate::mixture::lineage::{Lineage, Recorder};
use crate::mixture::step::{Candidates, Course, Evidence, MixtureStep, Origin, mixture_estimator, smooth_step};
use crate::mixture::switching::enter;
use crate::{Dwell, Phased, Reading, StepError};

/// The best `K` phase histories, each with a Kalman filter of its own: for protocols of ramps and long holds.
///
/// Unlike [`Imm`](crate::Imm) it does not mix histories before a step; it keeps those that explain the readings and
/// merges the ones that have become alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypotheses<T, M, const K: usize> {
    model: M,
    dwell: Dwell<T>,
    evidence: Evidence<T>,
}

impl<T: Real, M, const K: usize> Hypotheses<T, M, K> {
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
        mixture: &Mixture<T, N, L, K>,
        prepared: &M::Prepared,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<MixtureStep<T, N, L, K>, StepError>
    where
        M: Phased<T, N, L>,
    {
        self.step_recorded(mixture, &(*prepared, dt_s), reading, &mut ())
    }

    pub(crate) fn step_recorded<R: Recorder<T, N, L>, const N: usize, const L: usize>(
        &self,
        mixture: &Mixture<T, N, L, K>,
        (prepared, dt_s): &(M::Prepared, T),
        reading: Option<Reading<T>>,
        recorder: &mut R,
    ) -> Result<MixtureStep<T, N, L, K>, StepError>
    where
        M: Phased<T, N, L>,
    {
        let chain = self.dwell.probabilities(*dt_s);
        let mut candidates = Candidates::new(&self.model, &self.evidence, reading, recorder);
        for parent in mixture.components().iter().enumerate() {
            for phase in Phase::ALL {
                let (from, begins) = &enter(&self.model, parent.1, phase);
                let probability = chain[parent.1.phase.index()][phase.index()];
                let origin = Origin { parent, from, begins: *begins, course: Course::Known, phase, probability };
                candidates.add(&origin, prepared, |_| T::one())?;
            }
        }
        candidates.finish()
    }

    smooth_step!();
}

mixture_estimator!(Hypotheses<T, M, K>, K);
