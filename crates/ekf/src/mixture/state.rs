use nalgebra::SVector;
use ohmstrain_model::{Phase, Symmetric};

use crate::Real;
use crate::mixture::pause::{Pause, PhaseSum};
use crate::mixture::{marginal_match, moment_match};
use crate::{Belief, Gaussian, State};

/// A Gaussian and its share of a mixture. Shares are probabilities, not logarithms, so that steps need no conversion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share<T, const N: usize, const L: usize> {
    /// Probability of the hypothesis; zero if it is not followed.
    pub weight: T,
    /// The state, given the hypothesis.
    pub belief: Belief<T, N, L>,
    /// Inverse of the probability of the strain's limits under `belief`. Only changes of that probability enter the weight,
    /// so that evidence is not counted again at every step while the strain rests at a limit. The weight times this is the
    /// weight without limits, so that merging averages it.
    pub(crate) per_inside: T,
}

impl<T: Real, const N: usize, const L: usize> Share<T, N, L> {
    #[inline(always)]
    fn vacant() -> Self {
        let nothing = Belief { mean: SVector::zeros(), covariance: Symmetric::zeros() };
        Self { weight: T::zero(), belief: nothing, per_inside: T::one() }
    }
}

/// One Gaussian per phase, the state of [`Imm`](crate::Imm).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseMixture<T, const N: usize, const L: usize> {
    pub(crate) modes: [Share<T, N, L>; 3],
}

impl<T: Real, const N: usize, const L: usize> PhaseMixture<T, N, L> {
    /// Creates a state with all weight on one phase.
    #[must_use]
    pub fn single(belief: Belief<T, N, L>, phase: Phase) -> Self {
        let weight = |of| if of == phase { T::one() } else { T::zero() };
        Self { modes: Phase::ALL.map(|of| Share { weight: weight(of), belief, per_inside: T::one() }) }
    }

    /// Returns the Gaussians in the order of [`Phase::ALL`]; one without weight is not followed.
    #[must_use]
    pub const fn modes(&self) -> &[Share<T, N, L>; 3] {
        &self.modes
    }

    /// Returns the probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        core::array::from_fn(|i| self.modes[i].weight)
    }

    pub(crate) const fn shares(&self) -> &[Share<T, N, L>] {
        &self.modes
    }

    pub(crate) const fn shares_mut(&mut self) -> &mut [Share<T, N, L>] {
        &mut self.modes
    }

    #[inline(always)]
    pub(crate) fn empty() -> Self {
        Self { modes: [Share::vacant(); 3] }
    }

    /// Does nothing: each phase has only one place.
    const fn take_beside(&mut self, _other: &Self, _share: T) {}

    /// Does nothing: there are always three phases.
    const fn keep(&mut self, _most: usize) {}
}

/// Mixture of at most `K` Gaussians, each stretching, holding or releasing: the state of [`SignSplit`](crate::SignSplit) and
/// [`Hypotheses`](crate::Hypotheses).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture<T, const N: usize, const L: usize, const K: usize> {
    shares: [Share<T, N, L>; K],
    phases: [Phase; K],
    len: usize,
    /// Maximum number of hypotheses that steps keep, at most `K`.
    room: usize,
    pause: Pause<T>,
}

impl<T: Real, const N: usize, const L: usize, const K: usize> Mixture<T, N, L, K> {
    const CAPACITY: () = assert!(K >= 1 && N >= 2, "a mixture holds at least one hypothesis of strain and rate");

    /// Creates a mixture of one Gaussian with all the weight.
    #[must_use]
    pub fn single(belief: Belief<T, N, L>, phase: Phase) -> Self {
        let () = Self::CAPACITY;
        let share = Share { weight: T::one(), belief, per_inside: T::one() };
        Self { shares: [share; K], phases: [phase; K], len: 1, room: K, pause: Pause::over() }
    }

