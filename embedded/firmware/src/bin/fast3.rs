//! Sparse EKF of three states at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_3, Fast3, frame};

#[entry]
fn main() -> ! {
    frame::run::<Fast3<f32>, _>(&CODES_3)
}
