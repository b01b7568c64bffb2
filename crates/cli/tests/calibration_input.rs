//! Recordings that are partly, or wholly, wrong, in `calibrate`.

use crate::common::{Bench, Run, SIMULATE, change_rows};

/// Number of rows for calibration; the others are for the test.
const HALF: usize = 1000;
const UNTIL: &str = "200";
const EKF: [&str; 4] = ["--estimator", "ekf", "--branches", "1"];

/// A folder with `trace.csv`, a simulated recording of 400 s.
fn bench() -> Bench {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    bench
}

/// Calibrates on the first half of a recording.
fn calibrate(bench: &Bench, trace: &str, more: &[&str]) -> Run {
    calibrate_until(bench, trace, UNTIL, more)
}

/// Calibrates on the rows of a recording before a time, s.
fn calibrate_until(bench: &Bench, trace: &str, until: &str, more: &[&str]) -> Run {
    bench.run(&[&["calibrate", trace, "--until", until, "-o", "sensor.toml"], &EKF[..], more].concat())
}

/// Returns the error on the second half of `trace.csv`, %FS.
fn error_on_the_rest(bench: &Bench) -> f64 {
    let scores = bench.run(&["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", UNTIL, "--json"]).ok();
    let scores: serde_json::Value = serde_json::from_str(&scores).unwrap();
    scores["recordings"][0]["rmse_percent_fs"].as_f64().unwrap()
}

/// Returns the recording with one cell of one row changed.
fn spiked(bench: &Bench, row: usize, column: usize, factor: f64) -> String {
    change_rows(&bench.read("trace.csv"), |k, cells| {
        if k == row {
            cells[column] = (cells[column].parse::<f64>().unwrap() * factor).to_string();
        }
    })
}

#[test]
fn one_bad_row_is_named_and_changes_nothing() {
    let bench = bench();
    calibrate(&bench, "trace.csv", &[]).ok();
    let clean = error_on_the_rest(&bench);
    let strain_at = |row: usize| {
        let mut found = String::new();
        change_rows(&bench.read("trace.csv"), |k, cells| {
            if k == row {
                found.clone_from(&cells[2]);
            }
        });
        found.parse::<f64>().unwrap()
    };
    // A row at which a factor of 100 is a jump.
    let moved = (400..HALF).find(|&row| strain_at(row) > 0.2).unwrap();
    for (row, column, factor, what) in [(437, 1, 10.0, "reading"), (moved, 2, 100.0, "reference")] {
        bench.write("spiked.csv", spiked(&bench, row, column, factor));
        let run = calibrate(&bench, "spiked.csv", &["--explain"]);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let named = format!("spiked.csv: data row {} (", row + 1);
        assert!(run.stdout.lines().next().unwrap().starts_with(&named), "{}", run.stdout);
        let warning = run.warnings.first().unwrap();
        assert!(run.warnings.len() == 1 && warning.contains(&named) && warning.contains(what), "{:?}", run.warnings);
        // Numbers as they were recorded, without trailing zeros.
        assert!(!warning.contains("000 "), "{warning}");
        let error = error_on_the_rest(&bench);
        bench.write("missing.csv", spiked(&bench, row, column, f64::NAN));
        calibrate(&bench, "missing.csv", &[]).ok();
        assert_eq!(error, error_on_the_rest(&bench), "{what}: as if it were missing");
        // One row less in a thousand changes the result of the search by as much as two searches differ.
        assert!((error / clean - 1.0).abs() < 0.06, "{what}: {error} %FS instead of {clean}");
    }
}

