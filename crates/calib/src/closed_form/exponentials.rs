use super::datum::{Datum, Moment};
use super::law::{Derived, Parameter, SeparableLaw, Unit, sort_terms};
use super::search::{Extent, Search};

/// The modulus of equations 8 and 9, relative to its initial value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModulusShape {
    /// Number of exponentials, at least 1.
    pub terms: usize,
    /// True if it relaxes to a floor instead of to zero; more than one term always has a floor.
    pub floor: bool,
}

impl ModulusShape {
    /// `exp(-t/τ₀)`, as equations 8 and 9 are printed.
    pub const SINGLE: Self = Self { terms: 1, floor: false };
}

/// Sums of decaying exponentials of the time since a phase began: equations 1, 5, 6 and 7 and the Prony series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exponentials {
    terms: usize,
    floor: bool,
    form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// Rates λ and amplitudes r.
    Rates,
    /// Time constants τ, and amplitudes named with this letter.
    Taus(&'static str),
    /// One time constant, and the floor as a fraction of the amplitude.
    FloorShare,
}

impl Exponentials {
    /// Equation 1: `R∞ + r₁ exp(-λ₁ t) + r₂ exp(-λ₂ t)`; λ in 1/s, λ₁ > λ₂.
    #[must_use]
    pub const fn two_rates() -> Self {
        Self { terms: 2, floor: true, form: Form::Rates }
    }

    /// Equation 5: `Σ Aᵢ exp(-t/τᵢ)`, no floor.
    #[must_use]
    pub const fn without_floor(terms: usize) -> Self {
        Self { terms, floor: false, form: Form::Taus("a") }
    }

    /// Equation 6: `s (exp(-t/τ) + E₀)`, with the scale s that turns a modulus into a reading.
    #[must_use]
    pub const fn floor_share() -> Self {
        Self { terms: 1, floor: true, form: Form::FloorShare }
    }

    /// Equation 7, a Prony series: `E∞ + Σ Eᵢ exp(-t/τᵢ)`, in units of the reading.
    #[must_use]
    pub const fn prony(terms: usize) -> Self {
        Self { terms, floor: true, form: Form::Taus("e") }
    }
}

impl SeparableLaw for Exponentials {
    fn linear(&self) -> Vec<Parameter> {
        let letter = match self.form {
            Form::FloorShare => return ["floor", "scale"].map(|name| Parameter::new(name, Unit::Reading)).to_vec(),
            Form::Rates => "r",
            Form::Taus(letter) => letter,
        };
        let floor = self.floor.then(|| format!("{letter}_inf"));
        let terms = (1..=self.terms).map(|i| format!("{letter}{i}"));
        floor.into_iter().chain(terms).map(|name| Parameter::new(name, Unit::Reading)).collect()
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        let name = |i| match self.form {
            Form::Rates => Parameter::new(format!("lambda{i}_per_s"), Unit::PerSecond),
            Form::FloorShare => Parameter::new("tau_s", Unit::Second),
            Form::Taus(_) => Parameter::new(format!("tau{i}_s"), Unit::Second),
        };
        (1..=self.terms).map(name).collect()
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        if self.form == Form::Rates { extent.rates(self.terms) } else { extent.time_constants(self.terms) }
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let first = usize::from(self.floor);
        if self.floor {
            values[0] = 1.0;
        }
        for (i, &own) in theta.iter().enumerate() {
            let (value, slope) = match self.form {
                Form::Rates => ((-own * at.elapsed_s).exp(), -at.elapsed_s * (-own * at.elapsed_s).exp()),
                _ => decay(at.elapsed_s, own),
            };
            values[first + i] = value;
            slopes[(first + i) * self.terms + i] = slope;
        }
    }

    fn order(&self, weights: &mut [f64], theta: &mut [f64]) {
        let first = usize::from(self.floor);
        sort_terms(&mut weights[first..], theta);
        if self.form == Form::Rates {
            weights[first..].reverse();
            theta.reverse();
        }
    }

    fn derived(&self, weights: &[f64], _theta: &[f64], _data: &[Datum]) -> Vec<Derived> {
        let &[floor, scale] = weights else { return Vec::new() };
        if self.form != Form::FloorShare {
            return Vec::new();
        }
        let gradient = vec![1.0 / scale, -floor / (scale * scale), 0.0];
        vec![Derived { parameter: Parameter::new("e0", Unit::One), value: floor / scale, gradient }]
    }
}

/// Returns `exp(-t/τ)` and its derivative with respect to τ.
pub(super) fn decay(elapsed_s: f64, tau_s: f64) -> (f64, f64) {
    let value = (-elapsed_s / tau_s).exp();
    (value, value * elapsed_s / (tau_s * tau_s))
}

/// Equation 2, Burgers: `R/R₀ - 1 = a + b exp(-t/τ) + c t`, fitted in units of the reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burgers {
    /// Reading at rest R₀, which the law does not determine.
    pub rest_reading: f64,
}

impl SeparableLaw for Burgers {
    fn linear(&self) -> Vec<Parameter> {
        let unit = [("a", Unit::One), ("b", Unit::One), ("c_per_s", Unit::PerSecond)];
        unit.map(|(name, unit)| Parameter::new(name, unit)).to_vec()
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        vec![Parameter::new("tau_s", Unit::Second)]
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        extent.time_constants(1)
    }

    fn offset(&self) -> f64 {
        self.rest_reading
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let (value, slope) = decay(at.elapsed_s, theta[0]);
        for (place, value) in values.iter_mut().zip([1.0, value, at.elapsed_s]) {
            *place = self.rest_reading * value;
        }
        slopes[1] = self.rest_reading * slope;
    }
}
