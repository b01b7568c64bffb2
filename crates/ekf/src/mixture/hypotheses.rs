//! The filter of phase histories.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it as it was, and nothing takes a
//! logarithm unless asked or unless the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel};

use crate::belief::gaussian::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::children::Children;
use crate::mixture::estimator::{mixture_filter, mixture_steps, over_phases};
use crate::mixture::evidence::{Newborn, Weighing};
use crate::mixture::lineage::{Birth, Following, Recorder};
use crate::mixture::predicted::Predicted;
use crate::mixture::state::Mixture;
use crate::mixture::switching::fresh_rate;
use crate::{
    AnyCurve, Compact, Curve, Dwell, Evidence, Gaussian, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// The best `K` phase histories of a [`SwitchedModel`], each with a Kalman filter of its own: for protocols of ramps and long
/// holds. A pruned generalised pseudo-Bayes tree.
///
/// Unlike [`Imm`](crate::Imm) it does not mix histories before a step; it keeps those that explain the readings and
/// merges the ones that have become alike. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypotheses<T, const B: usize, const N: usize, const K: usize, S = Compact, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    dwell: Dwell<T>,
    /// Probabilities of a change of phase over a step, `[from][to]`.
    pub(crate) chain: [[T; 3]; 3],
    pub(crate) weighing: Weighing<T>,
    /// Rate of a moving phase that begins.
    pub(crate) fresh: [Gaussian<T>; 3],
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> Hypotheses<T, B, N, K, S, G> {
    mixture_steps!();

    #[inline(always)]
    fn step_recorded<const L: usize>(
        &self,
        state: &Mixture<T, N, L, K>,
        reading: Option<Reading<T>>,
        next: &mut Mixture<T, N, L, K>,
        recorder: &mut impl Recorder<T, B>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        let mut children = Children::new(next);
        let mut predicted = Predicted::new();
        for (place, (parent, from)) in state.shares().iter().zip(state.phases()).enumerate() {
            for (phase, probability) in Phase::ALL.into_iter().zip(self.chain[from.index()]) {
                if !(probability > T::zero()) {
                    continue;
                }
                let mut child = Parts::of(&parent.belief);
                let begins = phase != Phase::Hold && *from != phase;
                if begins {
                    child.renew_rate(&self.fresh[phase.index()]);
                }
                let (from, course) = (child, Course::Known(phase));
                let spread = self.kernel.predict(&mut child, course);
                let prediction = child;
                let prior = parent.weight * probability;
                let newborn = Newborn { phase, prior, spread, per_inside: parent.per_inside };
                let weighed = self.kernel.weigh(&mut child, newborn, reading, &self.weighing, &mut predicted)?;
                let added = children.add(&child, phase, &weighed);
                let (predicted, posterior, weighed) = (&prediction, &child, &weighed);
                let birth = Birth { parent: place, phase, from: &from, begins, course, predicted, posterior, weighed };
                recorder.born(&birth, added);
            }
        }
        let density = children.density();
        children.normalise(recorder)?;
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, self.weighing.tempering())))
    }
}

over_phases!(Hypotheses<B, N, K>);
mixture_filter!(Hypotheses<B, N, K>, Mixture<K>);
