//! Sparse EKF of six states at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, Fast6, frame};

#[entry]
fn main() -> ! {
    frame::run::<Fast6<f32>, _>(&CODES_6)
}
