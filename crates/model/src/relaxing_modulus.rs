use crate::error::{ParameterError, Problem};
use crate::{Phase, Scalar};

/// How a modulus relaxes from 1 at the start of a phase: the source paper's equations 8, 6 and 7.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Modulus<T, const P: usize> {
    /// `exp(-t/τ₀)`.
    Single {
        /// τ₀, s.
        tau_s: T,
    },
    /// `(exp(-t/τ₀) + E₀) / (1 + E₀)`: relaxes to a floor.
    WithFloor {
        /// τ₀, s.
        tau_s: T,
        /// Floor E₀.
        floor: T,
    },
    /// `(E∞ + Σ Eᵢ exp(-t/τᵢ)) / (E∞ + Σ Eᵢ)`: a Prony series of `P` terms.
    Prony {
        /// E∞.
        floor: T,
        /// Weights Eᵢ.
        weights: [T; P],
        /// Time constants τᵢ, s.
        taus_s: [T; P],
    },
}

impl<T: Scalar, const P: usize> Modulus<T, P> {
    /// The share of the modulus left after `elapsed_s` seconds.
    #[must_use]
    pub fn relaxed(&self, elapsed_s: T) -> T {
        match self {
            Self::Single { tau_s } => (-elapsed_s / *tau_s).exp(),
            Self::WithFloor { tau_s, floor } => ((-elapsed_s / *tau_s).exp() + *floor) / (T::one() + *floor),
            Self::Prony { floor, weights, taus_s } => {
                let (mut now, mut start) = (*floor, *floor);
                for (weight, tau_s) in weights.iter().zip(taus_s) {
                    now += *weight * (-elapsed_s / *tau_s).exp();
                    start += *weight;
                }
                now / start
            }
        }
    }

    fn validate(&self) -> Result<(), ParameterError> {
        let tau_ok = match self {
            Self::Single { tau_s } | Self::WithFloor { tau_s, .. } => *tau_s > T::zero(),
            Self::Prony { taus_s, .. } => taus_s.iter().all(|tau_s| *tau_s > T::zero()),
        };
        if !tau_ok {
            return Err(ParameterError::new("tau_s", Problem::NotPositive));
        }
        let start = match self {
            Self::Single { .. } => T::one(),
            Self::WithFloor { floor, .. } => T::one() + *floor,
            Self::Prony { floor, weights, .. } => weights.iter().fold(*floor, |sum, weight| sum + *weight),
        };
        if start > T::zero() { Ok(()) } else { Err(ParameterError::new("modulus", Problem::NotPositive)) }
    }
}

/// What a phase latches when it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhaseStart<T> {
    /// The phase that begins.
    pub phase: Phase,
    /// Strain ε_s at its start.
    pub strain: T,
    /// Resistance R_s at its start, Ω.
    pub resistance_ohm: T,
}

/// The source paper's relaxing-modulus law taken literally, equations 8 (moving) and 9 (holding):
///
/// - moving: `R = R_s + m u + η v` with `m = r₀ E(t)`, `u = ε - ε_s`, t since the phase began;
/// - holding: `R = R_s (1 - r₀′ + r₀′ E(t))`.
///
/// The law is bilinear and switched: strain and resistance are latched at the start of every phase, and continuity of
/// the hold asks for `r₁′ = R_s (1 - r₀′)`. It is kept as the paper's model and as a baseline. On recordings its τ₀ goes
/// as 1/v, so the exponential mostly stands for the bend of the gauge curve, for which [`crate::SensorLaw`] is the
/// better law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaxingModulus<T, const P: usize> {
    stiffness_ohm: T,
    viscosity_ohm_s: T,
    hold_fraction: T,
    modulus: Modulus<T, P>,
}

/// R in Ω and its derivatives with respect to strain and rate.
pub type ResistanceGradient<T> = (T, [T; 2]);

impl<T: Scalar, const P: usize> RelaxingModulus<T, P> {
    /// - `stiffness_ohm` r₀: Ω per unit strain at the start of a moving phase.
    /// - `viscosity_ohm_s` η: Ω·s.
    /// - `hold_fraction` r₀′: share of R that relaxes in a hold, below 1.
    ///
    /// # Errors
    /// Names the parameter that no such law can have.
    pub fn new(
        stiffness_ohm: T,
        viscosity_ohm_s: T,
        hold_fraction: T,
        modulus: Modulus<T, P>,
    ) -> Result<Self, ParameterError> {
        for (name, value) in [("stiffness_ohm", stiffness_ohm), ("viscosity_ohm_s", viscosity_ohm_s)] {
            if !value.is_finite() {
                return Err(ParameterError::new(name, Problem::NotFinite));
            }
        }
        if !(hold_fraction < T::one()) {
            return Err(ParameterError::new("hold_fraction", Problem::OutOfRange));
        }
        modulus.validate()?;
        Ok(Self { stiffness_ohm, viscosity_ohm_s, hold_fraction, modulus })
    }

    /// Resistance in Ω, `elapsed_s` seconds into a phase, and its derivatives with respect to strain (Ω) and rate (Ω·s).
    #[must_use]
    pub fn resistance_ohm(&self, start: &PhaseStart<T>, elapsed_s: T, strain: T, rate: T) -> ResistanceGradient<T> {
        let relaxed = self.modulus.relaxed(elapsed_s);
        if start.phase == Phase::Hold {
            let share = T::one() - self.hold_fraction + self.hold_fraction * relaxed;
            return (start.resistance_ohm * share, [T::zero(); 2]);
        }
        let slope = self.stiffness_ohm * relaxed;
        let value = start.resistance_ohm + slope * (strain - start.strain) + self.viscosity_ohm_s * rate;
        (value, [slope, self.viscosity_ohm_s])
    }

    /// Latches strain and resistance at the start of `phase`.
    ///
    /// The dash-pot term η v jumps with the rate. It is not part of what is latched, so that R_s is the elastic part
    /// and the next phase adds its own; entering a hold it is what R relaxes from, so there it stays in.
    #[must_use]
    pub fn begin(&self, phase: Phase, strain: T, rate: T, resistance_ohm: T) -> PhaseStart<T> {
        let latched = if phase == Phase::Hold { resistance_ohm } else { resistance_ohm - self.viscosity_ohm_s * rate };
        PhaseStart { phase, strain, resistance_ohm: latched }
    }
}
