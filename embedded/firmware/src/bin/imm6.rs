//! Interacting multiple models, six states each, at a fixed rate.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use ohmstrain_firmware::{CODES_6, Imm6, frame};

#[entry]
fn main() -> ! {
    frame::run::<Imm6<f32>, _>(&CODES_6)
}
