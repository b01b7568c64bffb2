//! Work that a calibration repeats over and over: one pass of the EKF over a recording.

use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
use ohmstrain_bench_filters::sensor;
use ohmstrain_ekf::{Belief, Compact, Ekf, Reading, SparseEkf};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

/// Seconds of the recording; 20 readings in each.
const DURATION_S: f64 = 150.0;

/// 3000 readings R/R₀ - 1 of a simulated bench at 20 Hz.
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

/// Filters of two branches and a baseline, which is what `calibrate` fits most often.
pub struct RecordingPass {
    generic: Ekf<SwitchedModel<f64, 2, 5>>,
    prepared: SwitchedStep<f64, 2>,
    sparse: SparseEkf<f64, Compact, 2, 5>,
    start: Belief<f64, 5, 15>,
}

impl RecordingPass {
    /// Filters at 20 Hz.
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

    /// Strain after the last reading; NaN if a step fails.
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

    /// The same along the sparse path.
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
