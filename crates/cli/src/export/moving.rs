//! The filter of the exported program with its state, in any precision.

use ohmstrain_calib::{BESIDE_SHARE, SURPRISING_NIS};
use ohmstrain_ekf::{
    Belief, Compact, Hypotheses, Mixture, Reading, Real, Residual, SignSplit, SparseEkf, State, StepError,
};
use ohmstrain_model::Phase;

use super::twin::flag;

/// Runs code with a constant number of hypotheses: those that a filter on a chip may keep.
macro_rules! with_hypotheses {
    ($most:expr, $K:ident => $run:expr) => {
        match $most {
            1 | 2 => {
                const $K: usize = 2;
                $run
            }
            3 => {
                const $K: usize = 3;
                $run
            }
            4 => {
                const $K: usize = 4;
                $run
            }
            _ => {
                const $K: usize = ohmstrain_calib::HYPOTHESES;
                $run
            }
        }
    };
}
pub(super) use with_hypotheses;

/// The last arm above is for both filters of a computer.
const _: () = assert!(ohmstrain_calib::HYPOTHESES == ohmstrain_calib::HISTORIES);

/// Numbers of the chain.
const CHAIN: usize = 9;

/// A filter with its state: one Gaussian, or at most K hypotheses.
#[derive(Clone, Copy)]
pub enum Moving<T, const B: usize, const N: usize, const L: usize, const K: usize> {
    Ekf(SparseEkf<T, Compact, B, N>, Belief<T, N, L>),
    SignSplit(SignSplit<T, B, N, K, Compact>, Mixture<T, N, L, K>),
    Histories(Hypotheses<T, B, N, K, Compact>, Mixture<T, N, L, K>),
}

impl<T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Moving<T, B, N, L, K> {
    /// Goes on with steps of another length, for which these are the numbers.
    pub fn set_step(&mut self, step_s: T, numbers: &[T]) {
        let (numbers, chain) = numbers.split_at(numbers.len() - CHAIN);
        let chain = [0, 1, 2].map(|from| [0, 1, 2].map(|to| chain[3 * from + to]));
        match self {
            Self::Ekf(filter, _) => filter.set_step(step_s, numbers),
            Self::SignSplit(filter, _) => filter.set_step(step_s, numbers, chain),
            Self::Histories(filter, _) => filter.set_step(step_s, numbers, chain),
        }
    }

    /// Begins again from one Gaussian, as a filter begins.
    pub fn start_from(&mut self, belief: Belief<T, N, L>) {
        match self {
            Self::Ekf(_, state) => *state = belief,
            Self::SignSplit(_, state) => *state = Mixture::single(belief, Phase::Extend),
            Self::Histories(_, state) => *state = Mixture::single(belief, Phase::Hold),
        }
    }

    /// Follows what another one of its kind knows, too.
    pub fn look_again(&mut self, other: &Self) {
        let share = T::of(BESIDE_SHARE);
        match (self, other) {
            (Self::SignSplit(_, state), Self::SignSplit(_, other)) => *state = state.beside(other, share),
            (Self::Histories(_, state), Self::Histories(_, other)) => *state = state.beside(other, share),
            _ => {}
        }
    }

    /// A step, and its innovation with that one's variance.
    pub fn step(&mut self, reading: Option<Reading<T>>) -> Result<Option<Residual<T>>, StepError> {
        match self {
            Self::Ekf(filter, belief) => filter.step(belief, reading),
            Self::SignSplit(filter, state) => Ok(filter.step(state, reading)?.map(|taken| taken.residual)),
            Self::Histories(filter, state) => Ok(filter.step(state, reading)?.map(|taken| taken.residual)),
        }
    }

    /// A step with a reading, with less weight if it surprises; flags.
    pub fn take(&mut self, reading: Reading<T>) -> Result<(u32, T), StepError> {
        let before = *self;
        let taken = self.step(Some(reading)).inspect_err(|_| *self = before)?;
        let surprising = T::of(SURPRISING_NIS);
        let Some(Residual { nis, variance, .. }) = taken.filter(|residual| residual.nis > surprising) else {
            return Ok((0, taken.map_or(T::zero(), |residual| residual.nis)));
        };
        *self = before;
        let more = variance * (T::one() / (surprising / nis) - T::one());
        let reading = Reading { extra_variance: reading.extra_variance + more, ..reading };
        self.step(Some(reading)).inspect_err(|_| *self = before)?;
        Ok((flag::DOWNWEIGHTED, nis))
    }

    /// How many hypotheses there are.
    pub fn count(&self) -> usize {
        match self {
            Self::Ekf(..) => 1,
            Self::SignSplit(_, state) => state.shares().len(),
            Self::Histories(_, state) => state.shares().len(),
        }
    }

    /// What all hypotheses say together.
    pub fn moments(&self) -> Belief<T, N, L> {
        match self {
            Self::Ekf(_, belief) => *belief,
            Self::SignSplit(_, state) => state.moments(),
            Self::Histories(_, state) => state.moments(),
        }
    }

    /// Probabilities of the phases; zeros where there are none.
    pub fn phases(&self) -> [T; 3] {
        match self {
            Self::Ekf(..) => [T::zero(); 3],
            Self::SignSplit(_, state) => state.phase_probabilities(),
            Self::Histories(_, state) => state.phase_probabilities(),
        }
    }
}
