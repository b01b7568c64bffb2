//! Four hypotheses split by the sign of the rate, six states each, at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, SplitFour, frame};

#[entry]
fn main() -> ! {
    frame::run::<SplitFour<f32>, _>(&CODES_6)
}
