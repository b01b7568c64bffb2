//! A particle filter, the oracle for the mixtures of Gaussians.

mod cloud;
mod path;
mod rejuvenation;

pub use cloud::{Particle, ParticleCloud};

use nalgebra::SVector;
use ohmstrain_ekf::{Advanced, Belief, Dwell, Estimator, Evidence, Innovation, Reading, StepError};
use ohmstrain_model::{Direction, MOTION_STATES, Phase, Scalar, SwitchedModel, SwitchedStep, Symmetric};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::particles::cloud::{Chance, root_columns};
use crate::particles::path::{along_path, path_noise};
use crate::particles::rejuvenation::rejuvenate;

/// Rao-Blackwellised particle filter: paths of motion and phase are sampled, branches and baseline are marginalised.
///
/// It is a slow reference. Its only approximation beyond the model's own is a finite number of paths (and, in holds, the
/// kernel that keeps them apart). Where it is no better than [`SignSplit`](ohmstrain_ekf::SignSplit), the law is the limit,
/// not the estimator.
///
/// A particle is a strain, a rate and a phase. Given their path, branches and baseline are linear and Gaussian:
/// each particle has a Kalman mean of them, and one covariance and one gain serve all particles. Paths follow the
/// model's own dynamics, are weighted by the likelihood of the reading, and are resampled when the effective sample size
/// falls below half their number.
///
/// The direction is the sign of a path's rate. With a [`Dwell`] there is also a hold phase, entered and left with the
/// chain's probabilities; on leaving it, the rate is drawn from the moving phase's prior. The limits of the
/// [`Evidence`] are stops: a path that runs into one ends its step there, at rest. That is a property of the motion,
/// not evidence, so a rest at a limit does not count the same evidence again at every step.
///
/// The same seed and readings give the same result on every machine.
///
/// Source: Doucet, de Freitas, Murphy & Russell, *Proc. UAI* (2000) 176.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Particles<T, M> {
    model: M,
    hold: Option<Dwell<T>>,
    evidence: Evidence<T>,
    count: usize,
    seed: u64,
}

/// Result of one step of the particle filter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticleStep<T, const N: usize, const L: usize> {
    /// The particles after the reading.
    pub posterior: ParticleCloud<T, N, L>,
    /// Log density of the reading under the cloud, tempered if the filter tempers; zero if it was missing.
    pub log_likelihood: T,
    /// Normalised innovation squared under the cloud's mean and variance; `None` if the reading was missing.
    pub nis: Option<T>,
    /// The reading compared with the cloud's mean and variance of it; `None` if it was missing.
    pub innovation: Option<Innovation<T>>,
    /// Effective sample size after the reading, before resampling; if it is small, the result is dominated by chance.
    pub effective_count: T,
}

impl<T: Scalar, M> Particles<T, M> {
    /// - `hold`: durations of holds and movements; `None` for a body that never rests.
    /// - `evidence`: strains at which the body is stopped, and the power of a reading's likelihood.
    /// - `count`: number of particles, at least 1. The random error of the means, in standard deviations, falls with the
    ///   square root of `count`. With 4000 it is about a fifth while the strain is moving, so intervals from a few
    ///   hundred are too narrow.
    /// - `seed`: seed of the random numbers.
    pub const fn new(model: M, hold: Option<Dwell<T>>, evidence: Evidence<T>, count: usize, seed: u64) -> Self {
        Self { model, hold, evidence, count, seed }
    }

    /// The model.
    pub const fn model(&self) -> &M {
        &self.model
    }
}

impl<T: Scalar, const B: usize, const N: usize> Particles<T, SwitchedModel<T, B, N>> {
    /// Draws a cloud with the given moments, in `phase`: at rest in a hold (if the filter has holds), otherwise moving,
    /// each path in the direction of its own rate.
    ///
    /// Strains beyond the limits are moved to the limit.
    #[must_use]
    pub fn start<const L: usize>(&self, belief: &Belief<T, N, L>, phase: Phase) -> ParticleCloud<T, N, L> {
        let mut chance = Chance(ChaCha8Rng::seed_from_u64(self.seed));
        // With the motion first, the columns of the motion carry the regression of the rest on it, and the remaining
        // columns are the covariance of the rest given the motion.
        let columns = root_columns(&belief.covariance);
        let (motion, rest) = columns.split_at(MOTION_STATES);
        let mut covariance = Symmetric::zeros();
        for column in rest {
            covariance.add_outer(column, T::one());
        }
        let count = self.count.max(1);
        let rests = phase == Phase::Hold && self.hold.is_some();
        let draw = |_| {
            let mut state = belief.mean + chance.combine(motion);
            state[0] = self.evidence.limits.clamp(state[0]);
            let phase = match phase {
                Phase::Hold if rests => phase,
                _ if state[1] < T::zero() => Phase::Retract,
                _ => Phase::Extend,
            };
            Particle { weight: T::one() / T::of(count as f64), phase, state }
        };
        ParticleCloud { particles: (0..count).map(draw).collect(), covariance, chance }
    }

