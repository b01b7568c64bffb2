//! Strain from readings as they arrive: one resistance in ohms per line of standard input, at a fixed rate.
//!
//! ```sh
//! printf '1600\n1632\n\n1680\n' | cargo run --release -p ohmstrain --example live -- crates/ohmstrain/examples/sensor.toml
//! ```
//!
//! The filter lives in a thread of its own; an empty line is a missing reading.

use std::error::Error;
use std::io::{self, BufRead};
use std::sync::mpsc;
use std::{env, fs, thread};

use ohmstrain::Sensor;

/// Time between readings, s.
const STEP_S: f64 = 0.05;

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("expected the name of a sensor file")?;
    let sensor = Sensor::from_toml(&fs::read_to_string(&path)?).map_err(|error| error.in_file(&path))?;
    let mut filter = sensor.filter().gate(10.8).build()?;

    let (readings, arriving) = mpsc::channel::<Option<f64>>();
    let estimating = thread::spawn(move || -> Result<(), ohmstrain::Error> {
        for (k, ohm) in (0_u32..).zip(arriving) {
            let e = filter.step(STEP_S * f64::from(k), ohm)?;
            println!("{:.2} s: {:.3} ± {:.3} {}", e.time_s, e.strain, e.strain_sd, e.flags);
        }
        Ok(())
    });
    for line in io::stdin().lock().lines() {
        if readings.send(line?.trim().parse().ok()).is_err() {
            break;
        }
    }
    drop(readings);
    estimating.join().map_err(|_| "the filter's thread has panicked")??;
    Ok(())
}
