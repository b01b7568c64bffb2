//! What `calibrate` says at its end.

use crate::common::{Bench, SIMULATE};
use serde_json::Value;

/// At most ten lines, none wider than a terminal, with every heading.
#[test]
fn a_calibration_ends_in_ten_lines() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    for estimator in ["corrected", "ekf"] {
        let flags = [
            "calibrate",
            "trace.csv",
            "--until",
            "150",
            "--branches",
            "1",
            "-o",
            "sensor.toml",
            "--estimator",
            estimator,
        ];
        let printed = bench.run(&flags).ok();
        assert!(printed.lines().count() <= 10, "{printed}");
        assert!(printed.lines().all(|line| line.chars().count() <= 100), "{printed}");
        for head in ["Verdict", "Left out", "Seen", "Limited by", "Record next", "Written"] {
            assert!(printed.lines().any(|line| line.starts_with(head)), "{head}: {printed}");
        }
        assert!(printed.contains(&format!("sensor.toml, estimator {estimator}, ")), "{printed}");
    }
}

/// The error on quarters left out is near the one on rows that the calibration never had.
#[test]
fn json_says_what_the_error_elsewhere_is() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let json = |flags: &[&str]| -> Value { serde_json::from_str(&bench.run(flags).ok()).unwrap() };
    let closing = json(&["calibrate", "trace.csv", "--until", "300", "--branches", "1", "-o", "sensor.toml", "--json"]);
    let number = |value: &Value| value.as_f64().unwrap();
    let left_out = &closing["left_out"];
    assert_eq!(closing["schema"], 1);
    assert_eq!(closing["estimator"], "corrected");
    let (filter, smoother) = (number(&left_out["filter"]["rmse"]), number(&left_out["smoother"]["rmse"]));
    let unseen = json(&["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", "300", "--json"]);
    let unseen = number(&unseen["recordings"][0]["rmse"]);
    let cubic = number(&left_out["static_cubic"]["rmse"]);
    assert!(smoother < filter && filter < cubic, "{smoother} {filter} {cubic}");
    // A hundred seconds with some ten movements scatter: a factor of two to either side.
    assert!((0.5..2.0).contains(&(filter / unseen)), "{filter} {unseen}");
    assert_eq!(left_out["seen"]["tenths"].as_array().unwrap().len(), 10);
    let rows: f64 = left_out["seen"]["tenths"].as_array().unwrap().iter().map(number).sum();
    assert!((rows - 1.0).abs() < 1e-9);
}
