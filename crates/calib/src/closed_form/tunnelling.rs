use super::law::{Moment, Parameter, SeparableLaw, Unit};
use super::search::{Extent, Search};

/// Tunnelling between particles whose gaps grow with strain: `R₀ (1 + C ε) exp(A ε + W ε²)`, C ≥ 0.
///
/// Source: Zhang, Pan, Zheng & Yi, *J. Polym. Sci. B* 38 (2000) 2739, with the exponent in powers of strain; the
/// gauge curve `ohmstrain_model::Gauge::Tunnelling` for data.
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

/// Planck's constant, J s (exact in the SI of 2019).
const PLANCK_J_S: f64 = 6.626_070_15e-34;
/// Mass of the electron, kg (CODATA 2018).
const ELECTRON_KG: f64 = 9.109_383_701_5e-31;
/// An electron volt, J (exact in the SI of 2019).
const ELECTRON_VOLT_J: f64 = 1.602_176_634e-19;

/// Equation 3: resistance of one conducting path, `s exp(4π s √(2 m φ) / h)` up to a factor, in nm, for a gap s in nm and
/// a barrier φ in eV; with its derivatives with respect to gap and barrier.
///
/// Source: Simmons, *J. Appl. Phys.* 34 (1963) 1793, low voltage.
#[must_use]
pub fn tunnelling_path(gap_nm: f64, barrier_ev: f64) -> (f64, [f64; 2]) {
    let momentum = (2.0 * ELECTRON_KG * ELECTRON_VOLT_J * barrier_ev).sqrt();
    let per_nm = 4.0 * std::f64::consts::PI * momentum / PLANCK_J_S * 1e-9;
    let exponent = per_nm * gap_nm;
    let value = gap_nm * exponent.exp();
    (value, [(1.0 + exponent) * exponent.exp(), value * exponent / (2.0 * barrier_ev)])
}
