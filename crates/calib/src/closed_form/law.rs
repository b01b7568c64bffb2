use thiserror::Error;

use super::datum::{Datum, Moment};
use super::search::{Extent, Search};

/// Unit of a parameter, in terms of the units of reading (Ω or 1) and strain (1 or degrees).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A pure number.
    One,
    /// s.
    Second,
    /// 1/s.
    PerSecond,
    /// Unit of the reading.
    Reading,
    /// Reading per strain.
    ReadingPerStrain,
    /// Reading per strain rate.
    ReadingPerRate,
    /// 1/strain.
    PerStrain,
    /// 1/strain².
    PerStrainSquared,
}

impl Unit {
    /// Returns the unit as text, given the units of reading and strain, `1` for a pure number.
    #[must_use]
    pub fn text(self, reading: &str, strain: &str) -> String {
        let over = |top: &str, bottom: &str| if bottom == "1" { top.to_string() } else { format!("{top}/{bottom}") };
        match self {
            Self::One => "1".into(),
            Self::Second => "s".into(),
            Self::PerSecond => "1/s".into(),
            Self::Reading => reading.into(),
            Self::ReadingPerStrain => over(reading, strain),
            Self::ReadingPerRate => over(&if reading == "1" { "s".into() } else { format!("{reading} s") }, strain),
            Self::PerStrain => over("1", strain),
            Self::PerStrainSquared => over("1", &if strain == "1" { "1".into() } else { format!("{strain}^2") }),
        }
    }
}

/// Name and unit of a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The source's symbol in ASCII, with the unit's suffix where it is a time or a rate.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
}

impl Parameter {
    /// Returns a parameter with this name and unit.
    #[must_use]
    pub fn new(name: impl Into<String>, unit: Unit) -> Self {
        Self { name: name.into(), unit }
    }
}

/// A quantity that follows from the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// Name and unit.
    pub parameter: Parameter,
    /// Its value.
    pub value: f64,
    /// Its derivatives with respect to the parameters, the linear ones first.
    pub gradient: Vec<f64>,
}

/// A law of the form `offset + Σ weightⱼ φⱼ(moment; θ)`: linear in its weights, not in its θ.
///
/// The parameters of a law are its weights, then its θ, in the order of [`SeparableLaw::linear`] and
/// [`SeparableLaw::nonlinear`].
pub trait SeparableLaw {
    /// The weights.
    fn linear(&self) -> Vec<Parameter>;

    /// The θ.
    fn nonlinear(&self) -> Vec<Parameter>;

    /// Returns the search ranges of all θ, given the extent of the data.
    fn search(&self, extent: &Extent) -> Vec<Search>;

    /// Writes φⱼ to `values[j]` and ∂φⱼ/∂θₖ to `slopes[j * θ.len() + k]`. Both come filled with zeros.
    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]);

    /// Part of the reading that is known without any parameter.
    fn offset(&self) -> f64 {
        0.0
    }

    /// Sorts interchangeable terms, fastest first.
    fn order(&self, _weights: &mut [f64], _theta: &mut [f64]) {}

    /// Returns the parameters that are derived from the fitted ones.
    fn derived(&self, _weights: &[f64], _theta: &[f64], _data: &[Datum]) -> Vec<Derived> {
        Vec::new()
    }
}

/// Returns the reading of a law and its gradient with respect to all parameters, the linear ones first.
///
/// ```
/// use ohmstrain_calib::closed_form::{ClosedForm, ModulusShape, Moment, value_and_gradient};
/// // R∞ = 1, r = 2, τ = 3 s at t = 3 s: 1 + 2/e.
/// let at = Moment { elapsed_s: 3.0, ..Moment::default() };
/// let law = ClosedForm::Eq7 { terms: 1 }.law(ModulusShape::SINGLE, false, 1600.0);
/// let (value, gradient) = value_and_gradient(law.as_ref(), &[1.0, 2.0], &[3.0], &at);
/// assert!((value - 1.735_758_882).abs() < 1e-9);
/// assert!((gradient[1] - 0.367_879_441).abs() < 1e-9);
/// ```
#[must_use]
pub fn value_and_gradient(law: &dyn SeparableLaw, weights: &[f64], theta: &[f64], at: &Moment) -> (f64, Vec<f64>) {
    let (linear, nonlinear) = (weights.len(), theta.len());
    let mut gradient = vec![0.0; linear + nonlinear];
    let mut slopes = vec![0.0; linear * nonlinear];
    law.basis(theta, at, &mut gradient[..linear], &mut slopes);
    let value = law.offset() + weights.iter().zip(&gradient).map(|(weight, value)| weight * value).sum::<f64>();
    for k in 0..nonlinear {
        gradient[linear + k] = (0..linear).map(|j| weights[j] * slopes[j * nonlinear + k]).sum();
    }
    (value, gradient)
}

/// Sorts terms by time constant, each weight with its own.
pub(super) fn sort_terms(weights: &mut [f64], taus: &mut [f64]) {
    let mut terms: Vec<(f64, f64)> = taus.iter().copied().zip(weights.iter().copied()).collect();
    terms.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (i, (tau, weight)) in terms.into_iter().enumerate() {
        (taus[i], weights[i]) = (tau, weight);
    }
}

/// Reason for not fitting a law.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ClosedFormError {
    /// Fewer readings than the law needs.
    #[error("{found} readings, at least {needed} are needed")]
    TooFewRows {
        /// Readings found.
        found: usize,
        /// Readings needed: two more than parameters.
        needed: usize,
    },
    /// A value that is not finite.
    #[error("the law is not finite on these readings")]
    NotFinite,
    /// The optimiser refused.
    #[error("optimiser: {0}")]
    Optimiser(&'static str),
}
