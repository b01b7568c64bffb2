use nalgebra::SVector;
use ohmstrain_model::{Phase, Symmetric};

use crate::belief::gaussian::Real;
use crate::mixture::pause::{Pause, PhaseSum};
use crate::mixture::{Component, Mixture, marginal_match, moment_match};
use crate::{Belief, Gaussian, State, StepError};

/// A Gaussian and its share of a mixture. Shares are probabilities, not logarithms: nothing is to be converted at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share<T, const N: usize, const L: usize> {
    /// Its probability; zero where nothing is followed.
    pub weight: T,
    /// The state, given the hypothesis.
    pub belief: Belief<T, N, L>,
    /// As in [`Component`].
    pub(crate) per_inside: T,
}

impl<T: Real, const N: usize, const L: usize> Share<T, N, L> {
    fn component(&self, phase: Phase) -> Component<T, N, L> {
        Component { log_weight: self.weight.ln(), phase, belief: self.belief, per_inside: self.per_inside }
    }

    fn of(component: &Component<T, N, L>) -> Self {
        Self { weight: component.log_weight.exp(), belief: component.belief, per_inside: component.per_inside }
    }
}

/// One Gaussian per phase: what [`SparseImm`](crate::SparseImm) carries from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseMixture<T, const N: usize, const L: usize> {
    pub(crate) modes: [Share<T, N, L>; 3],
}

impl<T: Real, const N: usize, const L: usize> PhaseMixture<T, N, L> {
    /// One phase that has all the weight.
    #[must_use]
    pub fn single(belief: Belief<T, N, L>, phase: Phase) -> Self {
        let weight = |of| if of == phase { T::one() } else { T::zero() };
        Self { modes: Phase::ALL.map(|of| Share { weight: weight(of), belief, per_inside: T::one() }) }
    }

    /// The Gaussians in the order of [`Phase::ALL`]; one without weight is not followed.
    #[must_use]
    pub const fn modes(&self) -> &[Share<T, N, L>; 3] {
        &self.modes
    }

    /// Probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        core::array::from_fn(|i| self.modes[i].weight)
    }

    fn shares(&self) -> &[Share<T, N, L>] {
        &self.modes
    }

    fn mixture(&self) -> Mixture<T, N, L, 3> {
        let mut mixture = Mixture::empty();
        for (mode, phase) in self.modes.iter().zip(Phase::ALL).filter(|(mode, _)| mode.weight > T::zero()) {
            mixture.push(mode.component(phase));
        }
        mixture
    }

    /// A mixture that this one became: no two components of one phase.
    fn refilled(mut self, from: &Mixture<T, N, L, 3>) -> Self {
        for (mode, phase) in self.modes.iter_mut().zip(Phase::ALL) {
            let found = from.components().iter().find(|component| component.phase == phase);
            *mode = found.map_or(Share { weight: T::zero(), ..*mode }, Share::of);
        }
        self
    }
}

/// At most `K` Gaussians, each stretching, holding or releasing: what [`SparseSignSplit`](crate::SparseSignSplit) and
/// [`SparseHypotheses`](crate::SparseHypotheses) carry from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseMixture<T, const N: usize, const L: usize, const K: usize> {
    shares: [Share<T, N, L>; K],
    phases: [Phase; K],
    len: usize,
    pause: Pause<T>,
}

impl<T: Real, const N: usize, const L: usize, const K: usize> SparseMixture<T, N, L, K> {
    /// One Gaussian that has all the weight.
    #[must_use]
    pub fn single(belief: Belief<T, N, L>, phase: Phase) -> Self {
        let () = Mixture::<T, N, L, K>::CAPACITY;
        let share = Share { weight: T::one(), belief, per_inside: T::one() };
        Self { shares: [share; K], phases: [phase; K], len: 1, pause: Pause::over() }
    }

    #[inline(always)]
    pub(crate) fn empty() -> Self {
        let nothing = Belief { mean: SVector::zeros(), covariance: Symmetric::zeros() };
        let vacant = Share { weight: T::zero(), belief: nothing, per_inside: T::one() };
        Self { shares: [vacant; K], phases: [Phase::Hold; K], len: 0, pause: Pause::over() }
    }

    pub(crate) const fn pause(&self) -> &Pause<T> {
        &self.pause
    }

    pub(crate) fn set_pause(&mut self, pause: Pause<T>) {
        self.pause = pause;
    }

