//! Sparse IMM filter with six states per model, at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, FastImm6, frame};

#[entry]
fn main() -> ! {
    frame::run::<FastImm6<f32>, _>(&CODES_6)
}
