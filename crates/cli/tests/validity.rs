//! Warnings where a sensor file is used outside of what its calibration has seen.

use crate::common::{Bench, CALIBRATED_UNTIL, SIMULATE, change_rows};

/// `trace.csv` and a sensor calibrated on its first rows, `seen.csv`.
fn calibrated() -> Bench {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    bench.run(&["calibrate", "trace.csv", "--until", CALIBRATED_UNTIL, "--estimator", "ekf", "-o", "sensor.toml"]).ok();
    let until: f64 = CALIBRATED_UNTIL.parse().unwrap();
    let is_seen = |line: &&str| {
        let time_s = line.split(',').next().unwrap().parse::<f64>();
        time_s.map_or(true, |time_s| time_s < until)
    };
    let seen: String = bench.read("trace.csv").lines().filter(is_seen).map(|line| format!("{line}\n")).collect();
    bench.write("seen.csv", seen);
    bench
}

#[track_caller]
fn warned(bench: &Bench, arguments: &[&str]) -> Vec<String> {
    let run = bench.run(&[arguments, &["--sensor", "sensor.toml"]].concat());
    let warnings = run.warnings.clone();
    run.ok();
    warnings
}

#[test]
fn the_calibration_itself_is_within_it() {
    let bench = calibrated();
    for command in ["filter", "smooth", "evaluate"] {
        assert_eq!(warned(&bench, &[command, "seen.csv"]), [""; 0]);
    }
}

#[test]
fn a_longer_recording_is_warned_of_once() {
    let bench = calibrated();
    for command in [&["filter"][..], &["smooth"], &["evaluate"], &["filter", "--lag-s", "1"]] {
        let mut warnings = warned(&bench, &[command, &["trace.csv"]].concat());
        warnings.retain(|line| line.contains("longer"));
        // Five rows a second: the first one left out is as long after the first as the calibration and 0.2 s more.
        let expected = "ohmstrain: warning: trace.csv: at 300 s: longer than the 299.8 s of the calibration; estimates are \
                        extrapolations\n";
        assert_eq!(warnings, [expected]);
    }
}

#[test]
fn readings_and_strains_that_calibration_has_not_seen_are_warned_of() {
    let bench = calibrated();
    let scaled = change_rows(&bench.read("seen.csv"), |_, cells| {
        for (cell, factor) in [(1, 2.0), (2, 1.5)] {
            cells[cell] = (factor * cells[cell].parse::<f64>().unwrap()).to_string();
        }
    });
    bench.write("scaled.csv", scaled);
    let warnings = warned(&bench, &["evaluate", "scaled.csv"]);
    let of = |what: &str| warnings.iter().filter(|line| line.contains(what)).count();
    assert_eq!((of(": resistance_ohm is outside of"), of(": strain is outside of")), (1, 1), "{warnings:?}");
    // The filter has no reference, and no objection to readings if R₀ is as much larger.
    let rest: f64 =
        bench.read("sensor.toml").lines().find_map(|line| line.strip_prefix("measured_rest = ")?.parse().ok()).unwrap();
    assert_eq!(warned(&bench, &["filter", "scaled.csv"]).len(), warnings.len() - 1);
    let smoothed = warned(&bench, &["smooth", "scaled.csv"]);
    assert_eq!(smoothed.iter().filter(|line| line.contains(": resistance_ohm is outside of")).count(), 1);
    assert_eq!(warned(&bench, &["filter", "scaled.csv", "--rest-resistance", &(2.0 * rest).to_string()]), [""; 0]);
}

#[test]
fn a_faster_movement_is_warned_of() {
    let bench = calibrated();
    // A sensor whose calibration was slower, by its own word.
    let slow: String = bench
        .read("sensor.toml")
        .lines()
        .map(|line| {
            if line.starts_with("fastest_rate_per_s") {
                "fastest_rate_per_s = 1e-4\n".into()
            } else {
                format!("{line}\n")
            }
        })
        .collect();
    bench.write("sensor.toml", slow);
    for command in ["filter", "smooth", "evaluate"] {
        let warnings = warned(&bench, &[command, "seen.csv"]);
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].contains("strain changes faster than the calibration's 0.0001 per second"), "{warnings:?}");
    }
}
