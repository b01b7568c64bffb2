//! The C library, called as C calls it, and by a program that a C compiler has made.

mod calls;
mod program;

/// Sensor of the examples.
pub const SENSOR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/sensor.toml");

/// Rows at 20 Hz: time, s, and reading, Ω; every ninth reading is missing.
pub fn rows() -> Vec<(f64, f64)> {
    let row = |k: u32| {
        let time_s = 0.05 * f64::from(k);
        let reading = if k % 9 == 8 { f64::NAN } else { 1700.0 + 90.0 * (0.7 * time_s).sin() };
        (time_s, reading)
    };
    (0..200).map(row).collect()
}
