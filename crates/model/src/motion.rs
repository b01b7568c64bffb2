use crate::Scalar;
use crate::error::{ParameterError, Problem};

/// Prior on how the body moves: strain and its first `M - 1` derivatives as a linear stochastic differential equation,
///
/// `dᴹε/dtᴹ = -Σⱼ restoringⱼ · dʲ(ε - rest)/dtʲ + white noise`.
///
/// `M = 2` is an Ornstein-Uhlenbeck velocity (state strain, rate), `M = 3` smooth motion with acceleration as a state.
/// Both are given by statistics that a recording shows directly: standard deviations of strain, rate and
/// acceleration. An infinite `strain_sd` means no pull toward a mean strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T, const M: usize> {
    restoring: [T; M],
    noise_density: T,
    rest_strain: T,
    phase_rate: T,
    stationary_variance: [T; M],
}

impl<T: Scalar> Motion<T, 2> {
    /// Ornstein-Uhlenbeck velocity: `v̇ = -v/T_v - (σ_v/σ_ε)² (ε - ε̄) + noise`.
    ///
    /// - `rate_time_s`: correlation time T_v of the rate, s.
    /// - `rate_sd`: standard deviation σ_v of the rate, 1/s.
    /// - `strain_mean`, `strain_sd`: distribution of strain; `strain_sd` infinite for none.
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

    /// Velocity as a random walk (T_v infinite) with noise of spectral density `noise_density`, (1/s)²/s;
    /// `rate_sd` (1/s) is the prior standard deviation of the rate, as nothing stationary exists.
    ///
    /// # Errors
    /// Names the parameter that is not positive.
    pub fn random_walk(noise_density: T, rate_sd: T) -> Result<Self, ParameterError> {
        positive("noise_density", noise_density)?;
        positive("rate_sd", rate_sd)?;
        Ok(Self {
            restoring: [T::zero(); 2],
            noise_density,
            rest_strain: T::zero(),
            phase_rate: T::zero(),
            stationary_variance: [T::one() / T::zero(), rate_sd * rate_sd],
        })
    }

    /// Makes the rate revert to `+phase_rate` while stretching and `-phase_rate` while releasing, 1/s; zero for no such rate.
    ///
    /// # Errors
    /// If it is below zero or not finite.
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
}

impl<T: Scalar> Motion<T, 3> {
    /// Smooth motion, critically damped with ω = σ_a/σ_v:
    /// `ȧ = -2 ω a - ω² v - 2 ω (σ_v/σ_ε)² (ε - ε̄) + noise`.
    ///
    /// - `rate_sd` σ_v in 1/s, `acceleration_sd` σ_a in 1/s²;
    /// - `strain_mean`, `strain_sd`: distribution of strain; `strain_sd` infinite for none.
    ///
    /// # Errors
    /// Names the parameter that is not positive or not finite. A stationary process has `σ_v² < σ_ε σ_a`
    /// (Cauchy-Schwarz); anything else is out of range.
    pub fn smooth(rate_sd: T, acceleration_sd: T, strain_mean: T, strain_sd: T) -> Result<Self, ParameterError> {
        positive("rate_sd", rate_sd)?;
        positive("acceleration_sd", acceleration_sd)?;
        let pull = pull_toward_mean(strain_mean, strain_sd, rate_sd)?;
        let omega = acceleration_sd / rate_sd;
        if pull >= omega * omega {
            return Err(ParameterError::new("acceleration_sd", Problem::OutOfRange));
        }
        let (two, variance) = (T::of(2.0), rate_sd * rate_sd);
        Ok(Self {
            restoring: [two * omega * pull, omega * omega, two * omega],
            noise_density: T::of(4.0) * variance * omega * (omega * omega - pull),
            rest_strain: strain_mean,
            phase_rate: T::zero(),
            stationary_variance: [strain_sd * strain_sd, variance, acceleration_sd * acceleration_sd],
        })
    }
}

impl<T: Scalar, const M: usize> Motion<T, M> {
    /// Coefficients of the restoring term, of ε first; 1/s^(M-j).
    #[must_use]
    pub const fn restoring(&self) -> &[T; M] {
        &self.restoring
    }

    /// Spectral density of the driving noise.
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

    /// Variances of strain, rate, … in the long run: the prior before anything is known. Infinite where there is none.
    #[must_use]
    pub const fn stationary_variance(&self) -> &[T; M] {
        &self.stationary_variance
    }

    /// An upper bound of the fastest rate in the motion, 1/s.
    pub(crate) fn fastest_rate(&self) -> T {
        let mut fastest = T::zero();
        for (j, coefficient) in self.restoring.iter().rev().enumerate() {
            let root = match j {
                0 => coefficient.abs(),
                1 => coefficient.abs().sqrt(),
                // Not `cbrt`: for f32 that is software in double precision on a microcontroller.
                _ => coefficient.abs().powf(T::of(1.0 / 3.0)),
            };
            fastest = fastest.max(root);
        }
        fastest
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
