//! Simulated readings of the sensor.

use crate::DT_S;
use crate::sensor::{READING_SD, law};

/// Gate on the normalised innovation squared; it rejects one reading in a thousand if the model is right.
pub(crate) const GATE: f64 = 10.8;

/// Number of readings after which they repeat.
const PERIOD: usize = 500;

/// Returns the strain of a body that moves to and fro with rests at both ends, with a period of 5 s.
#[must_use]
pub fn strain_at(k: usize) -> f64 {
    let turn = 2.0 * std::f64::consts::PI * (k % PERIOD) as f64 / PERIOD as f64;
    0.15 + 0.12 * turn.sin().clamp(-0.8, 0.8)
}

/// Returns `count` readings of a sensor with `B` branches and without a baseline that follows [`strain_at`]; the noise repeats,
/// too.
#[must_use]
pub fn readings<const B: usize>(count: usize) -> Vec<f64> {
    let law = law::<f64, B>();
    let mut noise = Noise(1);
    let mut relaxation = [0.0; B];
    let mut period = Vec::new();
    // Periods until the slowest branch repeats: 8 time constants of 64 s leave a third of a thousandth.
    const WARM_UP: usize = 100;
    for k in 0..(WARM_UP + 1) * PERIOD {
        let (strain, rate) = (strain_at(k), (strain_at(k) - strain_at(k + PERIOD - 1)) / DT_S);
        let extends = rate > 0.0;
        for (relaxation, branch) in relaxation.iter_mut().zip(&law.branches) {
            let gain = if extends {
                branch.extend_gain + branch.extend_gain_slope * strain
            } else {
                branch.retract_gain + branch.retract_gain_slope * strain
            };
            *relaxation += DT_S * (gain * rate - *relaxation / branch.tau_s);
        }
        if k >= WARM_UP * PERIOD {
            let viscosity_s = if extends { law.extend_viscosity_s } else { law.retract_viscosity_s };
            let clean = law.gauge.value_and_slope(strain).0 + viscosity_s * rate + relaxation.iter().sum::<f64>();
            period.push(clean + READING_SD * noise.next());
        }
    }
    period.into_iter().cycle().take(count).collect()
}

/// Noise of mean 0 and standard deviation 1.
struct Noise(u32);

impl Noise {
    /// Numerical Recipes' generator. The sum of its upper and lower half has a triangular distribution, whose deviation is 1/√6
    /// of its half-width.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let triangular = (f64::from(self.0 >> 16) + f64::from(self.0 & 0xffff)) / 65_536.0 - 1.0;
        6_f64.sqrt() * triangular
    }
}
