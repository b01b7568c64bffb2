//! Summary at the end of `calibrate`.

use crate::common::{Bench, CALIBRATED_UNTIL, SIMULATE, change_rows, first_rows};
use serde_json::Value;

/// A recording that only extends counts as one stroke. Without the factor, the deviation that covers 95 % of the held-out rows is at most
/// √20/1.96 = 2.28 times their RMSE: 5 % of the rows have that error or a larger one.
#[test]
fn intervals_of_a_single_extension_are_wide() {
    let bench = Bench::new();
    let steps = ["--protocol", "load-steps", "--speed-mm-s", "2", "--sample-rate-hz", "5"];
    bench.run(&[&["simulate", "-o", "steps.csv"], &steps[..]].concat()).ok();
    // The first half, which ends in a hold.
    bench.write("first.csv", first_rows(&bench.read("steps.csv"), 585));
    let calibrate = ["calibrate", "first.csv", "--estimator", "ekf", "--branches", "1", "-o", "sensor.toml", "--json"];
    let closing: Value = serde_json::from_str(&bench.run(&calibrate).ok()).unwrap();
    let rmse = closing["left_out"]["filter"]["rmse"].as_f64().unwrap();
    let sensor: toml::Table = toml::from_str(&bench.read("sensor.toml")).unwrap();
    let widened = sensor["unstated"]["filter_sd"].as_float().unwrap();
    assert!(widened > 20_f64.sqrt() / 1.96 * rmse, "{widened} {rmse}");
}

/// The summary has at most ten lines, none wider than a terminal, with every heading.
#[test]
fn a_calibration_ends_in_ten_lines() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    for estimator in ["corrected", "ekf"] {
        let flags = [
            "calibrate",
            "trace.csv",
            "--until",
            "60",
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
        // Shares of the error, the largest first.
        let limited = printed.lines().find(|line| line.starts_with("Limited by")).unwrap();
        let shares: Vec<f64> = limited
            .split(" of MSE")
            .next()
            .unwrap()
            .split(", ")
            .map(|part| part.split_whitespace().rev().nth(1).unwrap().parse().unwrap())
            .collect();
        assert!(shares.len() == 4 && shares.is_sorted_by(|a, b| a >= b), "{limited}");
    }
}

/// The error on held-out quarters is near that on rows that the calibration never had.
#[test]
fn json_says_what_the_error_elsewhere_is() {
    let bench = Bench::calibrated_by_default();
    let json = |text: &str| -> Value { serde_json::from_str(text).unwrap() };
    let closing = json(&bench.read("closing.json"));
    let number = |value: &Value| value.as_f64().unwrap();
    let left_out = &closing["left_out"];
    assert_eq!(closing["schema"], 1);
    assert_eq!(closing["estimator"], "corrected");
    let (filter, smoother) = (number(&left_out["filter"]["rmse"]), number(&left_out["smoother"]["rmse"]));
    let evaluate = ["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", CALIBRATED_UNTIL, "--json"];
    let unseen = json(&bench.run(&evaluate).ok());
    let unseen = number(&unseen["recordings"][0]["rmse"]);
    let cubic = number(&left_out["static_cubic"]["rmse"]);
    assert!(smoother < filter && filter < cubic, "{smoother} {filter} {cubic}");
    // A hundred seconds with some ten movements vary by a factor of two to either side.
    assert!((0.5..2.0).contains(&(filter / unseen)), "{filter} {unseen}");
    assert_eq!(left_out["seen"]["tenths"].as_array().unwrap().len(), 10);
    let rows: f64 = left_out["seen"]["tenths"].as_array().unwrap().iter().map(number).sum();
    assert!((rows - 1.0).abs() < 1e-9);
    // The named limit is the one with the largest share.
    let shares = closing["error_shares"].as_object().unwrap();
    let largest = shares.iter().max_by(|a, b| number(a.1).total_cmp(&number(b.1))).unwrap().0;
    assert_eq!(closing["limited_by"].as_str(), Some(largest.as_str()));
    assert!((shares.values().map(number).sum::<f64>() - 1.0).abs() < 1e-12, "{shares:?}");
}

const CALIBRATE: [&str; 8] =
    ["calibrate", "trace.csv", "--until", CALIBRATED_UNTIL, "--estimator", "ekf", "-o", "sensor.toml"];

