//! What the filters make of faults. Prints `docs/faults.md`:
//!
//! ```text
//! cargo run --release -p ohmstrain-tests --example faults > docs/faults.md
//! ```

use std::error::Error;

use ohmstrain::{EstimatorKind, Sensor};
use ohmstrain_tests::sweep::{CASES, SENSOR, recordings, row};

fn main() -> Result<(), Box<dyn Error>> {
    let (sensor, traces) = (Sensor::from_toml(SENSOR)?, recordings()?);
    println!("{}", include_str!("faults.md").trim_end());
    println!(
        "\n| fault | filter | before | during | first 5 s after | later | flagged | silent | back in 5 s | slowest, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for case in &CASES {
        for kind in [EstimatorKind::Corrected, EstimatorKind::Ekf] {
            println!("{}", row(&sensor, kind, case, &traces));
        }
    }
    Ok(())
}
