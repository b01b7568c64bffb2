//! Other Kalman filters on the sensor's linear model of three states, each used as its documentation shows it.
//!
//! All get F, Q, H and R as constants; ohmstrain's filters work them out anew in every step, from a law that is not linear.

mod rivals;
mod simulated;

pub use rivals::{adskalman_smoother, every_rival, typed_kalman_smoother};
pub use simulated::{RecordingPass, simulated_recording};
