//! EKF of strain, rate and one branch, with the step prepared anew for every reading.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_3, VaryingEkf3, frame};

#[entry]
fn main() -> ! {
    frame::run::<VaryingEkf3<f32>, _>(&CODES_3)
}
