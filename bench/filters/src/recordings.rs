//! Smoothing of a whole recording at a fixed rate.

use ohmstrain_ekf::{Belief, Dynamics, Ekf, Estimator, Reading};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

use crate::DT_S;

/// Filter and Rauch-Tung-Striebel smoother of three states.
#[derive(Clone, Copy, Debug)]
pub struct Smoother {
    ekf: Ekf<SwitchedModel<f64, 1, 3>>,
    prepared: SwitchedStep<f64, 1>,
    start: Belief<f64, 3, 6>,
}

/// Creates a smoother that starts from the model's long-run distribution.
#[must_use]
pub fn smoother(model: SwitchedModel<f64, 1, 3>) -> Smoother {
    let prepared = Dynamics::<f64, 3, 6>::prepare(&model, DT_S);
    Smoother { ekf: Ekf::new(model), prepared, start: Belief::initial(&model) }
}

impl Smoother {
    /// Keeps only the filtered beliefs, repeats every step in the backward pass, and smooths in place.
    ///
    /// # Panics
    /// If a step fails.
    #[must_use]
    pub fn in_place(&self, readings: &[f64]) -> Vec<Belief<f64, 3, 6>> {
        let mut beliefs = Vec::with_capacity(readings.len());
        let mut belief = self.start;
        for reading in readings {
            let taken = self.ekf.advance(&belief, &self.prepared, Some(Reading::from(*reading)));
            belief = taken.expect("the reading is finite").state;
            beliefs.push(belief);
        }
        for k in (1..beliefs.len()).rev() {
            let reading = Some(Reading::from(readings[k]));
            let smoothed = self.ekf.smooth_back(&beliefs[k - 1], &self.prepared, reading, &beliefs[k]);
            beliefs[k - 1] = smoothed.expect("the step went forward");
        }
        beliefs
    }
}
