//! Work that a calibration repeats many times: one pass of the EKF over a recording.

use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
use ohmstrain_bench_filters::sensor;
use ohmstrain_ekf::{Belief, Compact, Ekf, Reading, SparseEkf};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

/// Duration of the recording, s, with 20 readings per second.
const DURATION_S: f64 = 150.0;

/// Returns 3000 readings R/R₀ - 1 of a simulated bench at 20 Hz.
///
/// # Panics
/// Never: the settings are valid.
#[must_use]
pub fn simulated_recording() -> Vec<f64> {
    let settings = SimulationSettings::new(Material::Ecoflex0030, Protocol::Mixed { duration_s: DURATION_S });
    let ohms = simulate(&settings).expect("the settings are valid").readings.values;
    let readings: Vec<f64> = ohms.iter().take(3000).map(|ohm| ohm / ohms[0] - 1.0).collect();
    assert_eq!(readings.len(), 3000, "a shorter recording costs less");
    readings
}

/// Filters of two branches and a baseline, the structure that `calibrate` fits most often.
pub struct RecordingPass {
    generic: Ekf<SwitchedModel<f64, 2, 5>>,
    prepared: SwitchedStep<f64, 2>,
    sparse: SparseEkf<f64, Compact, 2, 5>,
    start: Belief<f64, 5, 15>,
}

impl RecordingPass {
    /// Creates filters at 20 Hz.
    ///
    /// # Panics
    /// Never: the step's length is positive.
    #[must_use]
    pub fn new() -> Self {
        let (model, dt_s) = (sensor::<2, 5>(), 0.05);
        Self {
            generic: Ekf::new(model),
            prepared: model.prepare(dt_s),
            sparse: SparseEkf::new(model, dt_s).expect("the step's length is positive"),
            start: Belief::initial(&model),
        }
    }

    /// Returns the strain after the last reading, by the generic filter; NaN if a step fails.
    #[must_use]
    pub fn generic(&self, readings: &[f64]) -> f64 {
        let mut belief = self.start;
        for reading in readings {
            match self.generic.step_prepared(&belief, &self.prepared, Some(Reading::from(*reading))) {
                Ok(step) => belief = step.posterior,
                Err(_) => return f64::NAN,
            }
        }
        belief.mean[0]
    }

    /// Returns the same by the sparse filter.
    #[must_use]
    pub fn sparse(&self, readings: &[f64]) -> f64 {
        let mut belief = self.start;
        for reading in readings {
            if self.sparse.step(&mut belief, Some(Reading::from(*reading))).is_err() {
                return f64::NAN;
            }
        }
        belief.mean[0]
    }
}

impl Default for RecordingPass {
    fn default() -> Self {
        Self::new()
    }
}
