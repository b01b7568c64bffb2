//! The filter of phase histories.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it unchanged, and logarithms are
//! computed only on request or if the strain is near a limit.

use core::marker::PhantomData;

use ohmstrain_model::{Phase, SwitchedModel, Turning};

use crate::Real;
use crate::kernel::{Course, Parts, Several};
use crate::mixture::estimator::{mixture_filter, mixture_steps, over_phases};
use crate::mixture::evidence::{PredictedChildren, UpdatedChildren, Weighing};
use crate::mixture::lineage::{Following, Recorder};
use crate::mixture::retry::{StepReading, loosen};
use crate::mixture::spawn::{ChildTrace, MixtureStep, Parents, Spawns};
use crate::mixture::state::Mixture;
use crate::mixture::switching::fresh_rate;
use crate::{
    AnyCurve, Compact, Curve, Dwell, Evidence, Gaussian, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// The `K` most probable phase histories of a [`SwitchedModel`], each with its own Kalman filter: for protocols of ramps and
/// long holds. A pruned generalised pseudo-Bayes tree.
///
/// Unlike [`Imm`](crate::Imm) it does not mix histories before a step; it keeps those that explain the readings, and
/// merges similar ones. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypotheses<T, const B: usize, const N: usize, const K: usize, S = Compact, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    dwell: Dwell<T>,
    /// Probabilities of a change of phase over a step, `[from][to]`.
    pub(crate) chain: [[T; 3]; 3],
    pub(crate) weighing: Weighing<T>,
    /// Initial rate of each phase.
    pub(crate) fresh: [Gaussian<T>; 3],
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> Hypotheses<T, B, N, K, S, G> {
    mixture_steps!();
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> Spawns<T, B, N>
    for Hypotheses<T, B, N, K, S, G>
{
    type Switch = S;

    fn weighing(&self) -> &Weighing<T> {
        &self.weighing
    }

    #[inline(always)]
    fn follows(&self, from: Phase, _: bool) -> [T; 3] {
        self.chain[from.index()]
    }

    /// Returns no excess path: a phase has the direction of its net displacement.
    #[inline(always)]
    fn turning<V: Several<Number = T>, X: Switch<V>>(
        &self,
        _: &[V::Mask; 3],
        belief: &Parts<V, B>,
        _: bool,
    ) -> Turning<V> {
        Turning { excess: belief.rate.nothing(), variance: belief.rate.nothing() }
    }

    #[inline(always)]
    fn spawn<V: Several<Number = T>, X: Switch<V>>(
        &self,
        parts: &mut Parts<V, B>,
        parents: &Parents<V>,
        phase: Phase,
        reading: Option<Reading<V>>,
        trace: &mut impl ChildTrace<V, B>,
    ) -> Option<UpdatedChildren<V>> {
        let probability = parents.follows[phase.index()];
        let alive = V::both(parents.there, probability.nothing().less(probability));
        if V::none(alive) {
            return None;
        }
        let mut begins = V::without(parents.there, parents.there);
        if phase != Phase::Hold {
            begins = V::without(parents.there, parents.from[phase.index()]);
            if !V::none(begins) {
                parts.renew_rate(self.fresh[phase.index()].in_lanes(parts.rate), begins);
            }
        }
        let course = Course::Known(phase);
        trace.starts(parts, begins, &course);
        let spread = self.kernel.predict::<V, X>(parts, course);
        trace.ahead(parts);
        let (prior, per_inside) = (parents.weight * probability, parents.per_inside);
        let children = PredictedChildren { parts, phase, prior, spread, per_inside, alive };
        Some(self.kernel.weigh(children, reading, &self.weighing))
    }
}

over_phases!(Hypotheses<B, N, K>);
mixture_filter!(Hypotheses<B, N, K>, Mixture<K>);
