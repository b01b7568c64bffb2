//! Other Kalman filters on the sensor of three states, each used as its documentation shows it: on its linear model, with F, Q,
//! H and R as constants; and on the one that is not linear, with these worked out anew in every step, as ohmstrain's filters do.

mod rivals;
mod simulated;

pub use rivals::{adskalman_smoother, every_nonlinear_rival, every_rival, typed_kalman_smoother};
pub use simulated::{RecordingPass, simulated_recording};
