//! Harness that runs a filter on the target and measures it. All results are little-endian words on the host's standard output:
//! formatting numbers would add code, and panics, that do not belong to the filter.
//!
//! Words: number of codes; instructions of all steps, of the most expensive step, of the conversion of all codes; worst stack
//! of a step, bytes; size of the state, bytes; number of refused readings; then the strain after every reading as `f32` bits.

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m::peripheral::{SYST, syst::SystClkSource};
use cortex_m::register::msp;
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::hio;
use ohmstrain_ekf::Reading;

use crate::{Filter, front_end, to_reading};

/// Instructions per tick of the system timer: QEMU counts one nanosecond per instruction (`-icount shift=0`), the board's
/// timer has 25 MHz.
const PER_TICK: u32 = 40;

/// Number of repetitions of a step; with as many as a tick has instructions, the count is exact to one instruction.
const REPEATS: u32 = PER_TICK;

/// Bytes of stack that are observed.
const WATCHED: u32 = 24 * 1024;
const PAINT: u32 = 0x5AFE_C0DE;

/// Runs the code under test alone, in one symbol that the disassembly contains.
#[inline(never)]
pub fn filter_step<F: Filter<f32>>(filter: &mut F, reading: Reading<f32>) -> bool {
    filter.step(reading)
}

/// Runs a filter over recorded codes, reports the results, and ends the program.
pub fn run<F: Filter<f32>, const K: usize>(codes: &[u16; K]) -> ! {
    match measure::<F, K>(codes) {
        Some(()) => debug::exit(EXIT_SUCCESS),
        None => debug::exit(EXIT_FAILURE),
    }
    halt()
}

fn measure<F: Filter<f32>, const K: usize>(codes: &[u16; K]) -> Option<()> {
    let mut timer = cortex_m::Peripherals::take()?.SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(0x00FF_FFFF);
    timer.clear_current();
    timer.enable_counter();

    let divider = black_box(front_end::<f32>().ok()?);
    let mut readings = [Reading { value: 0.0, extra_variance: 0.0 }; K];
    let start = SYST::get_current();
    for (reading, code) in readings.iter_mut().zip(black_box(codes)) {
        *reading = to_reading(&divider, u32::from(*code))?;
    }
    let conversion = since(start);

    let fresh = F::start().ok()?;
    let all_steps = all_steps(fresh, &readings);
    let dearest = dearest_step(fresh, &readings);
    let stack = worst_stack(fresh, &readings);

    let mut refused = 0;
    let mut strains = [0; K];
    let mut filter = fresh;
    for (strain, reading) in strains.iter_mut().zip(&readings) {
        refused += u32::from(!filter_step(&mut filter, *reading));
        *strain = filter.strain().to_bits();
    }
    let counts = [K as u32, all_steps, dearest, conversion, stack, F::state_bytes() as u32, refused];
    let mut out = hio::hstdout().ok()?;
    for word in counts.iter().chain(&strains) {
        out.write_all(&word.to_le_bytes()).ok()?;
    }
    Some(())
}

/// Counts the instructions of one pass over the readings, loop included.
#[inline(never)]
fn all_steps<F: Filter<f32>>(mut filter: F, readings: &[Reading<f32>]) -> u32 {
    let start = SYST::get_current();
    for reading in readings {
        black_box(filter_step(&mut filter, *reading));
    }
    since(start)
}

/// Counts the instructions of the most expensive step, without those for copying the filter back to its state before the step.
#[inline(never)]
fn dearest_step<F: Filter<f32>>(mut filter: F, readings: &[Reading<f32>]) -> u32 {
    let mut dearest = 0;
    for reading in readings {
        let before = filter;
        let copies = repeated(|| copy(&before, &mut filter));
        let steps = repeated(|| {
            copy(&before, &mut filter);
            black_box(filter_step(&mut filter, *reading));
        });
        dearest = dearest.max(steps.saturating_sub(copies));
    }
    dearest
}

/// Copies a filter; never inlined, so that it costs the same everywhere.
#[inline(never)]
fn copy<F: Copy>(from: &F, to: &mut F) {
    *to = black_box(*from);
}

/// Counts the instructions of one of many equal calls.
#[inline(always)]
fn repeated(mut action: impl FnMut()) -> u32 {
    let start = SYST::get_current();
    for _ in 0..REPEATS {
        action();
    }
    since(start) / REPEATS
}

/// Returns the number of instructions since the timer, which counts down, showed `start`.
fn since(start: u32) -> u32 {
    (start.wrapping_sub(SYST::get_current()) & 0x00FF_FFFF) * PER_TICK
}

/// Returns the stack of a step, bytes, found by painting the stack below this function.
#[inline(never)]
fn worst_stack<F: Filter<f32>>(mut filter: F, readings: &[Reading<f32>]) -> u32 {
    let top = msp::read();
    let watched = (top - WATCHED..top).step_by(4);
    for address in watched.clone() {
        // SAFETY: below the stack pointer and above the statics (the linker script leaves more than WATCHED), so the memory is
        // unused.
        unsafe { core::ptr::write_volatile(address as *mut u32, PAINT) };
    }
    for reading in readings {
        black_box(filter_step(&mut filter, *reading));
    }
    // SAFETY: the same addresses.
    let untouched = watched.take_while(|address| unsafe { core::ptr::read_volatile(*address as *const u32) } == PAINT);
    WATCHED - 4 * untouched.count() as u32
}

fn halt() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}

/// Never linked: the check of the finished program refuses a reachable panic.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    debug::exit(EXIT_FAILURE);
    halt()
}
