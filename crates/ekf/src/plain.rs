use nalgebra::SVector;
use ohmstrain_model::{Phase, Scalar, Symmetric};

use crate::mixture::{Mixture, PhaseMixture, Share};
use crate::{Belief, Real};

/// A state as a list of numbers, for any format.
///
/// ```
/// # use ohmstrain_ekf::{Belief, PlainState};
/// # use ohmstrain_model::Symmetric;
/// let belief = Belief { mean: [0.1, 0.2].into(), covariance: Symmetric::from_packed([1.0, 0.5, 2.0]) };
/// let mut numbers = Vec::new();
/// belief.each_number(&mut |number| numbers.push(number));
/// assert_eq!(numbers, [0.1, 0.2, 1.0, 0.5, 2.0]);
/// assert_eq!(Belief::from_numbers(&mut numbers.into_iter()), Some(belief));
/// ```
pub trait PlainState<T>: Sized {
    /// Visits all numbers.
    fn each_number(&self, visit: &mut dyn FnMut(T));

    /// Restores a state from the numbers visited by [`Self::each_number`], and takes no more than these. Returns `None` if there are
    /// too few, or if one that counts or selects something is impossible; means, covariances and weights are not checked.
    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self>;
}

impl<T: Scalar, const N: usize, const L: usize> PlainState<T> for Belief<T, N, L> {
    fn each_number(&self, visit: &mut dyn FnMut(T)) {
        self.mean.iter().chain(self.covariance.packed()).for_each(|number| visit(*number));
    }

    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self> {
        let mut belief = Self { mean: SVector::zeros(), covariance: Symmetric::zeros() };
        for place in belief.mean.iter_mut().chain(belief.covariance.packed_mut()) {
            *place = numbers.next()?;
        }
        Some(belief)
    }
}

impl<T: Scalar, const N: usize, const L: usize> PlainState<T> for Share<T, N, L> {
    fn each_number(&self, visit: &mut dyn FnMut(T)) {
        visit(self.weight);
        visit(self.per_inside);
        self.belief.each_number(visit);
    }

    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self> {
        let (weight, per_inside) = (numbers.next()?, numbers.next()?);
        Some(Self { weight, per_inside, belief: Belief::from_numbers(numbers)? })
    }
}

impl<T: Real, const N: usize, const L: usize> PlainState<T> for PhaseMixture<T, N, L> {
    fn each_number(&self, visit: &mut dyn FnMut(T)) {
        self.modes.iter().for_each(|share| share.each_number(visit));
    }

    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self> {
        let mut state = Self::empty();
        for share in &mut state.modes {
            *share = Share::from_numbers(numbers)?;
        }
        Some(state)
    }
}

impl<T: Real, const N: usize, const L: usize, const K: usize> PlainState<T> for Mixture<T, N, L, K> {
    /// Visits room and number of the hypotheses, the pause, and each hypothesis with its phase.
    fn each_number(&self, visit: &mut dyn FnMut(T)) {
        visit(T::of(self.room() as f64));
        visit(T::of(self.shares().len() as f64));
        self.pause().each_number(visit);
        for (share, phase) in self.shares().iter().zip(self.phases()) {
            visit(T::of(phase.index() as f64));
            share.each_number(visit);
        }
    }

    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self> {
        let mut state = Self::empty();
        let room = index(numbers.next()?, K + 1).filter(|room| *room > 0)?;
        let followed = index(numbers.next()?, K + 1).filter(|followed| *followed > 0)?;
        state.clear(room);
        state.set_pause(PlainState::from_numbers(numbers)?);
        for _ in 0..followed {
            let (share, phase) = state.one_more()?;
            *phase = *Phase::ALL.get(index(numbers.next()?, Phase::ALL.len())?)?;
            *share = Share::from_numbers(numbers)?;
        }
        Some(state)
    }
}

/// Returns the index below `count` that equals a number.
pub(crate) fn index<T: Scalar>(number: T, count: usize) -> Option<usize> {
    (0..count).find(|index| T::of(*index as f64) == number)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    extern crate std;

    use std::vec::Vec;

    use ohmstrain_model::{Phase, Scalar, Symmetric};

    use super::PlainState;
    use crate::mixture::Share;
    use crate::{Belief, Mixture, PhaseMixture, Real, State};

    fn belief<T: Scalar>(mean: f64) -> Belief<T, 2, 3> {
        Belief {
            mean: [mean, -0.25].map(T::of).into(),
            covariance: Symmetric::from_packed([1.0 / 3.0, 0.1, 2.0].map(T::of)),
        }
    }

    fn numbers<T>(state: &impl PlainState<T>) -> Vec<T> {
        let mut numbers = Vec::new();
        state.each_number(&mut |number| numbers.push(number));
        numbers
    }

    fn restored<T: Copy, S: PlainState<T>>(numbers: &[T]) -> Option<S> {
        let mut left = numbers.iter().copied();
        S::from_numbers(&mut left).filter(|_| left.next().is_none())
    }

    /// Two hypotheses of at most three in a pause, one of them near a limit, in a mixture with room for four.
    fn two<T: Real>() -> Mixture<T, 2, 3, 4> {
        let first = Mixture::single(belief(0.1), Phase::Extend);
        let mut two = first.beside(&Mixture::single(belief(0.3), Phase::Retract), T::of(0.25)).keeping(3);
        two.shares_mut().iter_mut().for_each(|Share { per_inside, .. }| *per_inside = T::of(1.5));
        two.set_pause(two.pause().goes_on(T::of(0.7), T::of(0.5)));
        two
    }

    fn return_from_their_numbers<T: Real>() {
        let phases = PhaseMixture::<T, 2, 3>::single(belief(0.1), Phase::Hold);
        assert_eq!(restored(&numbers(&phases)), Some(phases));
        let (two, returned) = (two::<T>(), restored::<T, Mixture<T, 2, 3, 4>>(&numbers(&two::<T>())).unwrap());
        assert!(two.pause().open);
        assert_eq!((returned.shares(), returned.phases()), (two.shares(), two.phases()));
        assert_eq!((returned.room(), returned.pause()), (3, two.pause()));
    }

    #[test]
    fn states_return_from_their_numbers() {
        return_from_their_numbers::<f64>();
        return_from_their_numbers::<f32>();
    }

    #[test]
    fn numbers_of_another_state_are_refused() {
        let of_two = numbers(&two::<f64>());
        let refused =
            |numbers: &[f64]| assert_eq!(restored::<f64, Mixture<f64, 2, 3, 4>>(numbers), None, "{numbers:?}");
        refused(&of_two[1..]);
        refused(&of_two[..of_two.len() - 1]);
        // No hypotheses, with nothing after it.
        refused(&[4.0, 0.0, 0.0, 0.0]);
        // Room, hypotheses, whether the direction is open, and the phase of the first.
        for (place, impossible) in [(0, 0.0), (0, 5.0), (1, 5.0), (1, 1.5), (3, 2.0), (4, 3.0), (4, f64::NAN)] {
            let mut changed = of_two.clone();
            changed[place] = impossible;
            refused(&changed);
        }
    }
}
