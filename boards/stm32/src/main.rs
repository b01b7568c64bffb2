//! Strain on a Nucleo-F411RE: a sensor in a divider at A0, strain and its 95 % interval for a serial plotter at 115 200 baud.
//!
//! `sensor.rs` is what `ohmstrain export --target rust` writes of a calibrated sensor.
#![no_std]
#![no_main]

#[rustfmt::skip]
mod sensor;

use core::convert::Infallible;
use core::fmt::Write;

use embassy_executor::Spawner;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::usart::{Config, UartTx};
use embassy_time::{Duration, Instant, Ticker};
use heapless::String;
use panic_halt as _;

/// Resistor between the supply and the sensor, ohm; the sensor stands between A0 and ground.
const SERIES_OHM: f32 = 10_000.0;
/// Codes of the converter, whose reference is the divider's supply.
const FULL_SCALE: f32 = 4095.0;

#[embassy_executor::main]
async fn main(_spawner: Spawner) -> ! {
    let board = embassy_stm32::init(embassy_stm32::Config::default());
    let mut adc = Adc::new(board.ADC1);
    let mut pin = board.PA0;
    let mut serial = UartTx::new_blocking(board.USART2, board.PA2, Config::default()).ok();
    let read = || {
        let code = f32::from(adc.blocking_read(&mut pin, SampleTime::CYCLES480));
        // An open circuit divides by zero: no reading of this sensor, and not taken for one.
        SERIES_OHM * code / (FULL_SCALE - code)
    };
    let mut print = |text: &str| {
        if let Some(serial) = &mut serial {
            // A line that is lost is the next one's business.
            let _ = serial.blocking_write(text.as_bytes());
        }
    };
    let Err(fault) = run(read, &mut print).await;
    print(fault);
    loop {
        cortex_m::asm::wfi();
    }
}

/// Reads, filters and prints, for ever, unless the filter refuses its numbers.
async fn run(mut read: impl FnMut() -> f32, mut print: impl FnMut(&str)) -> Result<Infallible, &'static str> {
    let mut filter = sensor::filter().map_err(|_| "the sensor's numbers are refused\r\n")?;
    let mut ticker = Ticker::every(Duration::from_micros((sensor::DT_S * 1e6) as u64));
    loop {
        ticker.next().await;
        let begun = Instant::now();
        let strain = filter.step(read()).map_err(|_| "a step is refused\r\n")?.strain;
        let half_width = 1.96 * strain.sd();
        let (low, high) = (strain.mean - half_width, strain.mean + half_width);
        let mut line: String<96> = String::new();
        let took_us = begun.elapsed().as_micros();
        // Longer than the line it cannot be.
        let _ = writeln!(line, "strain:{:.5},lo:{low:.5},hi:{high:.5},us:{took_us}\r", strain.mean);
        print(&line);
    }
}
