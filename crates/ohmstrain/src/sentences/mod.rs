//! Sentences and numbers about a sensor for people: the summary of a calibration, doubts and their answers. Command line,
//! Python and report share them, but wrap lines on their own.

mod answers;
#[cfg(feature = "calibrate")]
mod calibration_doubts;
mod closing;
mod doubts;
pub mod number;
pub mod verdict;

pub use answers::Interface;
#[cfg(feature = "calibrate")]
pub use answers::LagAnswer;
pub use closing::{Closing, Tested};
