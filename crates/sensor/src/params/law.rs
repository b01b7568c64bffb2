use ohmstrain_model::{Branch, Gauge, SensorLaw};
use serde::{Deserialize, Serialize};

use crate::params::range::RangeParams;

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
    pub range: RangeParams,
    /// Quasi-static curve.
    pub gauge: GaugeParams,
    /// Relaxing branches, fastest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub branches: Vec<BranchParams>,
}

/// The quasi-static curve g(ε).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case", deny_unknown_fields)]
pub enum GaugeParams {
    /// `a₁ ε + a₂ ε² + a₃ ε³`.
    Polynomial {
        /// a₁, a₂, a₃.
        coefficients: [f64; 3],
    },
    /// `G ε exp(-ε/ε₀)`.
    DecayingExponential {
        /// G.
        slope: f64,
        /// ε₀.
        decay_strain: f64,
    },
    /// `(1 + C ε) exp(A ε + W ε²) - 1`.
    Tunnelling {
        /// C.
        gap: f64,
        /// A.
        barrier: f64,
        /// W.
        path_loss: f64,
    },
}

impl GaugeParams {
    /// Converts it to the model's gauge.
    #[must_use]
    pub const fn to_model(self) -> Gauge<f64> {
        match self {
            Self::Polynomial { coefficients } => Gauge::Polynomial { coefficients },
            Self::DecayingExponential { slope, decay_strain } => Gauge::DecayingExponential { slope, decay_strain },
            Self::Tunnelling { gap, barrier, path_loss } => Gauge::Tunnelling { gap, barrier, path_loss },
        }
    }
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

/// One relaxing branch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BranchParams {
    /// Time constant, s.
    pub tau_s: f64,
    /// Gain while stretching.
    pub extend_gain: f64,
    /// Gain while releasing.
    pub retract_gain: f64,
    /// Growth of the stretching gain with strain.
    pub extend_gain_slope: f64,
    /// Growth of the releasing gain with strain.
    pub retract_gain_slope: f64,
}

impl LawParams {
    /// Returns all its numbers except the range: gauge, dash-pots, branches.
    pub fn parameters_mut(&mut self) -> Vec<LawParameter<'_>> {
        let (over_rest, not) = (true, false);
        let gauge = match &mut self.gauge {
            GaugeParams::Polynomial { coefficients: [first, second, third] } => vec![
                ("gauge.coefficients[0]", first, over_rest),
                ("gauge.coefficients[1]", second, over_rest),
                ("gauge.coefficients[2]", third, over_rest),
            ],
            GaugeParams::DecayingExponential { slope, decay_strain } => {
                vec![("gauge.slope", slope, over_rest), ("gauge.decay_strain", decay_strain, not)]
            }
            GaugeParams::Tunnelling { gap, barrier, path_loss } => {
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
        let branches: Vec<Branch<f64>> = self
            .branches
            .iter()
            .map(|branch| Branch {
                tau_s: branch.tau_s,
                extend_gain: branch.extend_gain,
                retract_gain: branch.retract_gain,
                extend_gain_slope: branch.extend_gain_slope,
                retract_gain_slope: branch.retract_gain_slope,
            })
            .collect();
        Some(SensorLaw {
            gauge: self.gauge.to_model(),
            extend_viscosity_s: self.extend_viscosity_s,
            retract_viscosity_s: self.retract_viscosity_s,
            branches: branches.try_into().ok()?,
            range: self.range.to_model(),
        })
    }
}
