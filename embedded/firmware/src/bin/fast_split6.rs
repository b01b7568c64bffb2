//! Sparse sign-split filter of four hypotheses with six states, at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, FastSplit6, frame};

#[entry]
fn main() -> ! {
    frame::run::<FastSplit6<f32>, _>(&CODES_6)
}
