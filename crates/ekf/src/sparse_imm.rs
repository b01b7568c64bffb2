//! The IMM of the sensor's own model at a fixed rate.
//!
//! Given its phase, a mode's direction is certain: nothing is split, no root is taken. A hold has no rate, and a phase that
//! begins draws its rate anew, so the rate takes no part in the mixing but through the mode's own.
//!
//! # Policy
//! As [`SparseEkf`](crate::SparseEkf): the state is changed in place, an error leaves it as it was, and nothing takes a
//! logarithm unless asked or unless the strain is near a limit.

use ohmstrain_model::{Phase, SwitchedModel};

use crate::gaussian::Real;
use crate::mixture::LEAST_WEIGHT;
use crate::sparse_evidence::{Predicted, Weighing, Weight};
use crate::sparse_gaussian::Working;
use crate::sparse_known::KnownStep;
use crate::sparse_mixture::{PhaseMixture, Share};
use crate::switching::fresh_rate;
use crate::{Dwell, Evidence, Gaussian, MixtureResidual, Reading, Residual, StepError};

/// [`Imm`](crate::Imm) of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length: the same to
/// rounding, without multiplying zeros.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseImm<T, const B: usize, const N: usize> {
    kernel: KnownStep<T, B, N>,
    /// Probabilities of a change of phase over a step, `[to][from]`.
    chain: [[T; 3]; 3],
    weighing: Weighing<T>,
    /// Rate of a moving phase that begins, of extending and of releasing.
    fresh: [Gaussian<T>; 3],
}

/// A mode while a step works on it.
#[derive(Clone, Copy)]
struct Mode<T, const N: usize> {
    state: Working<T, N>,
    /// Its probability before the reading; what the reading and the limits make of it.
    prior: T,
    weight: Weight<T>,
    log_inside: T,
}

impl<T: Real, const B: usize, const N: usize> SparseImm<T, B, N> {
    /// A filter for steps of `dt_s` seconds.
    /// - `dwell`: how long phases last and what follows them.
    /// - `evidence`: what weighs the phases.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number.
    pub fn new(
        model: SwitchedModel<T, 2, B, N>,
        dt_s: T,
        dwell: Dwell<T>,
        evidence: Evidence<T>,
    ) -> Result<Self, StepError> {
        let chain = dwell.probabilities(dt_s);
        let fresh = Phase::ALL.map(|phase| fresh_rate(model.motion(), phase));
        Ok(Self {
            kernel: KnownStep::new(model, dt_s)?,
            chain: core::array::from_fn(|to| core::array::from_fn(|from| chain[from][to])),
            weighing: Weighing::new(evidence),
            fresh,
        })
    }

    /// The model.
    pub const fn model(&self) -> &SwitchedModel<T, 2, B, N> {
        self.kernel.model()
    }

    /// Predicts one step ahead and takes the reading; without one it is a prediction and returns `None`.
    ///
    /// # Errors
    /// See [`StepError`]; the state is untouched.
    #[inline]
    pub fn step<const L: usize>(
        &self,
        state: &mut PhaseMixture<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<MixtureResidual<T>>, StepError> {
        let mut modes: [Mode<T, N>; 3] = core::array::from_fn(|to| self.mixed(&state.modes, to));
        let mut predicted = Predicted::new();
        for (mode, phase) in modes.iter_mut().zip(Phase::ALL) {
            if !(mode.prior > T::zero()) {
                continue;
            }
            if let Some(residual) = self.advance(mode, phase, reading)? {
                predicted.add(mode.prior, &residual);
            }
        }
        let (weights, total) = shares(&modes)?;
        for (mode, (weight, old)) in modes.iter().zip(weights.into_iter().zip(&mut state.modes)) {
            mode.store(weight, old);
        }
        Ok(reading.map(|_| predicted.residual(total, self.weighing.tempering())))
    }

    /// One mode through the step: its belief, and what is known of its weight.
    #[inline(always)]
    fn advance(
        &self,
        mode: &mut Mode<T, N>,
        phase: Phase,
        reading: Option<Reading<T>>,
    ) -> Result<Option<Residual<T>>, StepError> {
        self.kernel.predict(phase, &mut mode.state);
        mode.weight = Weight { factor: mode.prior, exponent: T::zero() };
        let mut taken = None;
        if let Some(reading) = reading {
            let residual = self.kernel.update(phase, &mut mode.state, reading)?;
            let likelihood = self.weighing.likelihood(&residual);
            mode.weight = Weight { factor: mode.prior * likelihood.factor, exponent: likelihood.exponent };
            taken = Some(residual);
        }
        mode.state.check()?;
        let log_inside = self.weighing.log_inside(mode.state.x[0], mode.state.p[0][0]);
        mode.weight.exponent += log_inside - mode.log_inside;
        mode.log_inside = log_inside;
        Ok(taken)
    }
}

/// The mixing.
impl<T: Real, const B: usize, const N: usize> SparseImm<T, B, N> {
    /// What is known of the state if the phase at place `to` begins or goes on now. The rate of a hold is left out: the
    /// prediction does not look at it.
    #[inline(always)]
    fn mixed<const L: usize>(&self, modes: &[Share<T, N, L>; 3], to: usize) -> Mode<T, N> {
        let joint: [T; 3] = core::array::from_fn(|from| self.chain[to][from] * modes[from].weight);
        let prior = joint[0] + joint[1] + joint[2];
        let mut out = Mode::empty(prior);
        if !(prior > T::zero()) {
            return out;
        }
        let per_prior = T::one() / prior;
        let shares = joint.map(|weight| weight * per_prior);
        out.log_inside =
            shares[0] * modes[0].log_inside + shares[1] * modes[1].log_inside + shares[2] * modes[2].log_inside;
        out.mix(heaviest_first([(shares[0], &modes[0]), (shares[1], &modes[1]), (shares[2], &modes[2])]));
        if to != Phase::Hold.index() {
            out.mix_rate(shares[to], &modes[to], &self.fresh[to]);
        }
        out
    }
}

impl<T: Real, const N: usize> Mode<T, N> {
    fn empty(prior: T) -> Self {
        let weight = Weight { factor: T::zero(), exponent: T::zero() };
        Self { state: Working::zeros(), prior, weight, log_inside: T::zero() }
    }

