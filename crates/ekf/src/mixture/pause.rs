//! Pause of the readings, for hypotheses about the sign of the rate.

use ohmstrain_model::{Phase, Scalar};

use crate::Belief;
use crate::plain::{PlainState, index};
use crate::substeps::GRACE;
use crate::{Gaussian, Real};

/// Time without a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pause<T> {
    seconds: T,
    /// True if moving hypotheses keep the phase of their parents, and their rates may have either sign by now.
    pub open: bool,
}

impl<T: Scalar> Pause<T> {
    pub(crate) fn over() -> Self {
        Self { seconds: T::zero(), open: false }
    }

    /// Adds a step of `dt_s` seconds without a reading; the direction is open once the pause exceeds `longest_s`.
    pub(crate) fn goes_on(self, dt_s: T, longest_s: T) -> Self {
        let seconds = self.seconds + dt_s;
        Self { seconds, open: seconds > longest_s * T::of(GRACE) }
    }
}

impl<T: Scalar> PlainState<T> for Pause<T> {
    fn each_number(&self, visit: &mut dyn FnMut(T)) {
        visit(self.seconds);
        visit(if self.open { T::one() } else { T::zero() });
    }

    fn from_numbers(numbers: &mut dyn Iterator<Item = T>) -> Option<Self> {
        let seconds = numbers.next()?;
        Some(Self { seconds, open: index(numbers.next()?, 2)? == 1 })
    }
}

/// Sum of the probabilities of each phase.
pub(crate) struct PhaseSum<T> {
    pub sums: [T; 3],
    /// True if the phase of a moving hypothesis follows from the sign of its rate.
    open: bool,
}

impl<T: Real> PhaseSum<T> {
    pub(crate) fn new(open: bool) -> Self {
        Self { sums: [T::zero(); 3], open }
    }

    pub(crate) fn add<const N: usize, const L: usize>(&mut self, weight: T, phase: Phase, belief: &Belief<T, N, L>) {
        let [extend, hold, retract] = &mut self.sums;
        match phase {
            Phase::Hold => *hold += weight,
            _ if self.open => {
                let stretches = Gaussian::marginal(belief, 1).probability_above(T::zero());
                *extend += weight * stretches;
                *retract += weight * (T::one() - stretches);
            }
            Phase::Extend => *extend += weight,
            Phase::Retract => *retract += weight,
        }
    }
}
