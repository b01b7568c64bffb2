//! The filter of phase histories of the sensor's own model at a fixed rate.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it as it was, and nothing takes a
//! logarithm unless asked or unless the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel};

use crate::belief::gaussian::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::children::Children;
use crate::mixture::evidence::{Newborn, Weighing};
use crate::mixture::genealogy::{Heirs, sparse_steps};
use crate::mixture::sparse::SparseMixture;
use crate::mixture::step::Predicted;
use crate::mixture::switching::fresh_rate;
use crate::{
    AnyCurve, Compact, Curve, Dwell, Evidence, Gaussian, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// [`Hypotheses`](crate::Hypotheses) of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length: the
/// same to rounding, without multiplying zeros. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseHypotheses<T, const B: usize, const N: usize, const K: usize, S = Compact, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    /// Probabilities of a change of phase over a step, `[from][to]`.
    pub(crate) chain: [[T; 3]; 3],
    pub(crate) weighing: Weighing<T>,
    /// Rate of a moving phase that begins.
    pub(crate) fresh: [Gaussian<T>; 3],
}

impl<T: Real, const B: usize, const N: usize, const K: usize> SparseHypotheses<T, B, N, K> {
    /// A filter for steps of `dt_s` seconds.
    /// - `dwell`: how long phases last and what follows them.
    /// - `evidence`: what weighs the histories.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number.
    pub fn new(
        model: SwitchedModel<T, B, N>,
        dt_s: T,
        dwell: Dwell<T>,
        evidence: Evidence<T>,
    ) -> Result<Self, StepError> {
        Ok(Self::around(SparseEkf::new(model, dt_s)?, dwell, evidence))
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>>
    SparseHypotheses<T, B, N, K, S, G>
{
    /// A filter whose histories step as `kernel` does; the other arguments as for [`Self::new`]. Of its switch only the
    /// square root is used.
    pub fn around(kernel: SparseEkf<T, S, B, N, G>, dwell: Dwell<T>, evidence: Evidence<T>) -> Self {
        Self {
            chain: dwell.probabilities(kernel.dt_s()),
            weighing: Weighing::new(evidence),
            fresh: Phase::ALL.map(|phase| fresh_rate(kernel.model().motion(), phase)),
            kernel,
        }
    }

    /// The model.
    pub const fn model(&self) -> &SwitchedModel<T, B, N> {
        self.kernel.model()
    }

    sparse_steps!(Hypotheses);

    #[inline(always)]
    fn step_recorded<const L: usize>(
        &self,
        state: &SparseMixture<T, N, L, K>,
        reading: Option<Reading<T>>,
        next: &mut SparseMixture<T, N, L, K>,
        heirs: &mut impl Heirs,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        let mut children = Children::new(next);
        let mut predicted = Predicted::new();
        for (place, (parent, from)) in state.shares().iter().zip(state.phases()).enumerate() {
            for (phase, probability) in Phase::ALL.into_iter().zip(self.chain[from.index()]) {
                if !(probability > T::zero()) {
                    continue;
                }
                let mut child = Parts::of(&parent.belief);
                if phase != Phase::Hold && *from != phase {
                    child.renew_rate(&self.fresh[phase.index()]);
                }
                let spread = self.kernel.predict(&mut child, Course::Known(phase));
                let prior = parent.weight * probability;
                let newborn = Newborn { phase, prior, spread, per_inside: parent.per_inside };
                let weighed = self.kernel.weigh(&mut child, newborn, reading, &self.weighing, &mut predicted)?;
                heirs.placed(place, phase, children.add(&child, phase, &weighed));
            }
        }
        let density = children.density();
        children.normalise(heirs)?;
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, self.weighing.tempering())))
    }
}
