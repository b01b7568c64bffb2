//! Files and arguments that do not suit the sensor: a question that contains its answer instead of an estimate.

use crate::common::{Bench, CALIBRATED_UNTIL, Csv, change_rows};
use serde_json::Value;

const SENSOR: [&str; 2] = ["--sensor", "sensor.toml"];

/// Returns the recording with its readings, or its strains in the last column, times a factor.
fn scaled(bench: &Bench, column: usize, factor: f64) -> String {
    change_rows(&bench.read("trace.csv"), |_, cells| {
        cells[column] = (factor * cells[column].parse::<f64>().unwrap()).to_string();
    })
}

fn rest_reading(bench: &Bench) -> f64 {
    let sensor: toml::Table = toml::from_str(&bench.read("sensor.toml")).unwrap();
    sensor.get("measured_rest").unwrap_or(&sensor["rest_reading"]).as_float().unwrap()
}

#[track_caller]
fn asks(bench: &Bench, arguments: &[&str], code: i32, start: &str, question: &str) {
    let run = bench.run(&[arguments, &SENSOR].concat());
    assert_eq!(run.code, Some(code), "{}: {}", run.command, run.stderr);
    // At most a header.
    assert!(run.stdout.lines().count() <= 1, "{}: {}", run.command, run.stdout);
    assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
    assert!(run.stderr.starts_with(&format!("ohmstrain: {start}")), "{}", run.stderr);
    assert!(run.stderr.contains(question), "{}", run.stderr);
}

#[test]
fn readings_in_another_unit_are_asked_about() {
    let bench = Bench::calibrated();
    let header = 1 + bench.read("trace.csv").lines().position(|line| line.starts_with("time_s")).unwrap();
    let start = format!("other.csv:{header}: column `resistance_ohm`: expected readings of ");
    for (factor, question) in
        [(1e-3, "in kilo-ohms?"), (1e-6, "in mega-ohms?"), (1e3, "is the calibration in kilo-ohms?")]
    {
        bench.write("other.csv", scaled(&bench, 1, factor));
        for command in [&["filter"][..], &["smooth"], &["evaluate"], &["refine", "-o", "new.toml"]] {
            asks(&bench, &[command, &["other.csv"]].concat(), 4, &start, question);
        }
    }
    assert!(!bench.path("new.toml").exists());
    // Ratios to some resistance at rest.
    bench.write("other.csv", scaled(&bench, 1, 1.0 / rest_reading(&bench)));
    asks(&bench, &["filter", "other.csv"], 4, &start, "are they in kilo-ohms?");
}

/// An R0 in another unit, or of another sensor, from any source.
#[test]
fn a_rest_resistance_of_no_such_sensor_is_refused() {
    let bench = Bench::calibrated();
    let rest = rest_reading(&bench);
    bench.write("other.csv", scaled(&bench, 1, 9.0));
    for factor in [1e-3, 0.2, 5.0, 9.0, 1e3] {
        let given = (factor * rest).to_string();
        for command in [&["filter"][..], &["smooth"], &["evaluate"], &["refine", "-o", "new.toml"]] {
            let arguments = [command, &["trace.csv", "--rest-resistance", &given]].concat();
            asks(
                &bench,
                &arguments,
                2,
                "--rest-resistance: resistance at rest: expected ",
                "in the unit of the calibration's",
            );
        }
    }
    // The same holds for R0 from the first readings.
    for command in [&["filter"][..], &["smooth"], &["evaluate"], &["refine", "-o", "new.toml"]] {
        let arguments = [command, &["other.csv", "--rest-resistance", "first:5"]].concat();
        asks(&bench, &arguments, 4, "other.csv: --rest-resistance first:5: resistance at rest: expected ", "found 14");
    }
    assert!(!bench.path("new.toml").exists());
    let quarter = (0.26 * rest).to_string();
    let near = bench.run(&[&["filter", "trace.csv", "--rest-resistance", &quarter][..], &SENSOR].concat());
    assert_eq!(near.code, Some(0), "{}", near.stderr);
}

/// With the readings' unit, the estimates equal those of the recording in ohms.
#[test]
fn the_answer_is_the_unit() {
    let bench = Bench::calibrated();
    bench.write("other.csv", scaled(&bench, 1, 1e-3));
    for command in ["filter", "smooth"] {
        let strains = |arguments: &[&str]| {
            Csv::new(&bench.run(&[&[command], arguments, &SENSOR].concat()).ok()).numbers("strain")
        };
        let calibrated = ["--rest-resistance", "calibrated"];
        let in_ohm = strains(&[&["trace.csv"][..], &calibrated].concat());
        let in_kohm = strains(&[&["other.csv"][..], &calibrated, &["--unit", "resistance=kohm"]].concat());
        // Rounding of the scaled readings, 1e-16, times its amplification by a filter.
        assert!(in_ohm.iter().zip(&in_kohm).all(|(a, b)| (a - b).abs() < 1e-8), "{command}");
    }
}

