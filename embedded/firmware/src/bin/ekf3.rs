//! EKF of strain, rate and one branch at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_3, Ekf3, frame};

#[entry]
fn main() -> ! {
    frame::run::<Ekf3<f32>, _>(&CODES_3)
}
