use super::datum::Moment;
use super::law::{Parameter, SeparableLaw, Unit};
use super::search::{Extent, Search};

/// Tunnelling between particles whose gaps grow with strain: `R₀ (1 + C ε) exp(A ε + W ε²)`, C ≥ 0.
///
/// Source: Zhang, Pan, Zheng & Yi, *J. Polym. Sci. B* 38 (2000) 2739, with the exponent in powers of strain. It is the
/// gauge curve `ohmstrain_model::Gauge::Tunnelling`, fitted to data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TunnellingCurve;

impl SeparableLaw for TunnellingCurve {
    fn linear(&self) -> Vec<Parameter> {
        vec![Parameter::new("rest_reading", Unit::Reading)]
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        let own = [("gap", Unit::PerStrain), ("barrier", Unit::PerStrain), ("path_loss", Unit::PerStrainSquared)];
        own.map(|(name, unit)| Parameter::new(name, unit)).to_vec()
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        let scale = 1.0 / extent.strain;
        let between = |low: f64, high: f64, unit: f64, starts: &[f64]| {
            let starts: Vec<f64> = starts.iter().map(|start| start * unit).collect();
            Search::between(low * unit, high * unit, &starts)
        };
        vec![
            between(0.0, 100.0, scale, &[0.3, 3.0]),
            between(-20.0, 20.0, scale, &[-1.0, 0.0, 1.0]),
            between(-20.0, 20.0, scale * scale, &[-1.0, 0.0, 1.0]),
        ]
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        let (gap, barrier, path_loss) = (theta[0], theta[1], theta[2]);
        let growth = (at.strain * (barrier + at.strain * path_loss)).exp();
        let value = (1.0 + gap * at.strain) * growth;
        values[0] = value;
        slopes.copy_from_slice(&[at.strain * growth, at.strain * value, at.strain * at.strain * value]);
    }
}
