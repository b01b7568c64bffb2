//! The sign-split filter.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it unchanged, and logarithms are
//! computed only on request or if the strain is near a limit.

use core::marker::PhantomData;

use ohmstrain_model::{Phase, SwitchedModel, Turning};

use crate::Real;
use crate::kernel::{Course, Parts, Several, side_of};
use crate::mixture::estimator::{mixture_filter, mixture_steps};
use crate::mixture::evidence::{PredictedChildren, UpdatedChildren, Weighing};
use crate::mixture::lineage::{Following, Recorder};
use crate::mixture::pause::Pause;
use crate::mixture::retry::{StepReading, loosen};
use crate::mixture::spawn::{ChildTrace, MixtureStep, Parents, Spawns};
use crate::mixture::state::Mixture;
use crate::mixture::switching::{forgets_direction_s, fresh_rate, longest_cut_s};
use crate::{
    AnyCurve, Compact, Curve, Dwell, Evidence, Gaussian, MixtureResidual, Reading, SparseEkf, StepError, Switch,
};

/// Filter with at most `K` Gaussian hypotheses, split by the sign of the rate.
///
/// Each predicted Gaussian is truncated at rate zero. The masses of the halves are the probabilities of stretching and
/// releasing, and each half drives the branches with its own gains. With a [`Dwell`] there is also a hold phase, entered
/// and left with the chain's probabilities; moving phases turn around by crossing rate zero, not by the chain.
///
/// In a pause of the readings, truncation stops once the rate has lost its direction. If a Gaussian were truncated and merged with
/// the other half at every row, its direction, and so the distance that the body may have moved, would depend on the number of
/// rows. Instead each hypothesis continues with an uncertain direction, like an [`Ekf`](crate::Ekf), and the next reading splits
/// it.
///
/// A truncated Gaussian-sum split. `G` as for [`SparseEkf`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignSplit<T, const B: usize, const N: usize, const K: usize, S = Compact, G = AnyCurve<T>> {
    pub(crate) kernel: SparseEkf<T, S, B, N, G>,
    hold: Option<Dwell<T>>,
    /// Probabilities of a change of phase over a step, `[from][to]`; `None` for a body that never rests.
    pub(crate) chain: Option<[[T; 3]; 3]>,
    pub(crate) weighing: Weighing<T>,
    /// Initial rate of each phase after a hold.
    pub(crate) fresh: [Gaussian<T>; 3],
    /// Time without a reading, s, after which steps leave the direction open.
    pub(crate) forgets_direction_s: T,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> SignSplit<T, B, N, K> {
    /// A filter for steps of `dt_s` seconds.
    /// - `hold`: durations of holds and movements; `None` for a body that never rests.
    /// - `evidence`: evidence that weighs the hypotheses.
    ///
    /// # Errors
    /// If `dt_s` is negative or not finite.
    pub fn new(
        model: SwitchedModel<T, B, N>,
        dt_s: T,
        hold: Option<Dwell<T>>,
        evidence: Evidence<T>,
    ) -> Result<Self, StepError> {
        Ok(Self::around(SparseEkf::of_any_length(model, dt_s)?, hold, evidence))
    }
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> SignSplit<T, B, N, K, S, G> {
    /// Creates a filter whose hypotheses step like `kernel`; the other arguments are those of [`Self::new`]. Only the
    /// square root of the kernel's switch is used, except in a pause, where the direction stays open.
    pub fn around(kernel: SparseEkf<T, S, B, N, G>, hold: Option<Dwell<T>>, evidence: Evidence<T>) -> Self {
        Self {
            hold,
            chain: hold.map(|dwell| dwell.probabilities(kernel.dt_s())),
            weighing: Weighing::new(evidence),
            fresh: Phase::ALL.map(|phase| fresh_rate(kernel.model().motion(), phase)),
            forgets_direction_s: forgets_direction_s(kernel.model()),
            kernel,
        }
    }

    fn longest_s(&self) -> T {
        longest_cut_s(self.model())
    }

    /// Returns the filter for steps of another length.
    fn every(&self, dt_s: T) -> Self {
        let mut other = *self;
        other.kernel.set_length(dt_s);
        other.chain = other.hold.map(|dwell| dwell.probabilities(dt_s));
        other
    }

    mixture_steps!();
}

impl<T: Real, const B: usize, const N: usize, const K: usize, S: Switch<T>, G: Curve<T>> Spawns<T, B, N>
    for SignSplit<T, B, N, K, S, G>
{
    type Switch = S;

    fn weighing(&self) -> &Weighing<T> {
        &self.weighing
    }

    #[inline(always)]
    fn pause_after(&self, before: &Pause<T>, is_read: bool) -> Pause<T> {
        if is_read { Pause::over() } else { before.goes_on(self.kernel.dt_s(), self.forgets_direction_s) }
    }

    #[inline(always)]
    fn follows(&self, from: Phase, open: bool) -> [T; 3] {
        if open { goes_on(self.chain.as_ref(), from) } else { follows(self.chain.as_ref(), from) }
    }

    /// Returns the excess path, zero after a hold. An open direction is that of the mean rate.
    #[inline(always)]
    fn turning<V: Several<Number = T>, X: Switch<V>>(
        &self,
        from: &[V::Mask; 3],
        belief: &Parts<V, B>,
        was_open: bool,
    ) -> Turning<V> {
        let (ahead, back) = (side_of(Phase::Extend, belief.rate), side_of(Phase::Retract, belief.rate));
        let retracts = if was_open { belief.rate.less(belief.rate.nothing()) } else { from[Phase::Retract.index()] };
        let moves = V::either(from[Phase::Extend.index()], from[Phase::Retract.index()]);
        self.kernel.turning::<V, X>(V::pick(retracts, back, ahead), belief, moves)
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
        let mut alive = V::both(parents.there, probability.nothing().less(probability));
        if V::none(alive) {
            return None;
        }
        let (moves, side) = (phase != Phase::Hold, side_of(phase, parts.rate));
        let mut begins = V::without(parents.there, parents.there);
        if moves && self.chain.is_some() {
            begins = parents.from[Phase::Hold.index()];
            if !V::none(begins) {
                parts.renew_rate(self.fresh[phase.index()].in_lanes(parts.rate), begins);
            }
        }
        let course = match parents.turning {
            Some(turning) if moves => {
                alive = V::without(alive, self.kernel.is_hopeless(side, parts));
                if V::none(alive) {
                    return None;
                }
                Course::Within(phase, turning)
            }
            None if moves && V::none(begins) => Course::Uncertain,
            _ => Course::Known(phase),
        };
        trace.starts(parts, begins, &course);
        let spread = self.kernel.predict::<V, X>(parts, course);
        trace.ahead(parts);
        let mut prior = parents.weight * probability;
        if moves && parents.turning.is_some() {
            let mass = parts.cut_rate::<X, N>(side, self.weighing.clear(), alive);
            alive = V::both(alive, mass.literal(LEAST_MASS).less(mass));
            if V::none(alive) {
                return None;
            }
            // After a hold, the chain alone gives the probability of this direction; the truncated mass does not reduce
            // it.
            let given = V::both(begins, mass.literal(0.5).less(mass));
            prior = V::pick(given, prior, prior * mass);
        }
        let children = PredictedChildren { parts, phase, prior, spread, per_inside: parents.per_inside, alive };
        Some(self.kernel.weigh(children, reading, &self.weighing))
    }
}

/// Smallest mass left by a truncation. Below it a child is dropped, because its moments would be those of a far tail.
pub(crate) const LEAST_MASS: f64 = 1e-3;

/// Returns the probabilities of the phases that follow `phase`, in the order of [`Phase::ALL`]. The truncation at rate zero
/// decides between stretching and releasing.
fn follows<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    match (chain, phase) {
        (None, _) => [T::one(), T::zero(), T::one()],
        (Some(chain), Phase::Hold) => chain[1],
        (Some(chain), _) => [T::one() - chain[0][1], chain[0][1], T::one() - chain[0][1]],
    }
}

/// Returns the probabilities if the direction stays open: a movement continues as one hypothesis until a reading splits
/// it.
fn goes_on<T: Real>(chain: Option<&[[T; 3]; 3]>, phase: Phase) -> [T; 3] {
    let (stops, zero) = (chain.map_or(T::zero(), |chain| chain[0][1]), T::zero());
    match (chain, phase) {
        (Some(chain), Phase::Hold) => chain[1],
        (_, Phase::Retract) => [zero, stops, T::one() - stops],
        _ => [T::one() - stops, stops, zero],
    }
}

mixture_filter!(SignSplit<B, N, K>, Mixture<K>);
