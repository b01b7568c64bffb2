//! Other Kalman filters on the sensor of three states, each used as its documentation shows. On the linear model, F, Q, H and R
//! are constants; on the nonlinear one they are computed in every step, as in ohmstrain's filters.

mod rivals;
mod simulated;

pub use rivals::{adskalman_smoother, every_nonlinear_rival, every_rival, typed_kalman_smoother};
pub use simulated::{RecordingPass, simulated_recording};
