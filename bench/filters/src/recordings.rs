//! What is done with a whole recording at a fixed rate.

use ohmstrain_ekf::{Belief, Compact, Cubic, Curve, Dynamics, Ekf, Estimator, Reading, SparseEkf, Switch};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

use crate::DT_S;

/// Filter and Rauch-Tung-Striebel smoother of three states.
#[derive(Clone, Copy, Debug)]
pub struct Smoother {
    ekf: Ekf<SwitchedModel<f64, 1, 3>>,
    prepared: SwitchedStep<f64, 1>,
    start: Belief<f64, 3, 6>,
}

/// A smoother from the model's long-run distribution.
#[must_use]
pub fn smoother(model: SwitchedModel<f64, 1, 3>) -> Smoother {
    let prepared = Dynamics::<f64, 3, 6>::prepare(&model, DT_S);
    Smoother { ekf: Ekf::new(model), prepared, start: Belief::initial(&model) }
}

impl Smoother {
    /// Keeps the filtered beliefs only, takes every step again on the way back, and smooths in place.
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
            beliefs[k - 1] = smoothed.expect("the step went forward").expect("the EKF has a smoother");
        }
        beliefs
    }
}

/// Filter and smoother without multiplications by zero, in place.
///
/// # Panics
/// If a step fails.
#[must_use]
pub fn sparse_smooth<S: Switch<f64>, G: Curve<f64>>(
    ekf: &SparseEkf<f64, S, 1, 3, G>,
    start: &Belief<f64, 3, 6>,
    readings: &[Option<Reading<f64>>],
) -> Vec<Belief<f64, 3, 6>> {
    let mut beliefs = vec![*start; readings.len()];
    ekf.filter(start, readings.iter().copied(), &mut beliefs).expect("the readings are finite");
    ekf.smooth(readings, &mut beliefs).expect("the filtered beliefs are sound");
    beliefs
}

/// The log-likelihood of a recording under the EKF of three states; NaN if a step fails.
#[must_use]
pub fn log_likelihood(
    ekf: &SparseEkf<f64, Compact, 1, 3, Cubic<f64>>,
    start: &Belief<f64, 3, 6>,
    readings: &[f64],
) -> f64 {
    ekf.log_likelihood(start, readings.iter().map(|y| Some(Reading::from(*y)))).unwrap_or(f64::NAN)
}
