use ohmstrain_model::{Branch, Gauge, SensorLaw, StrainRange};
use serde::{Deserialize, Serialize};

/// Maximum number of branches.
pub const MOST_BRANCHES: usize = 4;

/// The switched Kelvin-Voigt law with up to four branches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawParams {
    /// Dash-pot while stretching, s (per unit of strain).
    pub extend_viscosity_s: f64,
    /// Dash-pot while releasing, s.
    pub retract_viscosity_s: f64,
    /// Range of strains on which it was fitted; beyond it, the gauge curve continues along its tangent.
    pub range: StrainRange<f64>,
    /// Quasi-static curve.
    #[serde(with = "GaugeTable")]
    pub gauge: Gauge<f64>,
    /// Relaxing branches, fastest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub branches: Vec<Branch<f64>>,
}

/// Form of a gauge curve in a sensor's file.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Gauge<f64>", tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
enum GaugeTable {
    Polynomial { coefficients: [f64; 3] },
    DecayingExponential { slope: f64, decay_strain: f64 },
    Tunnelling { gap: f64, barrier: f64, path_loss: f64 },
}

/// A number of a law under its name in `sensor.toml`: `branches[0].tau_s`.
pub struct LawParameter<'a> {
    /// The name.
    pub name: String,
    /// The number.
    pub value: &'a mut f64,
    /// True if it is relative to R₀, so that doubling R₀ halves it.
    pub is_over_rest: bool,
}

impl LawParams {
    /// Returns all its numbers except the range: gauge, dash-pots, branches.
    pub fn parameters_mut(&mut self) -> Vec<LawParameter<'_>> {
        let (over_rest, not) = (true, false);
        let gauge = match &mut self.gauge {
            Gauge::Polynomial { coefficients: [first, second, third] } => vec![
                ("gauge.coefficients[0]", first, over_rest),
                ("gauge.coefficients[1]", second, over_rest),
                ("gauge.coefficients[2]", third, over_rest),
            ],
            Gauge::DecayingExponential { slope, decay_strain } => {
                vec![("gauge.slope", slope, over_rest), ("gauge.decay_strain", decay_strain, not)]
            }
            Gauge::Tunnelling { gap, barrier, path_loss } => {
                vec![("gauge.gap", gap, not), ("gauge.barrier", barrier, not), ("gauge.path_loss", path_loss, not)]
            }
        };
        let dash_pots = [
            ("extend_viscosity_s", &mut self.extend_viscosity_s, over_rest),
            ("retract_viscosity_s", &mut self.retract_viscosity_s, over_rest),
        ];
        let named = |(name, value, is_over_rest)| LawParameter { name: String::from(name), value, is_over_rest };
        let mut all: Vec<LawParameter<'_>> = gauge.into_iter().chain(dash_pots).map(named).collect();
        for (index, branch) in self.branches.iter_mut().enumerate() {
            let own = [
                ("tau_s", &mut branch.tau_s, not),
                ("extend_gain", &mut branch.extend_gain, over_rest),
                ("retract_gain", &mut branch.retract_gain, over_rest),
                ("extend_gain_slope", &mut branch.extend_gain_slope, over_rest),
                ("retract_gain_slope", &mut branch.retract_gain_slope, over_rest),
            ];
            let named = |(name, value, is_over_rest)| LawParameter {
                name: format!("branches[{index}].{name}"),
                value,
                is_over_rest,
            };
            all.extend(own.map(named));
        }
        all
    }

    /// Converts it to the model's law; `None` unless there are exactly `B` branches.
    #[must_use]
    pub fn to_model<const B: usize>(&self) -> Option<SensorLaw<f64, B>> {
        Some(SensorLaw {
            gauge: self.gauge,
            extend_viscosity_s: self.extend_viscosity_s,
            retract_viscosity_s: self.retract_viscosity_s,
            branches: self.branches.as_slice().try_into().ok()?,
            range: self.range,
        })
    }
}
