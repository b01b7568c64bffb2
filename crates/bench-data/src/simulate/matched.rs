use ohmstrain_model::{Branch, Gauge, SensorLaw, StrainRange};

use super::Material;
use super::sensor::{Movement, StretchedSensor};

/// A sensor of the fitted family: the switched Kelvin-Voigt law with two branches.
pub(super) struct Matched {
    law: SensorLaw<f64, 2>,
    relaxation: [f64; 2],
}

impl Matched {
    pub(super) fn new(material: Material) -> Self {
        Self { law: law(material), relaxation: [0.0; 2] }
    }
}

impl StretchedSensor for Matched {
    /// Advances the branches, exactly for constant gains. Gains affine in strain are evaluated at mid-strain, with an
    /// error of second order in a step of at most 10 ms.
    fn advance(&mut self, movement: &Movement) {
        let (phase, mid_strain) = (movement.phase(), movement.mid_strain());
        for i in 0..self.relaxation.len() {
            let (gain, _) = self.law.gain(i, mid_strain, phase);
            let tau_s = self.law.branches[i].tau_s;
            let gone = -(-movement.duration_s / tau_s).exp_m1();
            self.relaxation[i] += gone * (gain * movement.rate * tau_s - self.relaxation[i]);
        }
    }

    fn relative_change(&self, movement: &Movement) -> f64 {
        self.law.relative_change(movement.to_strain, movement.rate, &self.relaxation, 0.0, movement.phase())
    }
}

/// Returns the illustrative law: slope and peak of the quasi-static curve, a fast and a slow branch, dash-pot terms.
fn law(material: Material) -> SensorLaw<f64, 2> {
    let (slope, decay_strain, viscosity_s, branches) = match material {
        Material::Ecoflex0030 | Material::Representative => {
            (4.0, 0.21, 0.02, [branch(3.5, 0.75, -0.9, -1.0, -0.3), branch(45.0, 0.45, -0.35, -0.9, -0.2)])
        }
        Material::Ecoflex0050 => {
            (6.8, 0.095, 0.015, [branch(1.2, 0.9, -1.0, -2.5, -0.5), branch(18.0, 0.35, -0.45, -0.9, -0.3)])
        }
        Material::Vytaflex10 => {
            (3.7, 0.21, 0.025, [branch(4.0, 0.7, -0.8, -1.0, -0.3), branch(55.0, 0.45, -0.35, -0.9, -0.2)])
        }
    };
    SensorLaw {
        gauge: Gauge::DecayingExponential { slope, decay_strain },
        extend_viscosity_s: viscosity_s,
        retract_viscosity_s: -viscosity_s,
        branches,
        range: StrainRange { lower: 0.0, upper: 0.6 },
    }
}

const fn branch(tau_s: f64, extend: f64, retract: f64, extend_slope: f64, retract_slope: f64) -> Branch<f64> {
    Branch {
        tau_s,
        extend_gain: extend,
        retract_gain: retract,
        extend_gain_slope: extend_slope,
        retract_gain_slope: retract_slope,
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_model::Phase;

    use super::*;

    #[test]
    fn every_material_has_a_valid_law() {
        for material in Material::ALL {
            assert_eq!(law(material).validate(), Ok(()), "{material}");
        }
    }

    #[test]
    fn a_ramp_charges_a_branch_as_the_closed_form_says() {
        let mut sensor = Matched::new(Material::Ecoflex0030);
        sensor.law.branches = [branch(3.5, 0.75, -0.9, 0.0, 0.0), branch(45.0, 0.45, -0.35, 0.0, 0.0)];
        let rate: f64 = 0.04;
        for i in 0..500 {
            let from = f64::from(i) * 0.01 * rate;
            sensor.advance(&Movement { from_strain: from, to_strain: from + 0.01 * rate, rate, duration_s: 0.01 });
        }
        let closed = |tau: f64, gain: f64| gain * rate * tau * (1.0 - f64::exp(-5.0 / tau));
        // There are 500 steps, each with a few roundings of the state: 500 · 4 ε · 0.1 < 1e-13.
        assert!((sensor.relaxation[0] - closed(3.5, 0.75)).abs() < 1e-13);
        assert!((sensor.relaxation[1] - closed(45.0, 0.45)).abs() < 1e-13);
        assert_eq!(Movement { from_strain: 0.1, to_strain: 0.1, rate: 0.0, duration_s: 1.0 }.phase(), Phase::Hold);
    }
}