/// Rows that were kept from a calibration are scored as `evaluate` scores them, and count where they are worse.
#[test]
fn the_verdict_is_of_the_worst_that_is_known() {
    let worse = "Worse than a static curve";
    let until: f64 = CALIBRATED_UNTIL.parse().unwrap();
    // After the calibration the body does what the static cubic says, and the filter cannot be better than that.
    for changed in [false, true] {
        let bench = Bench::calibrated();
        let sensor: toml::Table = toml::from_str(&bench.read("sensor.toml")).unwrap();
        let cubic = &sensor["static_cubic"];
        let number = |value: &toml::Value| value.as_float().unwrap();
        let strain = |reading: f64| {
            let z = (reading - number(&cubic["reading_centre"])) / number(&cubic["reading_scale"]);
            let powers = cubic["coefficients"].as_array().unwrap().iter().rev();
            let strain = powers.fold(0.0, |sum, coefficient| sum * z + number(coefficient));
            strain.clamp(number(&cubic["range"]["lower"]), number(&cubic["range"]["upper"]))
        };
        let trace = change_rows(&bench.read("trace.csv"), |_, cells| {
            if changed && cells[0].parse::<f64>().unwrap() >= until {
                cells[2] = strain(cells[1].parse().unwrap()).to_string();
            }
        });
        bench.write("trace.csv", &trace);
        let run = |more: &str| bench.run(&[&CALIBRATE[..], &["--report", "report.html", more]].concat()).ok();
        // The bench has the summary of the unchanged recording; the same calibration says it in words.
        let (json, text) =
            if changed { (run("--json"), None) } else { (bench.read("closing.json"), Some(run("--explain"))) };
        let json: Value = serde_json::from_str(&json).unwrap();
        let tested = &json["tested"];
        let evaluate = ["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", CALIBRATED_UNTIL, "--json"];
        let evaluated = bench.run(&evaluate);
        let evaluated: Value = serde_json::from_str(&evaluated.stdout).unwrap();
        let evaluated = &evaluated["recordings"][0];
        for name in ["rmse", "n"] {
            assert_eq!(tested["filter"][name], evaluated[name], "{name}");
            assert_eq!(tested["static_cubic"][name], evaluated["baselines"]["static_cubic"][name], "{name}");
        }
        // What was missing in the test is in the sensor's intervals.
        let covered = |scores: &Value| scores["coverage_95"].as_f64().unwrap();
        assert!(covered(evaluated) >= covered(&tested["filter"]).max(0.95), "{tested} {evaluated}");
        assert_eq!(covered(&tested["filter"]) < 0.95, changed, "{tested}");
        let verdict = json["verdict"].as_str().unwrap();
        if let Some(text) = text {
            assert!(text.contains(&format!("Verdict      {verdict}\n")) && text.contains("\nTested       "), "{text}");
        }
        assert_eq!(verdict.starts_with(worse), changed, "{json}");
        assert_eq!(bench.read("report.html").contains(worse), changed);
    }
}

/// The reference fails for 40 s after the calibration, and is not interpolated.
#[test]
fn rows_without_a_reference_are_not_tested() {
    let bench = Bench::calibrated();
    let (mut known, until) = (0, CALIBRATED_UNTIL.parse::<f64>().unwrap());
    let gap = change_rows(&bench.read("trace.csv"), |_, cells| match cells[0].parse::<f64>().unwrap() {
        320.0..360.0 => cells[2].clear(),
        time_s => known += i32::from(time_s >= until),
    });
    bench.write("trace.csv", gap);
    let json: Value = serde_json::from_str(&bench.run(&[&CALIBRATE[..], &["--json"]].concat()).ok()).unwrap();
    assert_eq!(json["tested"]["filter"]["n"], known, "{json}");
}

/// A calibration on all rows has nothing to test on, and only held-out scores are printed.
#[test]
fn a_calibration_on_all_rows_is_tested_on_none() {
    let bench = Bench::calibrated();
    bench.write("first.csv", first_rows(&bench.read("trace.csv"), 400));
    let calibrate = ["calibrate", "first.csv", "--estimator", "ekf", "--branches", "1", "-o", "sensor.toml", "--json"];
    let json: Value = serde_json::from_str(&bench.run(&calibrate).ok()).unwrap();
    assert!(json["tested"].is_null() && json["left_out"]["seen"]["rows"] == 400, "{json}");
}

/// The sensor's file says what it is worth.
#[test]
fn the_sensor_keeps_a_summary() {
    let bench = Bench::calibrated();
    let json: Value = serde_json::from_str(&bench.read("closing.json")).unwrap();
    let sensor: toml::Table = toml::from_str(&bench.read("sensor.toml")).unwrap();
    let (summary, left_out) = (&sensor["summary"], &json["left_out"]);
    for (name, expected) in [
        ("left_out_percent_fs", &left_out["filter"]["rmse_percent_fs"]),
        ("smoothed_percent_fs", &left_out["smoother"]["rmse_percent_fs"]),
        ("static_cubic_percent_fs", &left_out["static_cubic"]["rmse_percent_fs"]),
        ("width_95_percent_fs", &left_out["filter"]["width_95_percent_fs"]),
    ] {
        assert_eq!(summary[name].as_float(), expected.as_f64(), "{name}");
    }
    // A share that was read from text, and then multiplied, may be rounded otherwise.
    let covered = 100.0 * left_out["filter"]["coverage_95"].as_f64().unwrap();
    assert!((summary["coverage_95_percent"].as_float().unwrap() - covered).abs() < 1e-12);
    assert_eq!(summary["limited_by"].as_str(), json["limited_by"].as_str());
}