    /// Predicts over a prepared step of `dt_s ≥ 0` seconds, then takes the reading.
    ///
    /// # Errors
    /// See [`StepError`]; the cloud passed in is unchanged.
    pub fn step_prepared<const L: usize>(
        &self,
        cloud: &ParticleCloud<T, N, L>,
        prepared: &SwitchedStep<T, B>,
        dt_s: T,
        reading: Option<Reading<T>>,
    ) -> Result<ParticleStep<T, N, L>, StepError> {
        let mut next = cloud.clone();
        self.predict(&mut next, prepared, dt_s);
        let innovation = reading.map(|reading| self.take(&mut next, reading)).transpose()?;
        let log_likelihood = innovation.map_or(T::zero(), |innovation| innovation.log_likelihood);
        let nis = innovation.map(|innovation| innovation.nis);
        if !next.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        let effective_count = next.effective_count();
        if effective_count < T::of(0.5 * next.particles.len() as f64) {
            next.resample();
            rejuvenate::<T, N, L>(&mut next.particles, self.model.law().static_border(), &mut next.chance);
            for particle in &mut next.particles {
                particle.state[0] = self.evidence.limits.clamp(particle.state[0]);
            }
        }
        Ok(ParticleStep { posterior: next, log_likelihood, nis, innovation, effective_count })
    }

    /// Propagates every path by a step.
    fn predict<const L: usize>(&self, cloud: &mut ParticleCloud<T, N, L>, prepared: &SwitchedStep<T, B>, dt_s: T) {
        let columns = root_columns(&path_noise::<T, B, N, L>(prepared));
        let (moved, _) = columns.split_at(MOTION_STATES + B);
        let chain = self.hold.map(|dwell| dwell.probabilities(dt_s));
        for particle in &mut cloud.particles {
            if let Some(chain) = &chain {
                self.switch(particle, chain, &mut cloud.chance);
            }
            let chance = match particle.phase {
                Phase::Hold => SVector::zeros(),
                _ => cloud.chance.combine(moved),
            };
            let limits = &self.evidence.limits;
            (particle.state, particle.phase) =
                along_path(&self.model, prepared, &particle.state, particle.phase, &chance, limits);
        }
        let rest = self.model.transition(prepared, &SVector::zeros(), Direction::Known(Phase::Hold));
        cloud.covariance = self.model.propagate(&cloud.covariance, &rest);
    }

    /// Starts and ends holds.
    fn switch(&self, particle: &mut Particle<T, N>, chain: &[[T; 3]; 3], chance: &mut Chance) {
        let draw: T = chance.uniform();
        let [extends, stays, _] = chain[1];
        if particle.phase != Phase::Hold {
            if draw < chain[0][1] {
                particle.phase = Phase::Hold;
            }
        } else if draw >= stays {
            particle.phase = if draw < stays + extends { Phase::Extend } else { Phase::Retract };
            self.set_off(particle, chance);
        }
    }

    /// Draws the rate from the prior of the phase that begins.
    fn set_off(&self, particle: &mut Particle<T, N>, chance: &mut Chance) {
        let motion = self.model.motion();
        particle.state[1] = motion.stationary_variance()[1].sqrt() * chance.normal();
        let speed = if motion.phase_rate() > T::zero() {
            motion.phase_rate() + particle.state[1]
        } else {
            particle.state[1].abs()
        };
        particle.state[1] = if particle.phase == Phase::Retract { -speed } else { speed };
    }

    /// Updates every particle's branches and baseline, and its weight.
    fn take<const L: usize>(
        &self,
        cloud: &mut ParticleCloud<T, N, L>,
        reading: Reading<T>,
    ) -> Result<Innovation<T>, StepError> {
        if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
            return Err(StepError::NonFiniteReading);
        }
        if reading.extra_variance < T::zero() {
            return Err(StepError::NegativeVariance);
        }
        // Gain and covariance do not depend on the path: any state gives the same.
        let observed = self.model.observe(&SVector::zeros(), Direction::Known(Phase::Hold));
        let projected = cloud.covariance.mul(&observed.gradient);
        let variance = observed.gradient.dot(&projected) + observed.variance + reading.extra_variance;
        let gain = projected / variance;
        let half = T::of(0.5);
        let (mut first, mut second) = (T::zero(), T::zero());
        let mut most = -T::one() / T::zero();
        for particle in &mut cloud.particles {
            let expected = self.model.observe(&particle.state, Direction::Known(particle.phase)).value;
            let innovation = reading.value - expected;
            particle.state += gain * innovation;
            first += particle.weight * innovation;
            second += particle.weight * innovation * innovation;
            let exponent = -half * innovation * innovation / variance;
            particle.weight = particle.weight.ln() + self.evidence.tempering * exponent;
            most = most.max(particle.weight);
        }
        if !most.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        let mut sum = T::zero();
        for particle in &mut cloud.particles {
            particle.weight = (particle.weight - most).exp();
            sum += particle.weight;
        }
        for particle in &mut cloud.particles {
            particle.weight /= sum;
        }
        cloud.covariance.add_outer(&gain, -variance);
        let height = -half * (variance.ln() + T::two_pi().ln());
        let log_likelihood = most + sum.ln() + self.evidence.tempering * height;
        let spread = (second - first * first).max(T::zero());
        let variance = variance + spread;
        Ok(Innovation { value: first, variance, nis: first * first / variance, log_likelihood })
    }
}

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Estimator<T, N, L>
    for Particles<T, SwitchedModel<T, B, N>>
{
    type State = ParticleCloud<T, N, L>;
    /// The model's step, and its length for the chain of phases.
    type Prepared = (SwitchedStep<T, B>, T);

    /// A path has a direction only at the ends of a step, so it needs shorter steps than a Gaussian.
    fn longest_step_s(&self) -> T {
        self.model.longest_step_s() / T::of(8.0)
    }

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        (self.model.prepare(dt_s), dt_s)
    }

    fn advance(
        &self,
        state: &Self::State,
        (prepared, dt_s): &Self::Prepared,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<Self::State, T>, StepError> {
        let step = self.step_prepared(state, prepared, *dt_s, reading)?;
        Ok(Advanced { state: step.posterior, innovation: step.innovation })
    }
}
