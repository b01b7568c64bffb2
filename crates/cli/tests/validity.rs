//! Warnings about a sensor file used outside its calibrated range.

use crate::common::{Bench, CALIBRATED_UNTIL, Csv, change_rows};

/// Returns a folder with `trace.csv` and a sensor calibrated on its first rows, `seen.csv`.
fn calibrated() -> Bench {
    let bench = Bench::calibrated();
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
fn a_longer_recording_is_warned_of_once_where_readings_drifted() {
    let bench = calibrated();
    let sensor = bench.read("sensor.toml");
    let with = |drifts: &str| sensor.replace("drifts = true", drifts).replace("drifts = false", drifts);
    // Five rows a second: the first row more than a twentieth beyond the calibration's 299.8 s.
    let expected = "ohmstrain: warning: trace.csv: at 314.8 s: longer than the 299.8 s of the calibration, in which readings \
                    drifted; estimates are extrapolations\n";
    for (drifts, expected) in [("drifts = true", &[expected][..]), ("drifts = false", &[])] {
        bench.write("sensor.toml", with(drifts));
        for command in [&["filter"][..], &["smooth"], &["evaluate"], &["filter", "--lag-s", "1"]] {
            let mut warnings = warned(&bench, &[command, &["trace.csv"]].concat());
            warnings.retain(|line| line.contains("longer"));
            assert_eq!(warnings, expected);
        }
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
    // The filter has no reference, and accepts readings that are larger in proportion to R₀.
    let rest: f64 =
        bench.read("sensor.toml").lines().find_map(|line| line.strip_prefix("measured_rest = ")?.parse().ok()).unwrap();
    assert_eq!(warned(&bench, &["filter", "scaled.csv"]).len(), warnings.len() - 1);
    let smoothed = warned(&bench, &["smooth", "scaled.csv"]);
    assert_eq!(smoothed.iter().filter(|line| line.contains(": resistance_ohm is outside of")).count(), 1);
    assert_eq!(warned(&bench, &["filter", "scaled.csv", "--rest-resistance", &(2.0 * rest).to_string()]), [""; 0]);
}

/// Rates up to 1.3 times the fastest cause no warning, and higher ones in one row of a hundred count as chance. Twice the speed
/// was never seen in calibration.
#[test]
fn twice_the_speed_is_warned_of_and_the_speed_of_the_calibration_is_not() {
    let bench = Bench::calibrated();
    let estimates = Csv::new(&bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).stdout);
    let mut rates: Vec<f64> = estimates.numbers("strain_rate").into_iter().map(f64::abs).collect();
    rates.sort_by(f64::total_cmp);
    // One row in two hundred, of two thousand, is faster than 1.3 times `most`.
    let most = rates[rates.len() * 995 / 1000] / 1.3;
    let warned = |fastest: f64| {
        let is_fastest = |line: &str| line.starts_with("fastest_rate_per_s");
        let line =
            |line: &str| if is_fastest(line) { format!("fastest_rate_per_s = {fastest:e}") } else { line.to_owned() };
        let text: String = bench.read("sensor.toml").lines().map(|old| line(old) + "\n").collect();
        bench.write("other.toml", text);
        let run = bench.run(&["filter", "trace.csv", "--sensor", "other.toml"]);
        run.warnings.iter().any(|line| line.contains("changes faster"))
    };
    assert!(!warned(most) && warned(0.5 * most));
}

#[test]
fn a_faster_movement_is_warned_of() {
    let bench = calibrated();
    // A sensor whose calibration states a slower speed.
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
