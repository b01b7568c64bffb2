//! Sweep of faults through the filters. Prints `docs/faults.md`:
//!
//! ```text
//! scripts/faults.sh > docs/faults.md
//! ```
//!
//! which compiles what `export` writes. Its arguments are those programs: `NAME=REPLAY`.

use std::error::Error;
use std::path::PathBuf;

use ohmstrain::{EstimatorKind, Sensor};
use ohmstrain_tests::faults::replayed;
use ohmstrain_tests::sweep::{CASES, Run, SENSOR, of_library, recordings, row};

/// A program that cannot be run has nothing to say of a recording.
fn of_program(program: PathBuf) -> Run<'static> {
    Box::new(move |trace| {
        replayed(&program, trace).unwrap_or_else(|error| {
            eprintln!("{error}");
            Vec::new()
        })
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let (sensor, traces) = (Sensor::from_toml(SENSOR)?, recordings()?);
    let mut filters = vec![
        ("default".to_owned(), of_library(&sensor, EstimatorKind::Corrected)),
        ("EKF".to_owned(), of_library(&sensor, EstimatorKind::Ekf)),
    ];
    for argument in std::env::args().skip(1) {
        let (name, program) = argument.split_once('=').ok_or("expected NAME=REPLAY")?;
        filters.push((name.to_owned(), of_program(program.into())));
    }
    println!("{}", include_str!("faults.md").trim_end());
    println!(
        "\n| fault | filter | before | during | first 5 s after | later | flagged | silent | back in 5 s | slowest, s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for case in &CASES {
        for (name, run) in &filters {
            println!("{}", row(name, run, case, &traces));
        }
    }
    Ok(())
}
