//! Rows whose estimates wait for later readings.

use ohmstrain_ekf::live::{Doubts, Measured, SensorEstimator};
use ohmstrain_ekf::{Estimator, Gaussian};

use crate::run::backward::KeptStep;
use crate::run::remembering::Remembering;

/// Data of a row in the forward pass.
pub(crate) type LiveStep<E, const N: usize, const L: usize> =
    KeptStep<Remembering<E, <E as Estimator<f64, N, L>>::Prepared>, N, L>;

/// A row whose estimate waits for later readings.
pub(crate) struct Pending<E: SensorEstimator<f64, N, L>, const N: usize, const L: usize> {
    pub time_s: f64,
    pub reported: Reported,
    pub row: LiveStep<E, N, L>,
}

/// A row as it was reported when it came.
#[derive(Clone, Copy)]
pub(crate) struct Reported {
    pub measured: Measured<f64>,
    /// The corrected strain before doubts, and the ratio of observed to stated innovation variance; `None` without a
    /// correction.
    pub corrected: Option<(Gaussian<f64>, f64)>,
    pub doubts: Doubts<f64>,
    pub rest_off: f64,
}
