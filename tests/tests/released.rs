//! Sensors of released versions are read for good, and give the estimates of that version; so does exported Rust with the releases that
//! its `Cargo.toml` accepts.

use std::fs;
use std::path::{Path, PathBuf};

use ohmstrain::{Error, Estimate, Sensor, TextCause};

/// Exported Rust of 0.2.0, which asks for `ohmstrain-ekf = "0.2.0"`.
#[path = "../released/0.2.0/rust/sensor.rs"]
mod exported_0_2;

/// Folders that `scripts/released.sh` has written. That of 0.1.0, whose files had no weights of the correction, has estimates of three rows.
fn released() -> Vec<PathBuf> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/released");
    let mut folders: Vec<PathBuf> = fs::read_dir(root).unwrap().map(|folder| folder.unwrap().path()).collect();
    folders.sort();
    folders
}

/// Numbers of a CSV file, row by row.
fn rows(file: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(file).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
}

/// Weights of 0.1.0 are learned anew, and those of 0.2.0 are kept with nine digits; weights of 200 rows, some of which are alike, are a
/// thousand times as large as what they say.
const TOLERANCE: f64 = 1e-6;
/// Range of the strain. Since these versions a smoother doubts a start in an unknown strain: its variance is larger, by at most the squared
/// range at the first row, which decays with 5 s. Near the end it is mixed with the filter, whose weight decays with 4 s: both strains are
/// within the range.
const RANGE: f64 = 1.0 / 3.0;

#[test]
fn a_released_sensor_reproduces_its_estimates() {
    assert!(released().len() >= 2);
    for folder in released() {
        let sensor = Sensor::from_toml(&fs::read_to_string(folder.join("sensor.toml")).unwrap()).unwrap();
        let readings = rows(&folder.join("readings.csv"));
        let (time_s, ohm): (Vec<f64>, Vec<f64>) = readings.iter().map(|row| (row[0], row[1])).unzip();
        let mut filter = sensor.filter().build().unwrap();
        let filtered: Vec<Estimate> = readings.iter().map(|row| filter.step(row[0], row[1]).unwrap()).collect();
        let smoothed = sensor.smooth(&time_s, &ohm).unwrap();
        for (estimates, file) in [(&filtered, "filter.csv"), (&smoothed, "smooth.csv")] {
            for row in rows(&folder.join(file)) {
                let estimate = &estimates[time_s.iter().position(|time_s| *time_s == row[0]).unwrap()];
                let apart = estimate.strain - row[1];
                let wider = estimate.strain_sd.powi(2) - row[2].powi(2);
                let of_start =
                    if file == "smooth.csv" { RANGE.powi(2) * (-(row[0] - time_s[0]) / 5.0).exp() } else { 0.0 };
                let end_s = time_s[time_s.len() - 1];
                let weight = if file == "smooth.csv" { ((row[0] - end_s) / 4.0).exp() } else { 0.0 };
                let tolerance = TOLERANCE + weight * RANGE.powi(2);
                assert!(apart.abs() < TOLERANCE + weight * RANGE, "{folder:?} {row:?}: {apart}");
                assert!((-tolerance..tolerance + of_start).contains(&wider), "{folder:?} {row:?}: {wider}");
            }
        }
        let written = sensor.to_toml().unwrap();
        assert!(written.starts_with("format = 9\n"));
        assert_eq!(Sensor::from_toml(&written).unwrap(), sensor);
    }
}

/// Errors in an old file are reported like those in a new one, and a version older still is refused.
#[test]
fn what_is_wrong_with_an_old_file_is_named() {
    let old = fs::read_to_string(released()[0].join("sensor.toml")).unwrap();
    let named = |text: &str| Sensor::from_toml(text).unwrap_err().in_file("s.toml");
    let negative = old.replacen("\nrest_reading = ", "\nrest_reading = -", 1);
    assert!(named(&negative).starts_with("s.toml:5: column 16: field `rest_reading`: expected 1e-12 to 1e12"));
    assert!(named("format = 8\n").contains("missing field `made_by`"));
    let Err(Error::Text(error)) = Sensor::from_toml("format = 7\n") else { panic!("format 7 is refused") };
    assert!(matches!(error.cause, TextCause::Format { expected: 9, found: 7 }));
}

/// Number of a definition in C, such as `#define NAME 280` or `enum { NAME = 300 };`.
fn defined(source: &str, name: &str) -> f64 {
    let after = source.lines().find_map(|line| line.split_once(&format!(" {name} "))).unwrap().1;
    let number: String = after.trim_start_matches("= ").chars().take_while(|c| !" }f".contains(*c)).collect();
    number.parse().unwrap()
}

/// Reading, its deviation, strain and its deviation in the vectors of an exported self-test.
fn vectors(source: &str) -> Vec<[f32; 4]> {
    let row = |line: &str| {
        let cells = line.strip_prefix("    {")?.strip_suffix("},")?.split(", ");
        let numbers: Vec<f32> = cells.map(|cell| cell.trim_end_matches('f').parse().unwrap()).collect();
        Some(numbers.try_into().unwrap())
    };
    source.lines().filter_map(row).collect()
}

/// The same sensor's C promises its own vectors to a number of ulp, whatever rounds otherwise; so must the Rust.
#[test]
fn exported_rust_of_a_release_passes_the_self_test_of_its_c() {
    let vectors_h = fs::read_to_string(released()[1].join("c/selftest/vectors.h")).unwrap();
    let tolerance = defined(&vectors_h, "VECTORS_TOLERANCE_ULP") * defined(&vectors_h, "VECTORS_ULP");
    let (rezeroed, rested) = (defined(&vectors_h, "REZEROED"), defined(&vectors_h, "RESTED_READING"));
    let rows = vectors(&vectors_h);
    assert!(rows.len() as f64 == defined(&vectors_h, "VECTORS") && rows.len() > 300);
    let mut filter = exported_0_2::filter().unwrap();
    for (k, [reading, reading_sd, strain, strain_sd]) in rows.into_iter().enumerate() {
        if k as f64 == rezeroed {
            filter.rezero(rested as f32).unwrap();
        }
        let reading = (!reading.is_nan()).then(|| filter.relative(reading, reading_sd));
        let now = filter.step_after(exported_0_2::DT_S, reading).unwrap();
        let apart = f64::from((now.strain.mean - strain).abs().max((now.strain.sd() - strain_sd).abs()));
        assert!(apart <= tolerance, "row {k}: {apart}, at most {tolerance}");
    }
}
