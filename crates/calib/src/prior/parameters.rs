use crate::params::law::{GaugeParams, LawParams};

impl LawParams {
    /// The parameter of a name that [`Uncertainty`](crate::Uncertainty) has; `None` for R₀, which is none of the law's.
    pub(super) fn parameter(&mut self, name: &str) -> Option<&mut f64> {
        match (name, &mut self.gauge) {
            ("extend_viscosity_s", _) => return Some(&mut self.extend_viscosity_s),
            ("retract_viscosity_s", _) => return Some(&mut self.retract_viscosity_s),
            ("gauge.slope", GaugeParams::DecayingExponential { slope, .. }) => return Some(slope),
            ("gauge.decay_strain", GaugeParams::DecayingExponential { decay_strain, .. }) => return Some(decay_strain),
            ("gauge.gap", GaugeParams::Tunnelling { gap, .. }) => return Some(gap),
            ("gauge.barrier", GaugeParams::Tunnelling { barrier, .. }) => return Some(barrier),
            ("gauge.path_loss", GaugeParams::Tunnelling { path_loss, .. }) => return Some(path_loss),
            (_, GaugeParams::Polynomial { coefficients }) if name.starts_with("gauge.coefficients[") => {
                return coefficients.get_mut(index(name)?);
            }
            _ => {}
        }
        let branch = self.branches.get_mut(index(name.strip_prefix("branches")?)?)?;
        Some(match name.rsplit('.').next()? {
            "tau_s" => &mut branch.tau_s,
            "extend_gain" => &mut branch.extend_gain,
            "retract_gain" => &mut branch.retract_gain,
            "extend_gain_slope" => &mut branch.extend_gain_slope,
            "retract_gain_slope" => &mut branch.retract_gain_slope,
            _ => return None,
        })
    }
}

/// The number in brackets.
fn index(name: &str) -> Option<usize> {
    let (_, rest) = name.split_once('[')?;
    rest.split_once(']')?.0.parse().ok()
}
