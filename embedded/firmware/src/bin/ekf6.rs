//! EKF of strain, rate, three branches and baseline at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, Ekf6, frame};

#[entry]
fn main() -> ! {
    frame::run::<Ekf6<f32>, _>(&CODES_6)
}