    /// Mean and covariance of the mixture of all but the rate: with deviations d from the heaviest part's mean and s the
    /// mixture's own, `Σ w (d - s)(d - s)ᵀ = Σ w d (d - s)ᵀ`, and the heaviest part has d = 0. That s is at most √3
    /// deviations of the mixture, so that nothing cancels.
    #[inline(always)]
    fn mix<const L: usize>(&mut self, [(w0, a), (w1, b), (w2, c)]: [(T, &Share<T, N, L>); 3]) {
        let (mut weighted, mut off) = ([[T::zero(); 2]; N], [[T::zero(); 2]; N]);
        for i in 0..N {
            let mean = a.belief.mean[i];
            let (d1, d2) = (b.belief.mean[i] - mean, c.belief.mean[i] - mean);
            weighted[i] = [w1 * d1, w2 * d2];
            let shift = weighted[i][0] + weighted[i][1];
            off[i] = [d1 - shift, d2 - shift];
            self.state.x[i] = mean + shift;
        }
        let [a, b, c] = [a, b, c].map(|share| share.belief.covariance.packed().iter());
        let mut entries = a.zip(b).zip(c);
        for i in 0..N {
            for j in 0..=i {
                let Some(((pa, pb), pc)) = entries.next() else { return };
                if i != 1 && j != 1 {
                    self.state.p[i][j] =
                        w0 * *pa + w1 * *pb + w2 * *pc + weighted[i][0] * off[j][0] + weighted[i][1] * off[j][1];
                }
            }
        }
    }

    /// The rate: the mode's own with its share, one drawn anew, independent of everything else, with the rest.
    #[inline(always)]
    fn mix_rate<const L: usize>(&mut self, kept: T, own: &Share<T, N, L>, fresh: &Gaussian<T>) {
        let renewed = T::one() - kept;
        let (mean, covariance) = (&own.belief.mean, &own.belief.covariance);
        let apart = mean[1] - fresh.mean;
        self.state.x[1] = fresh.mean + kept * apart;
        for i in 0..N {
            let with_rate = kept * (covariance[(i, 1)] + apart * (mean[i] - self.state.x[i]));
            match i {
                0 => self.state.p[1][0] = with_rate,
                1 => self.state.p[1][1] = kept * covariance[(1, 1)] + renewed * (fresh.variance + kept * apart * apart),
                _ => self.state.p[i][1] = with_rate,
            }
        }
    }

    #[inline(always)]
    fn store<const L: usize>(&self, weight: T, share: &mut Share<T, N, L>) {
        share.weight = weight;
        if self.prior > T::zero() {
            share.log_inside = self.log_inside;
            share.belief = self.state.belief();
        }
    }
}

/// The heaviest part in front, by two comparisons.
#[inline(always)]
fn heaviest_first<T: Real, S>([a, b, c]: [(T, S); 3]) -> [(T, S); 3] {
    let [a, b] = if b.0 > a.0 { [b, a] } else { [a, b] };
    if c.0 > a.0 { [c, b, a] } else { [a, b, c] }
}

/// Probabilities from weights, and the weights' sum. What is lighter than the heaviest by e⁻¹² gets none.
#[inline(always)]
fn shares<T: Real, const N: usize>(modes: &[Mode<T, N>; 3]) -> Result<([T; 3], Weight<T>), StepError> {
    let followed = modes.iter().filter(|mode| mode.prior > T::zero());
    let Some(exponent) = followed.map(|mode| mode.weight.exponent).reduce(|a, b| if b > a { b } else { a }) else {
        return Err(StepError::NonFiniteState);
    };
    let mut weights = modes.each_ref().map(|mode| mode.weight.relative_to(exponent));
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
    Ok((weights.map(|weight| weight * per_sum), Weight { factor, exponent }))
}