#[test]
fn a_contact_that_fails_for_two_seconds_is_left_out() {
    let bench = bench();
    calibrate(&bench, "trace.csv", &[]).ok();
    let clean = error_on_the_rest(&bench);
    let failing = change_rows(&bench.read("trace.csv"), |k, cells| {
        if (500..510).contains(&k) {
            cells[1] = "90000".into();
        }
    });
    bench.write("failing.csv", failing);
    let run = calibrate(&bench, "failing.csv", &[]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    // Five rows by name, and the number of the others.
    assert!(run.warnings.len() == 6 && run.warnings[0].contains("data row 501 ("), "{:?}", run.warnings);
    assert!(run.warnings[5].contains("5 more rows"), "{:?}", run.warnings);
    let error = error_on_the_rest(&bench);
    // Ten rows of a thousand.
    assert!((error / clean - 1.0).abs() < 0.1, "{error} %FS instead of {clean}");
}

#[test]
fn readings_that_have_nothing_to_do_with_the_reference_are_refused() {
    let bench = bench();
    let random = change_rows(&bench.read("trace.csv"), |k, cells| {
        // Roughly uniform: fractional parts of multiples of the golden ratio, squared so that they do not repeat.
        cells[1] = (1500.0 + 300.0 * (k as f64 * k as f64 * 0.618_033_988_749_895).fract()).to_string();
    });
    bench.write("random.csv", random);
    // One extension, one hold and one release, played backwards.
    simulate_extend_hold(&bench, "once.csv");
    let once = bench.read("once.csv");
    let readings: Vec<&str> = once.lines().rev().filter_map(|line| line.split(',').nth(1)).collect();
    let backwards = change_rows(&once, |k, cells| cells[1] = readings[k].to_owned());
    bench.write("backwards.csv", backwards);
    for (name, until) in [("random.csv", UNTIL), ("backwards.csv", ONCE)] {
        let run = calibrate_until(&bench, name, until, &[]);
        assert_eq!(run.code, Some(4), "{}", run.stderr);
        let expected = format!("ohmstrain: {name}: the readings have nothing to do with");
        assert!(run.stderr.starts_with(&expected), "{}", run.stderr);
        assert!(!bench.files().contains(&"sensor.toml".to_owned()));
    }
}

/// Period of the published protocol, s.
const ONCE: &str = "171";

/// The published protocol with the published material: twice an extension, a hold and a release.
fn simulate_extend_hold(bench: &Bench, name: &str) {
    let of = ["--protocol", "extend-hold", "--material", "ecoflex-00-50", "--individual", "274", "--seed", "74"];
    bench.run(&[&["simulate", "--sample-rate-hz", "5", "-o", name][..], &of].concat()).ok();
}

/// A recording of one extension, one hold and one release has no two similar parts. Held-out parts are then uninformative, and
/// the fitted rows show that readings and reference belong together.
#[test]
fn one_extension_one_hold_and_one_release_calibrate() {
    let bench = bench();
    simulate_extend_hold(&bench, "once.csv");
    calibrate_until(&bench, "once.csv", ONCE, &[]).ok();
    assert!(bench.files().contains(&"sensor.toml".to_owned()));
}

/// Returns the recording with a column times a factor, and a metadata line.
fn in_unit(bench: &Bench, column: usize, factor: f64, line: &str) -> String {
    let changed = change_rows(&bench.read("trace.csv"), |_, cells| {
        cells[column] = (cells[column].parse::<f64>().unwrap() * factor).to_string();
    });
    format!("{line}{changed}")
}

#[test]
fn another_unit_is_asked_about_and_converted() {
    let bench = bench();
    calibrate(&bench, "trace.csv", &[]).ok();
    let plain = error_on_the_rest(&bench);
    // A thousand rounding errors change the result of the search by no more than its own resolution.
    let same = |bench: &Bench| (error_on_the_rest(bench) / plain - 1.0).abs() < 1e-3;
    let cases = [
        (2, 100.0, "strain=percent", "# strain_unit = percent\n"),
        (1, 0.001, "resistance=kohm", "# resistance_unit = kohm\n"),
    ];
    for (column, factor, unit, line) in cases {
        bench.write("other.csv", in_unit(&bench, column, factor, ""));
        let asked = calibrate(&bench, "other.csv", &[]);
        assert_eq!(asked.code, Some(4), "{}", asked.stderr);
        assert!(asked.stderr.contains(&format!("--unit {unit}")), "{}", asked.stderr);
        assert!(asked.stderr.contains(line.trim_end()), "{}", asked.stderr);
        calibrate(&bench, "other.csv", &["--unit", unit]).ok();
        assert!(same(&bench), "{unit}");
    }
    // A line above the header says it as well.
    let (column, factor, _, line) = cases[0];
    bench.write("said.csv", in_unit(&bench, column, factor, line));
    calibrate(&bench, "said.csv", &[]).ok();
    assert!(same(&bench), "{line}");
}

/// Readings and reference under each other's name are reported.
#[test]
fn exchanged_columns_are_reported() {
    let bench = bench();
    let exchanged = change_rows(&bench.read("trace.csv"), |_, cells| {
        // Zero strain would not be a valid resistance, and is refused as such.
        let strain = cells[2].parse::<f64>().unwrap().max(1e-3);
        (cells[1], cells[2]) = (strain.to_string(), cells[1].clone());
    });
    bench.write("exchanged.csv", exchanged);
    let run = calibrate(&bench, "exchanged.csv", &[]);
    assert_eq!(run.code, Some(4), "{}", run.stderr);
    assert!(run.stderr.contains("`resistance_ohm` and `strain` seem to be exchanged"), "{}", run.stderr);
}

#[test]
fn two_units_in_one_calibration_are_refused() {
    let bench = bench();
    // Small strains in percent look like fractions.
    let small = |factor: f64| {
        change_rows(&bench.read("trace.csv"), |_, cells| {
            cells[2] = (cells[2].parse::<f64>().unwrap() * factor).to_string();
        })
    };
    bench.write("fraction.csv", small(0.02));
    bench.write("percent.csv", small(2.0));
    let run = calibrate(&bench, "fraction.csv", &["percent.csv"]);
    assert_eq!(run.code, Some(4), "{}", run.stderr);
    let named = "ohmstrain: percent.csv and fraction.csv: ";
    assert!(run.stderr.starts_with(named) && run.stderr.contains("# strain_unit = percent"), "{}", run.stderr);

    bench.write("kohm.csv", in_unit(&bench, 1, 0.03, ""));
    let run = calibrate(&bench, "trace.csv", &["kohm.csv"]);
    assert_eq!(run.code, Some(4), "{}", run.stderr);
    assert!(run.stderr.contains("33 times as much") && run.stderr.contains("resistance_unit"), "{}", run.stderr);
}

#[test]
fn copies_and_other_sensors_are_mentioned() {
    let bench = bench();
    bench.write("copy.csv", bench.read("trace.csv"));
    bench.write("other.csv", in_unit(&bench, 1, 1.5, ""));
    let run = calibrate(&bench, "trace.csv", &["copy.csv", "other.csv"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.warnings[0].contains("copy.csv and trace.csv: the same rows: they count twice"), "{:?}", run.warnings);
    let rests = run.warnings.iter().find(|warning| warning.contains("R0 comes out as")).unwrap();
    assert!(rests.contains("50 % more: one sensor?"), "{rests}");
}

#[test]
fn a_late_reference_is_refused_or_moved() {
    let bench = bench();
    calibrate(&bench, "trace.csv", &[]).ok();
    let plain = error_on_the_rest(&bench);
    let strains: Vec<String> = {
        let mut strains = Vec::new();
        change_rows(&bench.read("trace.csv"), |_, cells| strains.push(cells[2].clone()));
        strains
    };
    // Ten rows are 2 s.
    let late = change_rows(&bench.read("trace.csv"), |k, cells| cells[2].clone_from(&strains[k.saturating_sub(10)]));
    bench.write("late.csv", late);
    let run = calibrate(&bench, "late.csv", &[]);
    assert_eq!(run.code, Some(4), "{}", run.stderr);
    let seconds = |text: &str, before: &str| -> f64 {
        let (_, rest) = text.split_once(before).unwrap_or_else(|| panic!("{before} in {text}"));
        rest.split_once(" ± ").unwrap().0.parse().unwrap()
    };
    // One row.
    assert!((seconds(&run.stderr, "seems to be ") - 2.0).abs() < 0.2, "{}", run.stderr);
    assert!(run.stderr.contains("late.csv: ") && run.stderr.contains(" s late"), "{}", run.stderr);
    // The same estimate everywhere; among several recordings the late one is named.
    let both = bench.run(&[&["calibrate", "trace.csv", "late.csv", "-o", "both.toml"], &EKF[..]].concat());
    assert!(both.code == Some(4) && both.stderr.contains("late.csv: expected a reference"), "{}", both.stderr);
    let inspected = bench.run(&["inspect", "late.csv", "--json"]).ok();
    let inspected: serde_json::Value = serde_json::from_str(&inspected).unwrap();
    let found = inspected["recording"]["reference_lag"]["seconds"].as_f64().unwrap();
    assert_eq!(format!("{found:.2}"), format!("{:.2}", seconds(&both.stderr, "seems to be ")));
    let run = calibrate(&bench, "late.csv", &["--align"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!((seconds(&run.warnings[0], "the reference is ") - 2.0).abs() < 0.2, "{:?}", run.warnings);
    // Aligned to a fraction of a row, it is no worse than before, within the difference of two searches.
    let moved = error_on_the_rest(&bench);
    assert!(moved < 1.1 * plain, "{moved} %FS instead of {plain}");
}

/// A few movements of 5 s to and fro. A reference that is 0.6 s early exceeds a tenth of a movement, but not three times the
/// 0.25 s that the sensor itself may lag: it causes a warning. One that is 1.5 s early is refused; one on time causes no
/// message.
#[test]
fn a_reference_that_may_be_early_is_warned_of() {
    let bench = Bench::new();
    let simulate = ["simulate", "--protocol", "extend-retract", "--speed-mm-s", "2", "--sample-rate-hz", "10"];
    bench.run(&[&simulate[..], &["-o", "trace.csv"]].concat()).ok();
    let mut strains: Vec<String> = Vec::new();
    change_rows(&bench.read("trace.csv"), |_, cells| strains.push(cells[2].clone()));
    let last = strains.len() - 1;
    for (name, rows) in [("early.csv", 6), ("earlier.csv", 15)] {
        let early = change_rows(&bench.read("trace.csv"), |k, cells| cells[2].clone_from(&strains[last.min(k + rows)]));
        bench.write(name, early);
    }
    let calibrate = |trace: &str, more: &[&str]| {
        bench.run(&[&["calibrate", trace, "-o", "sensor.toml", "--force"], &EKF[..], more].concat())
    };
    let of_the_reference = |trace: &str, more: &[&str]| {
        let run = calibrate(trace, more);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.warnings.into_iter().filter(|warning| warning.contains("the reference")).collect::<Vec<_>>()
    };
    assert!(of_the_reference("trace.csv", &[]).is_empty());
    let warned = of_the_reference("early.csv", &[]);
    assert!(warned.len() == 1 && warned[0].contains("early.csv: the reference seems to be 0.6"), "{warned:?}");
    assert!(warned[0].contains(" s early") && warned[0].contains("--align moves it"), "{warned:?}");
    let refused = calibrate("earlier.csv", &[]);
    assert!(refused.code == Some(4) && refused.stderr.contains("seems to be 1.5"), "{}", refused.stderr);
    let moved = of_the_reference("earlier.csv", &["--align"]);
    assert!(moved.len() == 1 && moved[0].contains("early; it was moved by that"), "{moved:?}");
}

/// A lag of two rows, 0.4 s, against movements of 7 s: too little for a refusal; it is reported with all other findings.
#[test]
fn a_reference_that_is_a_little_late_is_reported() {
    let bench = Bench::new();
    let simulate = ["simulate", "--protocol", "mixed", "--speed-mm-s", "2", "--sample-rate-hz", "5", "--mismatched"];
    bench.run(&[&simulate[..], &["-o", "trace.csv"]].concat()).ok();
    let mut strains: Vec<String> = Vec::new();
    change_rows(&bench.read("trace.csv"), |_, cells| strains.push(cells[2].clone()));
    let late = change_rows(&bench.read("trace.csv"), |k, cells| cells[2].clone_from(&strains[k.saturating_sub(2)]));
    bench.write("late.csv", late);
    let calibrate = |more: &[&str]| {
        let run = bench.run(&[&["calibrate", "late.csv", "-o", "sensor.toml"], &EKF[..], more].concat());
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.stderr
    };
    let remark = "late.csv: the reference seems to be 0.4";
    assert!(!calibrate(&[]).contains(remark));
    let verbose = calibrate(&["--verbose", "--force"]);
    assert!(verbose.contains(remark), "{verbose}");
}
