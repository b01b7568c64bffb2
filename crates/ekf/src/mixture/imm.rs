//! Interacting multiple models.
//!
//! Given its phase, a mode's direction is certain, so no rate is split and no root is taken. A hold has no rate, and a new
//! phase starts with a new rate, so only the mode's own rate takes part in the mixing.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it unchanged, and logarithms are
//! computed only on request or if the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel};

use crate::Real;
use crate::kernel::{Course, Parts, refusal};
use crate::mixture::LEAST_WEIGHT;
use crate::mixture::estimator::{mixture_filter, over_phases};
use crate::mixture::evidence::{PredictedChildren, UpdatedChildren, Weighed, Weighing, Weight};
use crate::mixture::predicted::Predicted;
use crate::mixture::retry::{StepReading, loosen};
use crate::mixture::state::{PhaseMixture, Share};
use crate::mixture::switching::fresh_rate;
use crate::{
    AnyCurve, Compact, Curve, Dwell, Evidence, Gaussian, MixtureResidual, Reading, Residual, SparseEkf, StepError,
    Switch,
};

/// Interacting multiple models over the phases of a [`SwitchedModel`]: one Gaussian per phase, mixed before every step. `G` as
/// for [`SparseEkf`].
///
/// Source: Blom & Bar-Shalom, *IEEE Trans. Autom. Control* 33 (1988) 780.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imm<T, const B: usize, const N: usize, S = Compact, G = AnyCurve<T>> {
    pub(super) kernel: SparseEkf<T, S, B, N, G>,
    dwell: Dwell<T>,
    /// Probabilities of a change of phase over a step, `[from][to]`.
    pub(super) chain: [[T; 3]; 3],
    weighing: Weighing<T>,
    /// Initial rate of each phase.
    pub(super) fresh: [Gaussian<T>; 3],
}

/// A mode during a step.
struct Mode<T, const B: usize> {
    parts: Parts<T, B>,
    /// Probability before the reading; `weighed` is the one after it.
    prior: T,
    weighed: Weighed<T>,
    residual: Option<Residual<T>>,
}

impl<T: Real, const B: usize, const N: usize, S: Switch<T>, G: Curve<T>> Imm<T, B, N, S, G> {
    /// Predicts one step ahead and takes the reading. Without a reading it only predicts, and returns `None`.
    ///
    /// # Errors
    /// See [`StepError`]; the state is unchanged.
    #[inline]
    pub fn step<const L: usize>(
        &self,
        state: &mut PhaseMixture<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        let (mut reading, mut before, mut tries) = (reading, None, 0);
        // One call for all tries, so that a program contains the step once.
        loop {
            match self.step_once(state, reading) {
                Err(refused) => {
                    tries += 1;
                    let before = before.get_or_insert(*state);
                    reading = reading.for_retry(&self.kernel, tries, refused).inspect_err(|_| *state = *before)?;
                    loosen(&mut state.modes, tries);
                }
                taken => return taken,
            }
        }
    }

    /// Writes the result of [`Self::step`] into an existing state.
    ///
    /// # Errors
    /// See [`StepError`]; `next` is then meaningless.
    #[inline]
    pub fn step_into<const L: usize>(
        &self,
        state: &PhaseMixture<T, N, L>,
        reading: Option<Reading<T>>,
        next: &mut PhaseMixture<T, N, L>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        *next = *state;
        self.step(next, reading)
    }

    #[inline(always)]
    fn step_once<const L: usize>(
        &self,
        state: &mut PhaseMixture<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        // The three results are not moved; the state is written once all are available.
        let extend = self.advanced(state, Phase::Extend, reading);
        let hold = self.advanced(state, Phase::Hold, reading);
        let retract = self.advanced(state, Phase::Retract, reading);
        let modes = [borrowed(&extend)?, borrowed(&hold)?, borrowed(&retract)?];
        let (shares, density) = shares(modes.map(|mode| (mode.weighed.weight, mode.weighed.more_inside)))?;
        let mut predicted = Predicted::new();
        for ((mode, share), weight) in modes.into_iter().zip(&mut state.modes).zip(shares) {
            share.weight = weight;
            share.per_inside = mode.weighed.per_inside;
            mode.parts.put_into(&mut share.belief);
            if let Some(residual) = &mode.residual {
                predicted.add(mode.prior, residual.innovation, residual.variance);
            }
        }
        Ok(reading.map(|_| MixtureResidual::new(&predicted, density, self.weighing.tempering())))
    }

