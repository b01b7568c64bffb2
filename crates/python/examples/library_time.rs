//! Processor time of the Rust library alone on a recording, to compare Python, Spark and Ray with: `scripts/overhead.py`.
//!
//! ```sh
//! cargo run --release --example library_time -- sensor.toml ekf recording.f64 20
//! ```
//! Smooths recordings of a file one after the other: each is a number of rows (8 bytes, little endian), the times, s, and the
//! readings, Ω, as 8-byte floats. Prints seconds and the sum of the strains, so that the work cannot be left out, a line per
//! repetition.

use std::error::Error;
use std::fs;
use std::time::Instant;

use ohmstrain::{EstimatorKind, Sensor};

/// Times and readings.
type Rows = (Vec<f64>, Vec<f64>);

fn main() -> Result<(), Box<dyn Error>> {
    let [sensor, estimator, rows, repetitions] = &std::env::args().skip(1).collect::<Vec<_>>()[..] else {
        return Err("expected SENSOR ESTIMATOR ROWS REPETITIONS".into());
    };
    let kind = EstimatorKind::ALL.into_iter().find(|kind| kind.name() == estimator).ok_or("no such estimator")?;
    let sensor = Sensor::from_toml_for(&fs::read_to_string(sensor)?, kind)?;
    let recordings = recordings(&fs::read(rows)?);
    for _ in 0..repetitions.parse::<usize>()? {
        let start = processor_s()?;
        let mut sum = 0.0;
        for (time_s, readings) in &recordings {
            let estimates = sensor.filter().estimator(kind).smooth(time_s, readings)?;
            sum += estimates.iter().map(|row| row.strain).sum::<f64>();
        }
        println!("{:.6} {sum:?}", processor_s()? - start);
    }
    Ok(())
}

fn recordings(bytes: &[u8]) -> Vec<Rows> {
    let mut words = bytes.as_chunks::<8>().0.iter();
    let mut recordings = Vec::new();
    while let Some(rows) = words.next() {
        let rows = u64::from_le_bytes(*rows) as usize;
        let mut column = || words.by_ref().take(rows).map(|word| f64::from_le_bytes(*word)).collect();
        recordings.push((column(), column()));
    }
    recordings
}

/// Time that this thread, the only one, has had of a processor, s; of the clock where the system does not say.
fn processor_s() -> Result<f64, Box<dyn Error>> {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    match fs::read_to_string("/proc/self/schedstat") {
        Ok(text) => Ok(text.split_whitespace().next().ok_or("no time")?.parse::<f64>()? / 1e9),
        Err(_) => Ok(START.elapsed().as_secs_f64()),
    }
}
