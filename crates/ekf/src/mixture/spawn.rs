//! The children of hypotheses side by side: one hypothesis, or one per lane of a vector.

use core::marker::PhantomData;

use ohmstrain_model::{Phase, Turning};

use crate::Real;
use crate::kernel::{Course, Lanes, MOST_LANES, Parts, Several, Work, refusal};
use crate::mixture::Added;
use crate::mixture::children::Children;
use crate::mixture::evidence::{UpdatedChildren, Weighing};
use crate::mixture::lineage::{ChildRecord, Recorder};
use crate::mixture::pause::Pause;
use crate::mixture::predicted::Predicted;
use crate::mixture::state::{Mixture, Share};
use crate::{Compact, MixtureResidual, Reading, Residual, StepError, Switch};

/// Hypotheses side by side, with values shared by their children.
pub(crate) struct Parents<V: Lanes> {
    pub weight: V,
    /// Inverse of the probability of the limits.
    pub per_inside: V,
    /// Lanes that hold a parent.
    pub there: V::Mask,
    /// Lanes of the parents in each phase; `follows` has the probability of each next phase.
    pub from: [V::Mask; 3],
    pub follows: [V; 3],
    /// Excess path of their rates over the step; `None` if the direction is open in a pause, a step that vectors do not
    /// handle.
    pub turning: Option<Turning<V>>,
}

/// Recorder of children before the reading.
pub(crate) trait ChildTrace<V: Lanes, const B: usize> {
    /// Records the initial beliefs: the parents', with a new rate where a phase `begins`.
    fn starts(&mut self, _from: &Parts<V, B>, _begins: V::Mask, _course: &Course<V>) {}
    /// Records the prediction before truncation.
    fn ahead(&mut self, _predicted: &Parts<V, B>) {}
}

/// Trace that records nothing.
impl<V: Lanes, const B: usize> ChildTrace<V, B> for () {}

/// Data of a child that a recorder receives.
struct ChildPath<T, const B: usize> {
    from: Parts<T, B>,
    begins: bool,
    course: Course<T>,
    predicted: Parts<T, B>,
}

impl<T: Real, const B: usize> ChildTrace<T, B> for Option<ChildPath<T, B>> {
    #[inline(always)]
    fn starts(&mut self, from: &Parts<T, B>, begins: bool, course: &Course<T>) {
        if let Some(path) = self {
            (path.from, path.begins, path.course) = (*from, begins, *course);
        }
    }

    #[inline(always)]
    fn ahead(&mut self, predicted: &Parts<T, B>) {
        if let Some(path) = self {
            path.predicted = *predicted;
        }
    }
}

/// A filter whose hypotheses have at most one child in each phase.
pub(crate) trait Spawns<T: Real, const B: usize, const N: usize> {
    /// Switch that splits uncertain rates, and takes roots, for scalars.
    type Switch: Switch<T>;

    fn weighing(&self) -> &Weighing<T>;

    /// Returns the pause of the readings after a step, given the one before it; over for filters that need none.
    #[inline(always)]
    fn pause_after(&self, _before: &Pause<T>, _is_read: bool) -> Pause<T> {
        Pause::over()
    }

    /// Returns the probabilities of the phases after one; `open` if its direction is not used.
    fn follows(&self, from: Phase, open: bool) -> [T; 3];

    /// Returns the excess path of hypotheses whose rates may turn around, with the lanes `from` each phase; `was_open` if their
    /// directions were open in the previous step.
    fn turning<V: Several<Number = T>, X: Switch<V>>(
        &self,
        from: &[V::Mask; 3],
        belief: &Parts<V, B>,
        was_open: bool,
    ) -> Turning<V>;

    /// Turns parents' beliefs into their children of one phase; `None` if there are none.
    fn spawn<V: Several<Number = T>, X: Switch<V>>(
        &self,
        parts: &mut Parts<V, B>,
        parents: &Parents<V>,
        phase: Phase,
        reading: Option<Reading<V>>,
        trace: &mut impl ChildTrace<V, B>,
    ) -> Option<UpdatedChildren<V>>;
}

/// One step of a filter.
pub(crate) struct MixtureStep<'a, F, T, const B: usize, const N: usize, const L: usize, const K: usize> {
    pub filter: &'a F,
    pub state: &'a Mixture<T, N, L, K>,
    pub reading: Option<Reading<T>>,
    /// Mixture to be filled with the children.
    pub next: &'a mut Mixture<T, N, L, K>,
    /// True if directions stay open.
    pub open: bool,
    pub branches: PhantomData<[T; B]>,
}

type StepResult<T> = Result<Option<MixtureResidual<T>>, StepError>;