    /// Returns a mode after the step, with its belief and unnormalised weight. One function serves all phases, so that a
    /// program contains it once.
    #[inline(never)]
    fn advanced<const L: usize>(
        &self,
        state: &PhaseMixture<T, N, L>,
        phase: Phase,
        reading: Option<Reading<T>>,
    ) -> Result<Mode<T, B>, StepError> {
        let mut mode = self.mixed(&state.modes, phase);
        if !(mode.prior > T::zero()) {
            return Ok(mode);
        }
        let (parts, prior, per_inside) = (&mut mode.parts, mode.prior, mode.weighed.per_inside);
        let spread = self.kernel.predict::<T, S>(parts, Course::Known(phase));
        let child = PredictedChildren { parts, phase, prior, spread, per_inside, alive: true };
        let UpdatedChildren { sound, residual, weighed, .. } = self.kernel.weigh(child, reading, &self.weighing);
        if !sound {
            return Err(refusal(reading, &residual));
        }
        (mode.weighed, mode.residual) = (weighed, reading.map(|_| residual));
        Ok(mode)
    }

    /// Mixes the modes into the initial belief of `phase` for this step; returns the phase's own belief if the phase is impossible.
    /// The rate of a hold is left out, because its prediction does not use it.
    #[inline(always)]
    fn mixed<const L: usize>(&self, modes: &[Share<T, N, L>; 3], phase: Phase) -> Mode<T, B> {
        let (zero, to) = (T::zero(), phase.index());
        let own = &modes[to];
        let joint: [T; 3] = core::array::from_fn(|from| self.chain[from][to] * modes[from].weight);
        let prior = joint[0] + joint[1] + joint[2];
        let weight = Weight { factor: prior, exponent: zero };
        if !(prior > zero) {
            let weighed = Weighed { weight, more_inside: T::one(), per_inside: own.per_inside };
            return Mode { parts: Parts::of(&own.belief), prior, weighed, residual: None };
        }
        let per_prior = T::one() / prior;
        let shares = joint.map(|weight| weight * per_prior);
        let per_inside =
            shares[0] * modes[0].per_inside + shares[1] * modes[1].per_inside + shares[2] * modes[2].per_inside;
        let [a, b, c] = heaviest_first([(shares[0], &modes[0]), (shares[1], &modes[1]), (shares[2], &modes[2])]);
        let mut parts = Parts::mixed([a.0, b.0, c.0], [&a.1.belief, &b.1.belief, &c.1.belief]);
        if phase != Phase::Hold {
            parts.mix_rate(shares[to], &own.belief, &self.fresh[to]);
        }
        Mode { parts, prior, weighed: Weighed { weight, more_inside: T::one(), per_inside }, residual: None }
    }
}

/// Borrows the value of a result, without moving it.
fn borrowed<T>(result: &Result<T, StepError>) -> Result<&T, StepError> {
    result.as_ref().map_err(|error| *error)
}

/// Puts the heaviest first, with two comparisons.
#[inline(always)]
fn heaviest_first<T: Real, S>([a, b, c]: [(T, S); 3]) -> [(T, S); 3] {
    let [a, b] = if b.0 > a.0 { [b, a] } else { [a, b] };
    if c.0 > a.0 { [c, b, a] } else { [a, b, c] }
}

/// Returns the probabilities from weights and factors of the limits, and the sum of the weights. A mode lighter than
/// e⁻¹² of the heaviest gets probability zero.
#[inline(always)]
fn shares<T: Real>(weights: [(Weight<T>, T); 3]) -> Result<([T; 3], Weight<T>), StepError> {
    let followed = weights.iter().filter(|(weight, _)| weight.factor > T::zero());
    let exponents = followed.map(|(weight, _)| weight.exponent);
    let Some(exponent) = exponents.reduce(|a, b| if b > a { b } else { a }) else {
        return Err(StepError::NonFiniteState);
    };
    let mut density = T::zero();
    let mut weights = weights.map(|(likelihood, more_inside)| {
        let likelihood = likelihood.relative_to(exponent);
        density += likelihood;
        likelihood * more_inside
    });
    let heaviest = weights.iter().fold(T::zero(), |a, b| if *b > a { *b } else { a });
    let mut factor = T::zero();
    for weight in &mut weights {
        if !(*weight > heaviest * T::of(LEAST_WEIGHT)) {
            *weight = T::zero();
        }
        factor += *weight;
    }
    if !(factor > T::zero() && factor.is_finite()) {
        return Err(StepError::NonFiniteState);
    }
    let per_sum = T::one() / factor;
    Ok((weights.map(|weight| weight * per_sum), Weight { factor: density, exponent }))
}

over_phases!(Imm<B, N>);
mixture_filter!(Imm<B, N>, PhaseMixture<>);
