//! Lineage of the children in a step of a filter of hypotheses, which its smoother follows backwards.

use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Direction, Phase, SwitchedModel, SwitchedStep, Symmetric, Transition};

use crate::Belief;
use crate::Real;
use crate::kernel::{Course, Parts};
use crate::mixture::evidence::Weighed;
use crate::mixture::state::Share;
use crate::mixture::{Added, moment_match};
use crate::smooth::rts_step;

/// Recorder of every child in a step of a filter of hypotheses. The filter itself uses `()`, which records nothing.
pub(crate) trait Recorder<T: Real, const B: usize> {
    /// True if it needs a call for each child.
    const RECORDS: bool = true;

    /// Records a child that was put into the new mixture, merged or alone.
    fn record(&mut self, _record: &ChildRecord<'_, T, B>, _added: Added) {}
    /// Records that the contents of every place moved to another one, or were dropped.
    fn renumbered(&mut self, _new_place: impl Fn(usize) -> Option<usize>) {}
}

impl<T: Real, const B: usize> Recorder<T, B> for () {
    const RECORDS: bool = false;
}

/// A child, and the step from its parent.
pub(crate) struct ChildRecord<'a, T, const B: usize> {
    /// Index of the parent hypothesis.
    pub parent: usize,
    pub phase: Phase,
    /// Initial belief: the parent's, with a new rate if a phase began.
    pub from: &'a Parts<T, B>,
    /// True if a phase began.
    pub begins: bool,
    pub course: Course<T>,
    /// The prediction before truncation.
    pub predicted: &'a Parts<T, B>,
    /// The updated belief, before merging.
    pub posterior: &'a Parts<T, B>,
    pub weighed: &'a Weighed<T>,
}

/// The children of one step. Source of the recursion: Kim, *J. Econometrics* 60 (1994) 1, here over hypotheses that are merged
/// and pruned.
pub(crate) struct Lineage<T, const N: usize, const L: usize, const K: usize> {
    /// Children, indexed by parent and phase.
    children: [[Option<Descent<T, N, L>>; 3]; K],
}

/// A child and its component in the new mixture.
pub(crate) struct Descent<T, const N: usize, const L: usize> {
    /// Transition from the parent, including a renewed rate.
    pub transition: Transition<T, N, L>,
    pub predicted: Belief<T, N, L>,
    pub posterior: Belief<T, N, L>,
    /// Unnormalised log weight in the new mixture.
    pub log_weight: T,
    pub component: usize,
}

/// Recorder of a step of a sensor's filter, with linearisations of the model.
pub(crate) struct Following<'a, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> {
    pub lineage: Lineage<T, N, L, K>,
    model: &'a SwitchedModel<T, B, N>,
    step: SwitchedStep<T, B>,
}

/// Limits on smoothed variances, and on squared shifts of means, relative to the filtered variances; later readings cannot
/// cause larger ratios. A merged hypothesis represents its children only approximately. For a state that decays without
/// noise, the backward pass amplifies an excess e-fold per time constant, in a gap without bound.
const ASTRAY: [f64; 2] = [4.0, 400.0];

fn is_astray<T: Real, const N: usize, const L: usize>(smoothed: &Belief<T, N, L>, filtered: &Belief<T, N, L>) -> bool {
    (0..N).any(|i| {
        let (moved, variance) = (smoothed.mean[i] - filtered.mean[i], filtered.covariance[(i, i)]);
        let least = T::of(ASTRAY[0]) * variance >= smoothed.covariance[(i, i)];
        !(least && moved * moved <= T::of(ASTRAY[1]) * variance)
    })
}

/// Smallest share of the smoothed weight with which a child counts in the moments.
const LEAST_SHARE: f64 = 1e-7;

impl<'a, T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Following<'a, T, B, N, L, K> {
    pub(crate) fn new(model: &'a SwitchedModel<T, B, N>, dt_s: T) -> Self {
        Self { lineage: Lineage::new(), model, step: model.prepare(dt_s) }
    }

