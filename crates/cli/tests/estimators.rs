//! Every estimator from the command line: calibrated, stored as the default, run, scored.

#[allow(dead_code, reason = "each test program uses its own share")]
mod common;

use common::{Bench, Csv, SIMULATE};
use serde_json::Value;

/// A minute of calibration is little to learn from, and enough to see that everything is wired.
const CALIBRATED_UNTIL: &str = "60";

fn calibrated_for(estimator: &str) -> Bench {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let calibrate = ["calibrate", "trace.csv", "--until", CALIBRATED_UNTIL, "-o", "sensor.toml"];
    bench.run(&[&calibrate[..], &["--estimator", estimator]].concat()).ok();
    bench
}

/// Filters with the sensor file's choice and with the estimator by name: the same. Phases are known, and sum to one, if
/// and only if the estimator has them.
fn check(estimator: &str, has_phases: bool) {
    let bench = calibrated_for(estimator);
    let filter = ["filter", "trace.csv", "--sensor", "sensor.toml"];
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
    // Everything smooths: with its own smoother, or with the extended Kalman filter that is always calibrated.
    bench.run(&["smooth", "trace.csv", "--sensor", "sensor.toml"]).ok();
    bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "--estimator", "ekf"]).ok();
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
fn what_was_not_calibrated_or_cannot_smooth_is_refused() {
    let bench = Bench::calibrated();
    let run = |arguments: &[&str]| bench.run(&[arguments, &["--sensor", "sensor.toml"]].concat());
    run(&["filter", "trace.csv", "--estimator", "imm"])
        .fails(4, "sensor.toml: the sensor file has no parameters for `imm`");
    let message = "--estimator: `imm` has no smoother, use ekf or ukf";
    run(&["smooth", "trace.csv", "--estimator", "imm"]).fails(2, message);
    assert_eq!(run(&["filter", "trace.csv", "--estimator", "nonsense"]).code, Some(2));
}
