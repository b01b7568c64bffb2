use crate::Scalar;
use crate::error::{ParameterError, Problem};

/// States of a motion: strain and rate.
pub const MOTION_STATES: usize = 2;

/// Prior on how the body moves: strain and rate as a linear stochastic differential equation,
///
/// `v̇ = -restoring₀ (ε - rest) - restoring₁ v + white noise`.
///
/// Its parameters can be read off a recording: standard deviations of strain and rate, and the correlation time of the
/// rate. An infinite `strain_sd` means no pull toward a mean strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T> {
    restoring: [T; MOTION_STATES],
    noise_density: T,
    rest_strain: T,
    phase_rate: T,
    stationary_variance: [T; MOTION_STATES],
}

impl<T: Scalar> Motion<T> {
    /// Ornstein-Uhlenbeck velocity: `v̇ = -v/T_v - (σ_v/σ_ε)² (ε - ε̄) + noise`.
    ///
    /// - `rate_time_s`: correlation time T_v of the rate, s.
    /// - `rate_sd`: standard deviation σ_v of the rate, 1/s.
    /// - `strain_mean`, `strain_sd`: long-run distribution of strain; an infinite `strain_sd` means no pull toward the
    ///   mean.
    ///
    /// # Errors
    /// Names the parameter that is not positive or not finite.
    pub fn ornstein_uhlenbeck(
        rate_time_s: T,
        rate_sd: T,
        strain_mean: T,
        strain_sd: T,
    ) -> Result<Self, ParameterError> {
        positive("rate_time_s", rate_time_s)?;
        positive("rate_sd", rate_sd)?;
        let pull = pull_toward_mean(strain_mean, strain_sd, rate_sd)?;
        let variance = rate_sd * rate_sd;
        Ok(Self {
            restoring: [pull, T::one() / rate_time_s],
            noise_density: T::of(2.0) * variance / rate_time_s,
            rest_strain: strain_mean,
            phase_rate: T::zero(),
            stationary_variance: [strain_sd * strain_sd, variance],
        })
    }

    /// Makes the rate revert to `+phase_rate` while stretching and `-phase_rate` while releasing, 1/s; zero means no
    /// preferred speed.
    ///
    /// # Errors
    /// If `phase_rate` is negative or not finite.
    pub fn with_phase_rate(mut self, phase_rate: T) -> Result<Self, ParameterError> {
        if !phase_rate.is_finite() {
            return Err(ParameterError::new("phase_rate", Problem::NotFinite));
        }
        if phase_rate < T::zero() {
            return Err(ParameterError::new("phase_rate", Problem::Negative));
        }
        self.phase_rate = phase_rate;
        Ok(self)
    }

    /// Coefficients of the restoring term: of ε, 1/s², and of v, 1/s.
    #[must_use]
    pub const fn restoring(&self) -> &[T; MOTION_STATES] {
        &self.restoring
    }

    /// Spectral density of the driving noise, 1/s³.
    #[must_use]
    pub fn noise_density(&self) -> T {
        self.noise_density
    }

    /// Mean strain.
    #[must_use]
    pub fn rest_strain(&self) -> T {
        self.rest_strain
    }

    /// Mean speed of a moving phase, 1/s.
    #[must_use]
    pub fn phase_rate(&self) -> T {
        self.phase_rate
    }

    /// Stationary variances of strain and rate, the prior before any reading; infinite where there is no stationary
    /// distribution.
    #[must_use]
    pub const fn stationary_variance(&self) -> &[T; MOTION_STATES] {
        &self.stationary_variance
    }

    /// Upper bound on the fastest rate of the motion's dynamics, 1/s.
    pub(crate) fn fastest_rate(&self) -> T {
        let [to_strain, to_rate] = self.restoring;
        to_rate.abs().max(to_strain.abs().sqrt())
    }
}

fn pull_toward_mean<T: Scalar>(strain_mean: T, strain_sd: T, rate_sd: T) -> Result<T, ParameterError> {
    if !strain_mean.is_finite() {
        return Err(ParameterError::new("strain_mean", Problem::NotFinite));
    }
    if !(strain_sd > T::zero()) {
        return Err(ParameterError::new("strain_sd", Problem::NotPositive));
    }
    let ratio = rate_sd / strain_sd;
    Ok(ratio * ratio)
}

fn positive<T: Scalar>(name: &'static str, value: T) -> Result<(), ParameterError> {
    if !value.is_finite() {
        return Err(ParameterError::new(name, Problem::NotFinite));
    }
    if !(value > T::zero()) {
        return Err(ParameterError::new(name, Problem::NotPositive));
    }
    Ok(())
}