    fn transition(&self, record: &ChildRecord<'_, T, B>) -> Transition<T, N, L> {
        let from: Belief<T, N, L> = record.from.together();
        let direction = match record.course {
            Course::Known(phase) => Direction::Known(phase),
            Course::Within(phase, turning) => Direction::Within { phase, turning },
            Course::Uncertain => self.model.uncertain_direction(&self.step, &from.covariance),
        };
        let transition = self.model.transition(&self.step, &from.mean, direction);
        if record.begins { through_renewal(transition, from.covariance[(1, 1)]) } else { transition }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Recorder<T, B>
    for Following<'_, T, B, N, L, K>
{
    fn record(&mut self, record: &ChildRecord<'_, T, B>, added: Added) {
        let component = match added {
            Added::To(component) => component,
            Added::InsteadOf(component, into) => {
                self.lineage.renumber(|place| if place == component { into } else { Some(place) });
                component
            }
            Added::Nowhere => return self.lineage.put(record.parent, record.phase, None),
        };
        let Weighed { weight, more_inside, .. } = *record.weighed;
        let descent = Descent {
            transition: self.transition(record),
            predicted: record.predicted.together(),
            posterior: record.posterior.together(),
            log_weight: (weight.factor * more_inside).ln() + weight.exponent,
            component,
        };
        self.lineage.put(record.parent, record.phase, Some(descent));
    }

    fn renumbered(&mut self, new_place: impl Fn(usize) -> Option<usize>) {
        self.lineage.renumber(new_place);
    }
}

/// Returns the transition from the state before a phase began: the new rate is independent of the old one, and its
/// variance is process noise.
pub(crate) fn through_renewal<T: Real, const N: usize, const L: usize>(
    transition: Transition<T, N, L>,
    fresh_variance: T,
) -> Transition<T, N, L> {
    let Transition { mean, mut jacobian, mut noise } = transition;
    noise.add_outer(&jacobian.column(1).into_owned(), fresh_variance);
    jacobian.set_column(1, &SVector::zeros());
    Transition { mean, jacobian, noise }
}

impl<T: Real, const N: usize, const L: usize> Descent<T, N, L> {
    /// Returns the smoothed belief of this child, from the smoothed belief of the hypothesis into which it was merged.
    ///
    /// A child far from the merged mean must not be pulled toward it. The merged hypothesis is therefore modelled as
    /// the child plus noise of the size of their distance, and smoothed back through that.
    fn unmerged(&self, merged: &Belief<T, N, L>, smoothed: &Belief<T, N, L>) -> Belief<T, N, L> {
        let distance = merged.mean - self.posterior.mean;
        if distance.iter().all(|x| x.is_zero()) {
            return *smoothed;
        }
        let mut noise = Symmetric::zeros();
        noise.add_outer(&distance, T::one());
        let prior = Belief { mean: merged.mean, covariance: self.posterior.covariance.plus(&noise) };
        let merging = Transition { mean: merged.mean, jacobian: SMatrix::identity(), noise };
        rts_step(&self.posterior, &merging, &prior, smoothed)
    }
}

impl<T: Real, const N: usize, const L: usize, const K: usize> Lineage<T, N, L, K> {
    pub(crate) const fn new() -> Self {
        Self { children: [const { [None, None, None] }; K] }
    }

    pub(crate) fn put(&mut self, parent: usize, phase: Phase, descent: Option<Descent<T, N, L>>) {
        if let Some(place) = self.children.get_mut(parent).and_then(|phases| phases.get_mut(phase.index())) {
            *place = descent;
        }
    }

    fn renumber(&mut self, new_place: impl Fn(usize) -> Option<usize>) {
        for place in self.children.iter_mut().flatten() {
            let Some(child) = place else { continue };
            match new_place(child.component) {
                Some(component) => child.component = component,
                None => *place = None,
            }
        }
    }

    /// Smooths the hypotheses at the start of the step: `smoothed` holds the filtered ones and is overwritten. `components`
    /// are the hypotheses after the step, `next` the same ones smoothed.
    pub(crate) fn smooth(
        &self,
        smoothed: &mut [Share<T, N, L>],
        components: &[Share<T, N, L>],
        next: &[Share<T, N, L>],
    ) {
        let totals: [T; K] = core::array::from_fn(|component| self.log_total(component));
        let mut total = T::zero();
        for (parent, children) in smoothed.iter_mut().zip(&self.children) {
            let ways: [(T, Belief<T, N, L>); 3] = core::array::from_fn(|phase| {
                let way = children.get(phase).and_then(|child| {
                    let child = child.as_ref()?;
                    let (merged, component) = (components.get(child.component)?, next.get(child.component)?);
                    let share = component.weight * (child.log_weight - *totals.get(child.component)?).exp();
                    let back = || {
                        let own = child.unmerged(&merged.belief, &component.belief);
                        let back = rts_step(&parent.belief, &child.transition, &child.predicted, &own);
                        if is_astray(&back, &parent.belief) { parent.belief } else { back }
                    };
                    (share > T::of(LEAST_SHARE)).then(|| (share, back()))
                });
                way.unwrap_or((T::zero(), parent.belief))
            });
            parent.weight = ways.iter().fold(T::zero(), |sum, (share, _)| sum + *share);
            if parent.weight > T::zero() {
                parent.belief = moment_match(ways.iter().map(|(share, belief)| (*share / parent.weight, belief)));
            }
            total += parent.weight;
        }
        for parent in smoothed {
            parent.weight /= total;
        }
    }

    /// Returns the logarithm of the sum of the weights merged into a component.
    fn log_total(&self, component: usize) -> T {
        let weights = || {
            let all = self.children.iter().flatten().flatten();
            all.filter(|child| child.component == component).map(|child| child.log_weight)
        };
        let Some(heaviest) = weights().reduce(|a, b| a.max(b)) else { return T::zero() };
        heaviest + weights().fold(T::zero(), |sum, weight| sum + (weight - heaviest).exp()).ln()
    }
}
