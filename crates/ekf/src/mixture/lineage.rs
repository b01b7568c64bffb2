use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Phase, Symmetric, Transition};

use crate::belief::gaussian::Real;
use crate::mixture::{Added, Component, Mixture, moment_match};
use crate::smooth::rts_step;
use crate::{Belief, Phased};

/// Hears of every child that a step of a filter of hypotheses makes. The filter itself listens with `()`.
pub(crate) trait Recorder<T, const N: usize, const L: usize> {
    /// Where a child went, or where it is to have gone.
    fn place(&self, _parent: usize, _phase: Phase, added: Added) -> Added {
        added
    }
    /// A child was put into place `heir` of the new mixture, merged or alone.
    fn born(&mut self, _birth: &Birth<'_, T, N, L>, _heir: usize) {}
    /// The contents of every place moved to another one, or nowhere.
    fn renumbered(&mut self, _new_place: impl Fn(usize) -> Option<usize>) {}
}

impl<T, const N: usize, const L: usize> Recorder<T, N, L> for () {}

impl<T, R: Recorder<T, N, L>, const N: usize, const L: usize> Recorder<T, N, L> for &mut R {
    fn place(&self, parent: usize, phase: Phase, added: Added) -> Added {
        (**self).place(parent, phase, added)
    }

    fn born(&mut self, birth: &Birth<'_, T, N, L>, heir: usize) {
        (**self).born(birth, heir);
    }

    fn renumbered(&mut self, new_place: impl Fn(usize) -> Option<usize>) {
        (**self).renumbered(new_place);
    }
}

/// A child at its birth.
pub(crate) struct Birth<'a, T, const N: usize, const L: usize> {
    /// Which hypothesis it comes from.
    pub parent: usize,
    pub phase: Phase,
    /// Where it started: the parent's belief, rates drawn anew if a phase began.
    pub from: &'a Belief<T, N, L>,
    /// Whether a phase began.
    pub begins: bool,
    pub transition: &'a Transition<T, N, L>,
    /// The prediction before it was cut.
    pub predicted: &'a Belief<T, N, L>,
    /// The belief that went into the new mixture, before it was merged with others.
    pub posterior: &'a Belief<T, N, L>,
    /// Logarithm of its share of the new mixture, not normalised.
    pub log_weight: T,
}

/// Who descends from whom in one step of a filter of hypotheses: what its smoother goes back along.
///
/// Source of the recursion: Kim, *J. Econometrics* 60 (1994) 1, here over hypotheses that are merged and pruned.
pub(crate) struct Lineage<T, const N: usize, const L: usize, const K: usize> {
    /// By parent and phase.
    children: [[Option<Descent<T, N, L>>; 3]; K],
    /// States that are drawn anew when a phase begins.
    renewed: core::ops::Range<usize>,
}

struct Descent<T, const N: usize, const L: usize> {
    /// From the parent, renewed rates included.
    transition: Transition<T, N, L>,
    predicted: Belief<T, N, L>,
    posterior: Belief<T, N, L>,
    log_weight: T,
    heir: usize,
}

/// Children with less of the smoothed weight than this leave no trace in the moments.
const LEAST_SHARE: f64 = 1e-7;

impl<T: Real, const N: usize, const L: usize, const K: usize> Recorder<T, N, L> for Lineage<T, N, L, K> {
    fn born(&mut self, birth: &Birth<'_, T, N, L>, heir: usize) {
        let transition = if birth.begins { self.through_renewal(birth) } else { *birth.transition };
        let (predicted, posterior, log_weight) = (*birth.predicted, *birth.posterior, birth.log_weight);
        let descent = Descent { transition, predicted, posterior, log_weight, heir };
        if let Some(place) = self.children.get_mut(birth.parent).map(|phases| &mut phases[birth.phase.index()]) {
            *place = Some(descent);
        }
    }

    fn renumbered(&mut self, new_place: impl Fn(usize) -> Option<usize>) {
        for child in self.children.iter_mut().flatten() {
            *child = child.take().and_then(|child| Some(Descent { heir: new_place(child.heir)?, ..child }));
        }
    }
}

impl<T: Real, const N: usize, const L: usize> Descent<T, N, L> {
    /// What all readings say of this child, from what they say of the hypothesis it was merged into.
    ///
    /// A child that is far from the merged mean must not be drawn there: the merged hypothesis counts as the child plus
    /// noise of the size of their distance, and the smoother goes back through that.
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
    pub(crate) fn new<M: Phased<T, N, L>>(model: &M) -> Self {
        Self { children: core::array::from_fn(|_| [None, None, None]), renewed: model.renewed() }
    }

    /// The transition from the parent itself: what is drawn anew does not depend on it, and its spread is process noise.
    fn through_renewal(&self, birth: &Birth<'_, T, N, L>) -> Transition<T, N, L> {
        let mut fresh = Symmetric::zeros();
        let mut jacobian = birth.transition.jacobian;
        for i in self.renewed.clone() {
            for j in self.renewed.clone() {
                fresh[(i, j)] = birth.from.covariance[(i, j)];
            }
            jacobian.set_column(i, &SVector::zeros());
        }
        let noise = fresh.congruence(&birth.transition.jacobian).plus(&birth.transition.noise);
        Transition { jacobian, noise, ..*birth.transition }
    }

    /// The hypotheses at the beginning of the step given all readings, in the order of `filtered`. `heirs` are those that
    /// the step made, `next` the same ones given all readings.
    pub(crate) fn smooth(
        &self,
        filtered: &Mixture<T, N, L, K>,
        heirs: &Mixture<T, N, L, K>,
        next: &Mixture<T, N, L, K>,
    ) -> Mixture<T, N, L, K> {
        let totals: [T; K] = core::array::from_fn(|heir| self.log_total(heir));
        let mut smoothed = Mixture::empty();
        smoothed.set_pause(*filtered.pause());
        for (parent, children) in filtered.components().iter().zip(&self.children) {
            let ways: [(T, Belief<T, N, L>); 3] = core::array::from_fn(|phase| {
                let way = children.get(phase).and_then(|child| {
                    let child = child.as_ref()?;
                    let (merged, heir) = (heirs.components().get(child.heir)?, next.components().get(child.heir)?);
                    let share = (heir.log_weight + child.log_weight - *totals.get(child.heir)?).exp();
                    let back = || {
                        let own = child.unmerged(&merged.belief, &heir.belief);
                        rts_step(&parent.belief, &child.transition, &child.predicted, &own)
                    };
                    (share > T::of(LEAST_SHARE)).then(|| (share, back()))
                });
                way.unwrap_or((T::zero(), parent.belief))
            });
            let weight = ways.iter().fold(T::zero(), |sum, (share, _)| sum + *share);
            let belief = if weight > T::zero() {
                moment_match(ways.iter().map(|(share, belief)| (*share / weight, belief)))
            } else {
                parent.belief
            };
            smoothed.push(Component { log_weight: weight.ln(), belief, ..*parent });
        }
        smoothed.with_sum_one()
    }

    /// Logarithm of the sum of the weights that were merged into a place.
    fn log_total(&self, heir: usize) -> T {
        let weights = || {
            let all = self.children.iter().flatten().flatten();
            all.filter(|child| child.heir == heir).map(|child| child.log_weight)
        };
        let Some(heaviest) = weights().reduce(|a, b| a.max(b)) else { return T::zero() };
        heaviest + weights().fold(T::zero(), |sum, weight| sum + (weight - heaviest).exp()).ln()
    }
}