    /// One place more, if there is room.
    pub(crate) fn one_more(&mut self) -> Option<(&mut Share<T, N, L>, &mut Phase)> {
        let (share, phase) = (self.shares.get_mut(self.len)?, self.phases.get_mut(self.len)?);
        self.len += 1;
        Some((share, phase))
    }

    /// Drops those that do not count; the others keep their order.
    pub(crate) fn retain(&mut self, counts: impl Fn(&Share<T, N, L>) -> bool) {
        let mut kept = 0;
        for place in 0..self.len {
            if !self.shares.get(place).is_some_and(&counts) {
                continue;
            }
            if kept < place
                && let (Some(share), Some(phase)) = (self.shares.get(place).copied(), self.phases.get(place).copied())
                && let (Some(to), Some(of)) = (self.shares.get_mut(kept), self.phases.get_mut(kept))
            {
                (*to, *of) = (share, phase);
            }
            kept += 1;
        }
        self.len = kept;
    }

    /// Follows nothing.
    pub(crate) fn clear(&mut self) {
        (self.len, self.pause) = (0, Pause::over());
    }

    /// The Gaussians with their phases.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (&mut Share<T, N, L>, &mut Phase)> {
        self.shares.iter_mut().zip(self.phases.iter_mut()).take(self.len)
    }

    /// The Gaussians.
    #[must_use]
    pub fn shares(&self) -> &[Share<T, N, L>] {
        self.shares.get(..self.len).unwrap_or(&[])
    }

    /// Their phases.
    #[must_use]
    pub fn phases(&self) -> &[Phase] {
        self.phases.get(..self.len).unwrap_or(&[])
    }

    /// Probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        let mut probabilities = PhaseSum::new(self.pause.open);
        for (share, phase) in self.shares().iter().zip(self.phases()) {
            probabilities.add(share.weight, *phase, &share.belief);
        }
        probabilities.sums
    }

    fn mixture(&self) -> Mixture<T, N, L, K> {
        let mut mixture = Mixture::empty();
        mixture.set_pause(self.pause);
        for (share, phase) in self.shares().iter().zip(self.phases()) {
            mixture.push(share.component(*phase));
        }
        mixture
    }

    fn refilled(mut self, from: &Mixture<T, N, L, K>) -> Self {
        let places = self.shares.iter_mut().zip(self.phases.iter_mut());
        for ((share, phase), component) in places.zip(from.components()) {
            (*share, *phase) = (Share::of(component), component.phase);
        }
        self.len = from.components().len();
        self.pause = *from.pause();
        self
    }
}

impl<T: Real, const N: usize, const L: usize, const K: usize> From<&Mixture<T, N, L, K>> for SparseMixture<T, N, L, K> {
    fn from(mixture: &Mixture<T, N, L, K>) -> Self {
        Self::empty().refilled(mixture)
    }
}

/// What both have in common. Everything that is not done at every step goes through [`Mixture`].
macro_rules! sparse_state {
    ($state:ident<T, N, L $(, $k:ident)?>, $capacity:expr) => {
        impl<T: Real, const N: usize, const L: usize $(, const $k: usize)?> From<$state<T, N, L $(, $k)?>>
            for Mixture<T, N, L, { $capacity }>
        {
            fn from(state: $state<T, N, L $(, $k)?>) -> Self {
                state.mixture()
            }
        }

        impl<T: Real, const N: usize, const L: usize $(, const $k: usize)?> State<T, N, L>
            for $state<T, N, L $(, $k)?>
        {
            fn moments(&self) -> Belief<T, N, L> {
                let followed = self.shares().iter().filter(|share| share.weight > T::zero());
                moment_match(followed.map(|share| (share.weight, &share.belief)))
            }

            fn marginal(&self, index: usize) -> Gaussian<T> {
                marginal_match(self.shares().iter().map(|share| (share.weight, &share.belief)), index)
            }

            fn each(&self, visit: &mut dyn FnMut(T, &Belief<T, N, L>)) {
                for share in self.shares().iter().filter(|share| share.weight > T::zero()) {
                    visit(share.weight, &share.belief);
                }
            }

            fn phases(&self) -> Option<[T; 3]> {
                Some(self.phase_probabilities())
            }

            fn inflated(&self, factor: T) -> Self {
                self.refilled(&self.mixture().inflated(factor))
            }

            fn pinned(&self, index: usize, known: &Gaussian<T>) -> Result<Self, StepError> {
                Ok(self.refilled(&self.mixture().pinned(index, known)?))
            }
        }
    };
}

sparse_state!(PhaseMixture<T, N, L>, 3);
sparse_state!(SparseMixture<T, N, L, K>, K);