/// A stream has a reader who waits for the rows: it continues, with a warning.
#[test]
fn a_live_stream_is_warned_of() {
    let bench = Bench::calibrated();
    let other = scaled(&bench, 1, 1e-3);
    let rows = other.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit())).count();
    let run = bench.feed(&[&["filter"][..], &SENSOR].concat(), other);
    let doubts = run.warnings.iter().filter(|line| line.contains("in kilo-ohms?")).count();
    assert_eq!((run.code, doubts), (Some(0), 1), "{:?}", run.warnings);
    assert_eq!(Csv::new(&run.stdout).len(), rows);
}

/// A plug that was not connected yet, and a sensor of another size, do not count as another unit.
#[test]
fn what_no_unit_explains_is_no_reason_to_stop() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    bench.write(
        "open.csv",
        change_rows(&trace, |row, cells| {
            if row < 150 {
                cells[1] = "1e9".into()
            }
        }),
    );
    bench.write("larger.csv", scaled(&bench, 1, 3.0));
    for file in ["open.csv", "larger.csv"] {
        for command in ["filter", "smooth"] {
            let run = bench.run(&[&[command, file][..], &SENSOR].concat());
            assert_eq!(run.code, Some(0), "{}: {}", run.command, run.stderr);
            let outside = run.warnings.iter().any(|line| line.contains("resistance_ohm is outside of"));
            assert!(outside, "{}: {:?}", run.command, run.warnings);
        }
    }
}

#[test]
fn a_reference_in_percent_is_asked_about() {
    let bench = Bench::calibrated();
    let percent = scaled(&bench, 2, 100.0);
    bench.write("other.csv", &percent);
    let header = 1 + percent.lines().position(|line| line.starts_with("time_s")).unwrap();
    let start = format!("other.csv:{header}: column `strain`: expected strains of up to 0.3333, as in the calibration");
    asks(&bench, &["evaluate", "other.csv"], 4, &start, "in percent?");
    // One bad row does not mean a wrong unit.
    let outlier = change_rows(&bench.read("trace.csv"), |row, cells| {
        if row == 700 {
            cells[2] = "30".into()
        }
    });
    bench.write("other.csv", outlier);
    bench.run(&[&["evaluate", "other.csv"][..], &SENSOR].concat()).ok();
}

#[test]
fn a_strain_to_start_at_lies_within_the_limits() {
    let bench = Bench::calibrated();
    for command in ["filter", "smooth"] {
        for far in ["10", "-0.1"] {
            let start = format!(
                "--initial-strain: expected 0 to 0.3333, the limits of the sensor's strain, found {far}; 10 % is 0.1\n"
            );
            asks(&bench, &[command, "trace.csv", "--initial-strain", far], 2, &start, "");
        }
        let near = bench.run(&[&[command, "trace.csv", "--initial-strain", "0.34"][..], &SENSOR].concat());
        let warned = near.warnings.iter().filter(|line| line.contains("--initial-strain: 0.34 is outside of")).count();
        assert_eq!((near.code, warned), (Some(0), 1), "{}", near.stderr);
    }
}

/// A sensor with a fifth more resistance and a known reading at rest has the scores of the calibrated one; so have the
/// baselines.
#[test]
fn evaluate_takes_a_rest_resistance_as_filter_does() {
    let bench = Bench::calibrated();
    bench.write("larger.csv", scaled(&bench, 1, 1.2));
    let rmse = |arguments: &[&str]| {
        let printed =
            bench.run(&[&["evaluate", "--json", "--from", CALIBRATED_UNTIL], arguments, &SENSOR].concat()).ok();
        let scores = serde_json::from_str::<Value>(&printed).unwrap()["recordings"][0].clone();
        [&scores["rmse"], &scores["smoother"]["rmse"], &scores["baselines"]["static_cubic"]["rmse"]]
            .map(|rmse| rmse.as_f64().unwrap())
    };
    let expected = rmse(&["trace.csv", "--rest-resistance", "calibrated"]);
    let alike = |found: [f64; 3]| found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-8);
    let rest = (1.2 * rest_reading(&bench)).to_string();
    assert!(alike(rmse(&["larger.csv", "--rest-resistance", &rest])));
    assert!(!alike(rmse(&["larger.csv"])));
    // Whatever the first reading is, that of the other recording is a fifth larger.
    let of_first = rmse(&["trace.csv", "--rest-resistance", "first:1"]);
    let larger = rmse(&["larger.csv", "--rest-resistance", "first:1"]);
    assert!(of_first.iter().zip(&larger).all(|(a, b)| (a - b).abs() < 1e-8));
}