    #[inline(always)]
    pub(crate) fn empty() -> Self {
        Self { shares: [Share::vacant(); K], phases: [Phase::Hold; K], len: 0, room: K, pause: Pause::over() }
    }

    pub(crate) const fn pause(&self) -> &Pause<T> {
        &self.pause
    }

    pub(crate) fn set_pause(&mut self, pause: Pause<T>) {
        self.pause = pause;
    }

    /// Adds a place, if there is room.
    pub(crate) fn one_more(&mut self) -> Option<(&mut Share<T, N, L>, &mut Phase)> {
        let (share, phase) = (self.shares.get_mut(self.len)?, self.phases.get_mut(self.len)?);
        self.len += 1;
        Some((share, phase))
    }

    /// Drops the hypotheses for which `counts` is false; the others keep their order.
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

    /// Removes all hypotheses, and sets the room for new ones.
    pub(crate) fn clear(&mut self, room: usize) {
        (self.len, self.room, self.pause) = (0, room.min(K), Pause::over());
    }

    /// Returns the maximum number of hypotheses that steps keep.
    pub(crate) const fn room(&self) -> usize {
        self.room
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

    /// A Gaussian and its phase.
    #[inline(always)]
    pub(crate) fn at(&self, place: usize) -> Option<(&Share<T, N, L>, Phase)> {
        Some((self.shares().get(place)?, *self.phases().get(place)?))
    }

    /// Their phases.
    #[must_use]
    pub fn phases(&self) -> &[Phase] {
        self.phases.get(..self.len).unwrap_or(&[])
    }

    /// Returns the probability of each phase, in the order of [`Phase::ALL`].
    #[must_use]
    pub fn phase_probabilities(&self) -> [T; 3] {
        let mut probabilities = PhaseSum::new(self.pause.open);
        for (share, phase) in self.shares().iter().zip(self.phases()) {
            probabilities.add(share.weight, *phase, &share.belief);
        }
        probabilities.sums
    }

    pub(crate) fn shares_mut(&mut self) -> &mut [Share<T, N, L>] {
        self.shares.get_mut(..self.len).unwrap_or(&mut [])
    }

    /// Limits the number of hypotheses from the next step on.
    fn keep(&mut self, most: usize) {
        self.room = most.clamp(1, K);
    }

    /// Adds the first Gaussian of another mixture, in place of the lightest if there is no free place.
    fn take_beside(&mut self, other: &Self, share: T) {
        let Some((beside, phase)) = other.at(0) else { return };
        let weights = self.shares().iter().map(|share| share.weight).enumerate();
        let lightest = weights.reduce(|a, b| if b.1 < a.1 { b } else { a }).map_or(0, |(place, _)| place);
        let place = if self.len < self.room { self.len } else { lightest };
        if let (Some(to), Some(of)) = (self.shares.get_mut(place), self.phases.get_mut(place)) {
            (*to, *of) = (Share { weight: T::zero(), ..*beside }, phase);
        }
        self.len = self.len.max(place + 1);
        let total = self.shares().iter().fold(T::zero(), |sum, share| sum + share.weight);
        let left = (T::one() - share) / total;
        for (at, to) in self.shares_mut().iter_mut().enumerate() {
            to.weight = if at == place { share } else { to.weight * left };
        }
    }
}

/// Implementation of [`State`] that both states share.
macro_rules! mixture_state {
    ($state:ident<T, N, L $(, $k:ident)?>) => {
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
                let mut inflated = *self;
                for share in inflated.shares_mut() {
                    share.belief = share.belief.inflated(factor);
                }
                inflated
            }

            fn beside(&self, other: &Self, share: T) -> Self {
                let mut both = *self;
                both.take_beside(other, share);
                both
            }

            fn keeping(mut self, most: usize) -> Self {
                self.keep(most);
                self
            }
        }
    };
}

mixture_state!(PhaseMixture<T, N, L>);
mixture_state!(Mixture<T, N, L, K>);
