//! Every estimator from the command line: calibrated, stored as the default, run and scored.

use crate::common::{Bench, Csv, SIMULATE};
use serde_json::Value;

/// A minute of calibration is little to learn from, but enough to see that everything is connected.
const CALIBRATED_UNTIL: &str = "60";

fn calibrated_for(estimator: &str) -> Bench {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let calibrate = ["calibrate", "trace.csv", "--until", CALIBRATED_UNTIL, "-o", "sensor.toml"];
    bench.run(&[&calibrate[..], &["--estimator", estimator]].concat()).ok();
    bench
}

/// Filters with the sensor file's default and with the estimator by name, which must agree. Phases are known, and sum to one,
/// if and only if the estimator has them.
fn check(estimator: &str, has_phases: bool) {
    let bench = calibrated_for(estimator);
    // An R₀ that adapts to the readings has adapted by their end only in the filter, and only the filter takes a second look
    // after a downweighted reading.
    let calibrated = ["--sensor", "sensor.toml", "--rest-resistance", "calibrated", "--influence", "none"];
    let filter = [&["filter", "trace.csv"][..], &calibrated].concat();
    let printed = bench.run(&filter).ok();
    assert_eq!(bench.run(&[&filter[..], &["--estimator", estimator]].concat()).ok(), printed);
    let estimates = Csv::new(&printed);
    if has_phases {
        let phases = ["p_extend", "p_hold", "p_retract"].map(|column| estimates.numbers(column));
        for k in 0..estimates.len() {
            let sum: f64 = phases.iter().map(|phase| phase[k]).sum();
            assert!((sum - 1.0).abs() < 1e-9, "row {k}: {sum}");
        }
    } else {
        assert!(estimates.cells("p_extend").iter().all(|cell| cell.is_empty()));
    }
    let json = bench.run(&["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", "60", "--json"]).ok();
    let evaluation: Value = serde_json::from_str(&json).unwrap();
    let scores = &evaluation["recordings"][0];
    assert_eq!(scores["estimator"], estimator);
    assert!(scores["rmse_percent_fs"].as_f64().unwrap() < 100.0);
    let smoothed = Csv::new(&bench.run(&[&["smooth", "trace.csv"][..], &calibrated].concat()).ok());
    // At the last row smoother and filter use the same readings; they differ only in the calibrated factor of the deviation.
    let last = |estimates: &Csv| *estimates.numbers("strain").last().unwrap();
    assert!((last(&smoothed) - last(&estimates)).abs() < 1e-9);
    let lagged = bench.run(&[&filter[..], &["--lag-s", "0.5"]].concat()).ok();
    check_lag(&Csv::new(&lagged), &estimates, &smoothed);
    bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "--estimator", "ekf"]).ok();
}

/// Checks that every row is there, in order, and that at the end the lagged estimates equal the smoother's: both have used all
/// readings.
fn check_lag(lagged: &Csv, filtered: &Csv, smoothed: &Csv) {
    assert_eq!(lagged.cells("time_s"), filtered.cells("time_s"));
    let (lagged, filtered, smoothed) =
        (lagged.numbers("strain"), filtered.numbers("strain"), smoothed.numbers("strain"));
    let rows = lagged.len();
    // The last half second: 3 rows at 5 Hz.
    for k in rows - 3..rows {
        assert!((lagged[k] - smoothed[k]).abs() < 1e-9, "row {k}");
    }
    assert!((0..rows).any(|k| lagged[k] != filtered[k]));
}

#[test]
fn ukf() {
    check("ukf", false);
}

#[test]
fn imm() {
    check("imm", true);
}

#[test]
fn sign_split() {
    check("sign-split", true);
}

#[test]
fn hypotheses() {
    check("hypotheses", true);
}

#[test]
fn what_was_not_calibrated_is_refused() {
    let bench = Bench::calibrated();
    let run = |arguments: &[&str]| bench.run(&[arguments, &["--sensor", "sensor.toml"]].concat());
    run(&["filter", "trace.csv", "--estimator", "imm"])
        .fails(4, "sensor.toml: the sensor file has no parameters for `imm`; calibrate with `imm` as the estimator");
    assert_eq!(run(&["filter", "trace.csv", "--estimator", "nonsense"]).code, Some(2));
}
