//! Sparse EKF of strain, rate and one branch, which accepts another step length at every reading.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_3, VaryingFast3, frame};

#[entry]
fn main() -> ! {
    frame::run::<VaryingFast3<f32>, _>(&CODES_3)
}
