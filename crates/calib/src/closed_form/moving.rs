use super::datum::{Datum, Moment};
use super::exponentials::{ModulusShape, decay};
use super::law::{Derived, Parameter, SeparableLaw, Unit, sort_terms};
use super::search::{Extent, Search};

/// Equation 8, a movement: `R = r₀ E(t) v t + v η + r₁`, with the modulus E relative to its initial value.
///
/// The measured travel replaces `v t`; for a ramp at constant speed they are the same. The terms `r₀ Eᵢ` are separate weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moving {
    /// The modulus E(t); that of the paper has one term and no floor.
    pub modulus: ModulusShape,
    /// True if the data have several speeds. At one speed `v η` and `r₁` cannot be separated and form one parameter.
    pub several_speeds: bool,
}

/// Returns the weight of `v η + r₁`, or a weight for each of the two.
pub(super) fn intercept(several_speeds: bool) -> Vec<Parameter> {
    if several_speeds {
        vec![Parameter::new("eta", Unit::ReadingPerRate), Parameter::new("r1", Unit::Reading)]
    } else {
        vec![Parameter::new("v*eta+r1", Unit::Reading)]
    }
}

/// Returns the time constants with their names; a single one is the paper's τ₀.
pub(super) fn time_constants(terms: usize) -> Vec<Parameter> {
    let name = |i| if terms == 1 { "tau0_s".to_string() } else { format!("tau{i}_s") };
    (1..=terms).map(|i| Parameter::new(name(i), Unit::Second)).collect()
}

impl SeparableLaw for Moving {
    fn linear(&self) -> Vec<Parameter> {
        let stiffness = |name: String| Parameter::new(name, Unit::ReadingPerStrain);
        let ModulusShape { terms, floor } = self.modulus;
        let mut out: Vec<Parameter> = (1..=terms).map(|i| stiffness(format!("r0*e{i}"))).collect();
        if terms == 1 && !floor {
            out[0] = stiffness("r0".into());
        }
        out.extend(floor.then(|| stiffness("r0*e_inf".into())));
        out.extend(intercept(self.several_speeds));
        out
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        time_constants(self.modulus.terms)
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        extent.time_constants(self.modulus.terms)
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let terms = theta.len();
        for (i, &tau_s) in theta.iter().enumerate() {
            let (value, slope) = decay(at.elapsed_s, tau_s);
            values[i] = at.travel * value;
            slopes[i * terms + i] = at.travel * slope;
        }
        if self.modulus.floor {
            values[terms] = at.travel;
        }
        let last = values.len() - 1;
        if self.several_speeds {
            values[last - 1] = at.rate;
        }
        values[last] = 1.0;
    }

    fn order(&self, weights: &mut [f64], theta: &mut [f64]) {
        sort_terms(&mut weights[..theta.len()], theta);
    }

    /// Returns r₀ and the floor relative to the initial modulus: E₀/(1 + E₀) or E∞/(E∞ + ΣEᵢ).
    fn derived(&self, weights: &[f64], theta: &[f64], _data: &[Datum]) -> Vec<Derived> {
        let ModulusShape { terms, floor } = self.modulus;
        if !floor {
            return Vec::new();
        }
        let size = weights.len() + theta.len();
        let stiffness: f64 = weights[..=terms].iter().sum();
        let share = weights[terms] / stiffness;
        let mut sum = vec![0.0; size];
        sum[..=terms].fill(1.0);
        let mut slope = vec![0.0; size];
        slope[..=terms].fill(-share / stiffness);
        slope[terms] += 1.0 / stiffness;
        vec![
            Derived { parameter: Parameter::new("r0", Unit::ReadingPerStrain), value: stiffness, gradient: sum },
            Derived { parameter: Parameter::new("floor_share", Unit::One), value: share, gradient: slope },
        ]
    }
}

/// Equation 9, a hold: `R′ = r₀′ R₀ E(t) + r₁′`, where R₀ is the reading at the start of the hold, so that continuity
/// requires `r₁′ = R₀ (1 - r₀′)`: `R′ = R₀ + Σ r₀′ R₀ Eᵢ (exp(-t/τᵢ) - 1)`.
///
/// A hold cannot separate a floor of the modulus from `1 - r₀′`; with one, only `r₀′ Eᵢ` and the settled reading are known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hold {
    /// The modulus E(t).
    pub modulus: ModulusShape,
}

impl SeparableLaw for Hold {
    fn linear(&self) -> Vec<Parameter> {
        let terms = (1..=self.modulus.terms).map(|i| match self.modulus {
            ModulusShape::SINGLE => "r0_hold*r_start".to_string(),
            _ => format!("r0_hold*r_start*e{i}"),
        });
        std::iter::once("r_start".to_string()).chain(terms).map(|name| Parameter::new(name, Unit::Reading)).collect()
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        time_constants(self.modulus.terms)
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        extent.time_constants(self.modulus.terms)
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let terms = theta.len();
        values[0] = 1.0;
        for (i, &tau_s) in theta.iter().enumerate() {
            values[1 + i] = (-at.elapsed_s / tau_s).exp_m1();
            slopes[(1 + i) * terms + i] = decay(at.elapsed_s, tau_s).1;
        }
    }

    fn order(&self, weights: &mut [f64], theta: &mut [f64]) {
        sort_terms(&mut weights[1..], theta);
    }

    fn derived(&self, weights: &[f64], theta: &[f64], _data: &[Datum]) -> Vec<Derived> {
        let size = weights.len() + theta.len();
        let start = weights[0];
        let mut out = Vec::new();
        for (i, weight) in weights[1..].iter().enumerate() {
            let share = weight / start;
            let mut gradient = vec![0.0; size];
            (gradient[0], gradient[1 + i]) = (-share / start, 1.0 / start);
            let name = match self.modulus {
                ModulusShape::SINGLE => "r0_hold".into(),
                _ => format!("r0_hold*e{}", i + 1),
            };
            out.push(Derived { parameter: Parameter::new(name, Unit::One), value: share, gradient });
        }
        let mut gradient = vec![0.0; size];
        gradient[..weights.len()].fill(-1.0);
        gradient[0] = 1.0;
        let name = if self.modulus == ModulusShape::SINGLE { "r1_hold" } else { "r_settled" };
        let value = start - weights[1..].iter().sum::<f64>();
        out.push(Derived { parameter: Parameter::new(name, Unit::Reading), value, gradient });
        out
    }
}
