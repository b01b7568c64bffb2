//! Strain on an ESP32-C3: a sensor in a divider at GPIO2, strain and its 95 % interval for a serial plotter at 115 200 baud.
//!
//! `sensor.rs` is what `ohmstrain export --target rust` writes of a calibrated sensor.
#![no_std]
#![no_main]

#[rustfmt::skip]
mod sensor;

use core::convert::Infallible;
use core::fmt::Write;

use esp_hal::analog::adc::{Adc, AdcCalCurve, AdcConfig, Attenuation};
use esp_hal::peripherals::ADC1;
use esp_hal::time::{Duration, Instant};
use esp_hal::uart::{Config, UartTx};
use panic_halt as _;

/// Resistor between the supply and the sensor, ohm; the sensor stands between GPIO2 and ground.
const SERIES_OHM: f32 = 10_000.0;
/// Supply of the divider, mV. Above 2500 the converter saturates: the resistor is to be larger than a third of the sensor.
const SUPPLY_MV: f32 = 3300.0;

esp_bootloader_esp_idf::esp_app_desc!();

#[esp_hal::main]
fn main() -> ! {
    let board = esp_hal::init(esp_hal::Config::default());
    let mut config = AdcConfig::new();
    let mut pin = config.enable_pin_with_cal::<_, AdcCalCurve<ADC1>>(board.GPIO2, Attenuation::_11dB);
    let mut adc = Adc::new(board.ADC1, config);
    let mut serial = UartTx::new(board.UART0, Config::default()).ok().map(|serial| serial.with_tx(board.GPIO21));
    let read = || {
        let at_pin = nb::block!(adc.read_oneshot(&mut pin)).map_or(f32::NAN, f32::from);
        // An open circuit divides by zero, or nearly so: no reading of this sensor, and not taken for one.
        SERIES_OHM * at_pin / (SUPPLY_MV - at_pin)
    };
    let Err(fault) = run(read, &mut serial);
    if let Some(serial) = &mut serial {
        // A line that is lost is nobody's business any more.
        let _ = serial.write_str(fault);
    }
    loop {}
}

/// Reads, filters and prints, for ever, unless the filter refuses its numbers.
fn run(mut read: impl FnMut() -> f32, serial: &mut Option<impl Write>) -> Result<Infallible, &'static str> {
    let mut filter = sensor::filter().map_err(|_| "the sensor's numbers are refused\r\n")?;
    let interval = Duration::from_micros((sensor::DT_S * 1e6) as u64);
    let mut due = Instant::now();
    loop {
        due += interval;
        while Instant::now() < due {}
        let begun = Instant::now();
        let strain = filter.step(read()).map_err(|_| "a step is refused\r\n")?.strain;
        let half_width = 1.96 * strain.sd();
        let (low, high) = (strain.mean - half_width, strain.mean + half_width);
        let took_us = begun.elapsed().as_micros();
        if let Some(serial) = serial {
            // A line that is lost is the next one's business.
            let _ = write!(serial, "strain:{:.5},lo:{low:.5},hi:{high:.5},us:{took_us}\r\n", strain.mean);
        }
    }
}
