//! The exported filter on a board of QEMU, over the readings of the self-test up to its rest. Reports words: readings, instructions of
//! all steps, bytes of the filter; then the bits of every strain.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::hio;
use exported::counted as sensor;

/// In the unit of the sensor, with their deviations; NaN where missing.
static READINGS: &[(f32, f32)] = include!("readings.rs");
const MOST: usize = 512;
/// The board's timer has 25 MHz, QEMU counts one nanosecond per instruction.
const PER_TICK: u32 = 40;

#[entry]
fn main() -> ! {
    debug::exit(if run().is_some() { EXIT_SUCCESS } else { EXIT_FAILURE });
    halt()
}

#[inline(never)]
fn step(filter: &mut sensor::Filter, (reading, sd): (f32, f32)) -> Option<f32> {
    let reading = (!reading.is_nan()).then(|| filter.relative(reading, sd));
    filter.step_after(sensor::DT_S, reading).ok().map(|now| now.strain.mean)
}

fn run() -> Option<()> {
    let mut timer = cortex_m::Peripherals::take()?.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(0x00FF_FFFF);
    timer.clear_current();
    timer.enable_counter();
    let mut filter = sensor::filter().ok()?;
    let (mut strains, mut instructions) = ([0; MOST], 0);
    for (place, reading) in strains.iter_mut().zip(READINGS) {
        let start = SYST::get_current();
        let strain = black_box(step(&mut filter, *black_box(reading)));
        instructions += (start.wrapping_sub(SYST::get_current()) & 0x00FF_FFFF) * PER_TICK;
        *place = strain?.to_bits();
    }
    let mut out = hio::hstdout().ok()?;
    let counts = [READINGS.len() as u32, instructions, size_of::<sensor::Filter>() as u32];
    for word in counts.iter().chain(strains.get(..READINGS.len())?) {
        out.write_all(&word.to_le_bytes()).ok()?;
    }
    Some(())
}

fn halt() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

/// Never linked: the script refuses a program that can reach a panic.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    debug::exit(EXIT_FAILURE);
    halt()
}
