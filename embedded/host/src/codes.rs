//! Codes of a 12-bit converter in front of simulated sensors that obey the laws of the filters: one with a single branch for
//! the filters of three states, one with three branches for those of six.

use ohmstrain_firmware::{DT_S, REST_OHM, front_end, sensor};
use ohmstrain_model::{ParameterError, Phase};

/// Number of readings: six seconds.
pub const READINGS: usize = 600;

/// Seed of the converter's noise.
pub const SEED: u64 = 20_240_611;

/// Substeps per reading for the law's differential equation.
const SUBSTEPS: usize = 20;

/// Returns the strain of the body: rest, a cycle of 4 s to 15 % and back, a ramp to 10 % and a hold.
fn strain(time_s: f64) -> f64 {
    match time_s {
        t if t < 0.5 => 0.0,
        t if t < 4.5 => 0.075 - 0.075 * libm::cos(0.5 * core::f64::consts::PI * (t - 0.5)),
        t if t < 5.5 => 0.1 * (t - 4.5),
        _ => 0.1,
    }
}

/// Returns the strain at every reading.
pub fn strains() -> Vec<f64> {
    (1..=READINGS).map(|k| strain(k as f64 * DT_S)).collect()
}

/// Returns the converter's codes for a sensor with `B` branches.
pub fn codes<const B: usize, const N: usize>() -> Result<Vec<u16>, ParameterError> {
    let model = sensor::<f64, B, N>()?;
    let (law, divider, mut noise) = (model.law(), front_end::<f64>()?, Noise(SEED));
    let h = DT_S / SUBSTEPS as f64;
    let mut relaxation = [0.0; B];
    let mut codes = Vec::with_capacity(READINGS);
    for k in 1..=READINGS {
        let (mut phase, mut rate) = (Phase::Hold, 0.0);
        for s in 0..SUBSTEPS {
            let time_s = (k - 1) as f64 * DT_S + s as f64 * h;
            let now = strain(time_s);
            rate = (strain(time_s + h) - now) / h;
            phase = if rate > 0.0 {
                Phase::Extend
            } else if rate < 0.0 {
                Phase::Retract
            } else {
                Phase::Hold
            };
            for (i, c) in relaxation.iter_mut().enumerate() {
                *c += h * (law.gain(i, now, phase).0 * rate - *c / law.branches[i].tau_s);
            }
        }
        let rho = law.relative_change(strain(k as f64 * DT_S), rate, &relaxation, 0.0, phase);
        let code = divider.code(REST_OHM * (1.0 + rho)) + noise.next();
        codes.push(code.round().clamp(0.0, 4095.0) as u16);
    }
    Ok(codes)
}

/// Noise of one code: Knuth's MMIX generator; a sum of twelve uniform numbers is close enough to normal here.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}