impl<F: Spawns<T, B, N>, T: Real, const B: usize, const N: usize, const L: usize, const K: usize>
    MixtureStep<'_, F, T, B, N, L, K>
{
    /// Computes the step in vectors if there are any, unless a recorder follows each child, or directions stay open.
    #[inline(always)]
    pub(crate) fn done<R: Recorder<T, B>>(self, recorder: &mut R) -> StepResult<T> {
        if !R::RECORDS && !self.open {
            // A step that fails in vectors is repeated with scalars, which gives the reason.
            if let Some(Ok(residual)) = T::in_vectors(MixtureStep { next: &mut *self.next, ..self }) {
                return Ok(residual);
            }
        }
        self.one_by_one(recorder)
    }

    #[inline(always)]
    fn one_by_one<R: Recorder<T, B>>(self, recorder: &mut R) -> StepResult<T> {
        let Self { filter, state, reading, next, open, .. } = self;
        let (mut children, mut predicted) = (Children::new(next, state.room()), Predicted::new());
        for (place, (share, from)) in state.shares().iter().zip(state.phases()).enumerate() {
            let comes = Phase::ALL.map(|phase| *from == phase);
            let turning = |before| filter.turning::<T, F::Switch>(&comes, &before, state.pause().open);
            let turning = (!open).then(|| turning(Parts::of(&share.belief)));
            let parents = Parents {
                weight: share.weight,
                per_inside: share.per_inside,
                there: true,
                from: comes,
                follows: filter.follows(*from, open),
                turning,
            };
            for phase in Phase::ALL {
                // Before anything is copied.
                if !(parents.follows[phase.index()] > T::zero()) {
                    continue;
                }
                let mut child = Parts::of(&share.belief);
                let mut path = R::RECORDS.then_some(ChildPath {
                    from: child,
                    begins: false,
                    course: Course::Uncertain,
                    predicted: child,
                });
                let Some(updated) = filter.spawn::<T, F::Switch>(&mut child, &parents, phase, reading, &mut path)
                else {
                    continue;
                };
                if !updated.sound {
                    return Err(refusal(reading, &updated.residual));
                }
                let added = collect(&mut children, &mut predicted, (&child, &updated), (0, phase), reading.is_some());
                if let Some(ChildPath { from, begins, course, predicted }) = &path {
                    let (posterior, weighed, course, begins) = (&child, &updated.weighed, *course, *begins);
                    let record =
                        ChildRecord { parent: place, phase, from, begins, course, predicted, posterior, weighed };
                    recorder.record(&record, added);
                }
            }
        }
        let density = children.density();
        children.normalise(recorder)?;
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, filter.weighing().tempering())))
    }
}

impl<F: Spawns<T, B, N>, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Work<T>
    for MixtureStep<'_, F, T, B, N, L, K>
{
    type Output = StepResult<T>;

    #[inline(always)]
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> StepResult<T> {
        let Self { filter, state, reading, next, .. } = self;
        let in_lanes = reading.map(|Reading { value, extra_variance }| Reading {
            value: like.with(value),
            extra_variance: like.with(extra_variance),
        });
        let (mut children, mut predicted) = (Children::new(next, state.room()), Predicted::new());
        let mut place = 0;
        while let Some(first) = state.at(place) {
            // Unused lanes are filled with the first one's numbers.
            let mut of = [first; MOST_LANES];
            for lane in 1..V::WIDTH {
                of[lane] = state.at(place + lane).unwrap_or(first);
            }
            let there = like.mask(|lane| place + lane < state.shares().len());
            let start = Parts::gathered(like, |lane| &of[lane].0.belief);
            let parents = side_by_side(filter, &start, &of, (there, state.pause().open));
            let [mut extend, mut hold, mut retract] = [start; 3];
            let spawned = [
                filter.spawn::<V, Compact>(&mut extend, &parents, Phase::Extend, in_lanes, &mut ()),
                filter.spawn::<V, Compact>(&mut hold, &parents, Phase::Hold, in_lanes, &mut ()),
                filter.spawn::<V, Compact>(&mut retract, &parents, Phase::Retract, in_lanes, &mut ()),
            ];
            if spawned.iter().flatten().any(|updated| !V::none(V::without(updated.alive, updated.sound))) {
                return Err(StepError::NonFiniteState);
            }
            for lane in 0..V::WIDTH {
                for ((phase, parts), updated) in Phase::ALL.into_iter().zip([&extend, &hold, &retract]).zip(&spawned) {
                    if let Some(updated) = updated
                        && V::holds(updated.alive, lane)
                    {
                        collect(&mut children, &mut predicted, (parts, updated), (lane, phase), reading.is_some());
                    }
                }
            }
            place += V::WIDTH;
        }
        let density = children.density();
        children.normalise::<B>(&mut ())?;
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, filter.weighing().tempering())))
    }
}

/// Returns the values shared by the children of hypotheses in the lanes of vectors.
#[inline(always)]
fn side_by_side<F, V, const B: usize, const N: usize, const L: usize>(
    filter: &F,
    beliefs: &Parts<V, B>,
    of: &[(&Share<V::Number, N, L>, Phase); MOST_LANES],
    (there, was_open): (V::Mask, bool),
) -> Parents<V>
where
    V: Several<Number: Real>,
    F: Spawns<V::Number, B, N>,
{
    let [weight, per_inside, extend, hold, retract] = beliefs.strain.build(|lane| {
        let (share, from) = of[lane];
        let [extend, hold, retract] = filter.follows(from, false);
        [share.weight, share.per_inside, extend, hold, retract]
    });
    let comes = |phase| beliefs.strain.mask(|lane| of[lane].1 == phase);
    let from = [comes(Phase::Extend), comes(Phase::Hold), comes(Phase::Retract)];
    let turning = Some(filter.turning::<V, Compact>(&from, beliefs, was_open));
    Parents { weight, per_inside, there, from, follows: [extend, hold, retract], turning }
}

/// Adds the child in a lane to the others.
#[inline(always)]
fn collect<V, const B: usize, const N: usize, const L: usize, const K: usize>(
    children: &mut Children<'_, V::Number, N, L, K>,
    predicted: &mut Predicted<V::Number>,
    (parts, updated): (&Parts<V, B>, &UpdatedChildren<V>),
    (lane, phase): (usize, Phase),
    compared: bool,
) -> Added
where
    V: Several<Number: Real>,
{
    if compared {
        let Residual { innovation, variance, .. } = &updated.residual;
        predicted.add(updated.prior.at(lane), innovation.at(lane), variance.at(lane));
    }
    children.add(parts, lane, phase, &updated.weighed.in_lane(lane))
}
