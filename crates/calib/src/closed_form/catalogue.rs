use std::fmt;
use std::str::FromStr;

use super::exponentials::{Burgers, Exponentials, ModulusShape};
use super::law::SeparableLaw;
use super::moving::{Hold, Moving};
use super::moving_hold::MovingHold;
use super::stretched::StretchedExponential;
use super::tunnelling::TunnellingCurve;

/// Largest number of terms in a sum of exponentials: no recording separates more than four.
const MOST_TERMS: usize = 4;

/// The laws by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ClosedForm {
    /// `eq1`: `R∞ + r₁ exp(-λ₁ t) + r₂ exp(-λ₂ t)`; λ in 1/s, λ₁ > λ₂.
    Eq1,
    /// `eq2`, Burgers: `R/R₀ - 1 = a + b exp(-t/τ) + c t`, in units of the reading.
    Eq2,
    /// `eq5:N`: `Σ Aᵢ exp(-t/τᵢ)`, no floor; two terms if N is left out.
    Eq5 {
        /// Number of exponentials.
        terms: usize,
    },
    /// `eq6`: `s (exp(-t/τ) + E₀)`, with the scale s that turns a modulus into a reading.
    Eq6,
    /// `eq7:N` and `prony:N`, a Prony series: `E∞ + Σ Eᵢ exp(-t/τᵢ)`, in units of the reading; two terms if N is left out.
    Eq7 {
        /// Number of exponentials.
        terms: usize,
    },
    /// `eq8`, a movement: `R = r₀ E(t) v t + v η + r₁`, E the modulus relative to its start.
    Eq8,
    /// `eq9`, a hold: `R′ = R₀ + Σ r₀′ R₀ Eᵢ (exp(-t/τᵢ) - 1)`, R₀ the reading at its start.
    Eq9,
    /// `eq8+eq9`: a movement and the hold after it, which share the modulus.
    Eq8And9,
    /// `kww`, a stretched exponential (Kohlrausch-Williams-Watts): `R∞ + r exp(-(t/τ)^β)`.
    Kww,
    /// `tunnelling`: `R₀ (1 + C ε) exp(A ε + W ε²)`, C ≥ 0.
    Tunnelling,
}

/// Writes the name that [`FromStr`] reads; `single` is the exponential with which equations 8 and 9 are printed.
impl fmt::Display for ModulusShape {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self { floor: false, .. } => out.write_str("single"),
            Self { terms: 1, .. } => out.write_str("eq6"),
            Self { terms, .. } => write!(out, "eq7:{terms}"),
        }
    }
}

impl ClosedForm {
    /// True if the modulus of the law can be chosen.
    #[must_use]
    pub const fn has_modulus(self) -> bool {
        matches!(self, Self::Eq8 | Self::Eq9 | Self::Eq8And9)
    }

    /// Returns the law. `modulus` applies to equations 8 and 9; `several_speeds` is true if the data have several speeds; `rest_reading`
    /// applies to equation 2.
    #[must_use]
    pub fn law(self, modulus: ModulusShape, several_speeds: bool, rest_reading: f64) -> Box<dyn SeparableLaw> {
        match self {
            Self::Eq1 => Box::new(Exponentials::two_rates()),
            Self::Eq2 => Box::new(Burgers { rest_reading }),
            Self::Eq5 { terms } => Box::new(Exponentials::without_floor(terms)),
            Self::Eq6 => Box::new(Exponentials::floor_share()),
            Self::Eq7 { terms } => Box::new(Exponentials::prony(terms)),
            Self::Eq8 => Box::new(Moving { modulus, several_speeds }),
            Self::Eq9 => Box::new(Hold { modulus }),
            Self::Eq8And9 => Box::new(MovingHold { modulus, several_speeds }),
            Self::Kww => Box::new(StretchedExponential),
            Self::Tunnelling => Box::new(TunnellingCurve),
        }
    }
}

/// Writes the name that [`FromStr`] reads.
impl fmt::Display for ClosedForm {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Eq1 => out.write_str("eq1"),
            Self::Eq2 => out.write_str("eq2"),
            Self::Eq5 { terms } => write!(out, "eq5:{terms}"),
            Self::Eq6 => out.write_str("eq6"),
            Self::Eq7 { terms } => write!(out, "prony:{terms}"),
            Self::Eq8 => out.write_str("eq8"),
            Self::Eq9 => out.write_str("eq9"),
            Self::Eq8And9 => out.write_str("eq8+eq9"),
            Self::Kww => out.write_str("kww"),
            Self::Tunnelling => out.write_str("tunnelling"),
        }
    }
}

impl FromStr for ClosedForm {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            let names = "eq1, eq2, eq5:N, eq6, eq7:N, eq8, eq9, eq8+eq9, kww, prony:N or tunnelling";
            format!("expected {names}, N from 1 to {MOST_TERMS}")
        };
        let (name, terms) = with_terms(text).ok_or_else(expected)?;
        match (name, terms) {
            ("eq1", None) => Ok(Self::Eq1),
            ("eq2", None) => Ok(Self::Eq2),
            ("eq5", terms) => Ok(Self::Eq5 { terms: terms.unwrap_or(2) }),
            ("eq6", None) => Ok(Self::Eq6),
            ("eq7" | "prony", terms) => Ok(Self::Eq7 { terms: terms.unwrap_or(2) }),
            ("eq8", None) => Ok(Self::Eq8),
            ("eq9", None) => Ok(Self::Eq9),
            ("eq8+eq9", None) => Ok(Self::Eq8And9),
            ("kww", None) => Ok(Self::Kww),
            ("tunnelling", None) => Ok(Self::Tunnelling),
            _ => Err(expected()),
        }
    }
}

/// Reads `single`, `eq6`, or `eq7:N` with two terms if N is left out.
impl FromStr for ModulusShape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match with_terms(text) {
            Some(("single", None)) => Ok(Self::SINGLE),
            Some(("eq6", None)) => Ok(Self { terms: 1, floor: true }),
            Some(("eq7", terms)) => Ok(Self { terms: terms.unwrap_or(2), floor: true }),
            _ => Err(format!("expected single, eq6 or eq7:N, N from 1 to {MOST_TERMS}")),
        }
    }
}

/// Splits a name from the N after its colon; `None` if N is not a valid number of terms.
fn with_terms(text: &str) -> Option<(&str, Option<usize>)> {
    let Some((name, terms)) = text.split_once(':') else { return Some((text, None)) };
    let terms = terms.parse().ok().filter(|terms| (1..=MOST_TERMS).contains(terms))?;
    Some((name, Some(terms)))
}
