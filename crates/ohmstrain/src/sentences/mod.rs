//! What people read of a sensor, in sentences and numbers: what a calibration came to, what is doubted and what answers it. Command
//! line, Python and report say these; how long a line is and where one ends is theirs.

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
