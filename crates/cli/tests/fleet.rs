//! Priors learned from sensors of one make for the next sensor.

use std::sync::OnceLock;

use crate::common::Bench;
use serde_json::Value;

const SIMULATE: [&str; 10] = [
    "simulate",
    "--material",
    "representative",
    "--protocol",
    "mixed",
    "--speed-mm-s",
    "5",
    "--sample-rate-hz",
    "10",
    "--mismatched",
];
const CALIBRATED_S: &str = "150";

/// Returns sensors 1 to 4 of a make, calibrated on 150 s, their prior, and a recording of the ninth sensor, made once.
fn fleet() -> Bench {
    static FILES: OnceLock<Vec<(String, String)>> = OnceLock::new();
    Bench::with(FILES.get_or_init(|| {
        let bench = Bench::new();
        for sensor in ["1", "2", "3", "4", "9"] {
            let trace = format!("{sensor}.csv");
            bench.run(&[&SIMULATE[..], &["--individual", sensor, "--seed", sensor, "-o", &trace]].concat()).ok();
            if sensor != "9" {
                calibrate(&bench, &trace, CALIBRATED_S, &format!("{sensor}.toml"), &[]);
            }
        }
        bench.run(&["-q", "fleet", "fit", "1.toml", "2.toml", "3.toml", "4.toml", "-o", "prior.toml"]).ok();
        bench.contents()
    }))
}

fn calibrate(bench: &Bench, trace: &str, until_s: &str, sensor: &str, flags: &[&str]) {
    let words = ["-q", "calibrate", trace, "--until", until_s, "--estimator", "ekf", "-o", sensor];
    bench.run(&[&words[..], flags].concat()).ok();
}

/// Returns the error after the calibration, percent of the range, and the interval's coverage.
fn score(bench: &Bench, sensor: &str) -> (f64, f64) {
    let words = ["evaluate", "9.csv", "--sensor", sensor, "--from", CALIBRATED_S, "--json"];
    let scores: Value = serde_json::from_str(&bench.run(&words).ok()).unwrap();
    let of = |name: &str| scores["recordings"][0][name].as_f64().unwrap();
    (of("rmse_percent_fs"), of("coverage_95"))
}

/// A short motion is enough with a prior. On twelve other sensors, 10 s with a prior from 30 sensors gave 0.37 of the error
/// without it, in the median; here the prior is from four.
#[test]
fn a_short_motion_is_enough_with_a_prior() {
    let bench = fleet();
    let refit = ["-q", "fleet", "fit", "1.toml", "2.toml", "3.toml", "4.toml", "-o", "again.toml"];
    bench.run(&refit).ok();
    assert_eq!(bench.read("again.toml"), bench.read("prior.toml"));
    calibrate(&bench, "9.csv", "10", "alone.toml", &[]);
    calibrate(&bench, "9.csv", "10", "taught.toml", &["--prior", "prior.toml"]);
    let ((alone, _), (taught, covered)) = (score(&bench, "alone.toml"), score(&bench, "taught.toml"));
    assert!(taught < 0.6 * alone, "{taught} {alone}");
    assert!(covered > 0.8, "{covered}");
    let (of_make, own): (toml::Table, toml::Table) =
        (toml::from_str(&bench.read("prior.toml")).unwrap(), toml::from_str(&bench.read("taught.toml")).unwrap());
    let first = &own["law"]["branches"][0]["tau_s"];
    assert!((first.as_float().unwrap() / of_make["law"]["tau_s"][0].as_float().unwrap() - 1.0).abs() < 1e-12);
    // Strains beyond those of the ten seconds are within the range of the make's law.
    assert!(own["limits"]["upper"].as_float().unwrap() >= of_make["validity"]["upper"].as_float().unwrap());
}

/// A prior has no effect on a sensor of another make that was recorded for as long as the sensors of the prior.
#[test]
fn a_long_motion_stands_for_itself() {
    let bench = fleet();
    let other =
        ["simulate", "--material", "ecoflex-00-50", "--protocol", "mixed", "--sample-rate-hz", "10", "-o", "other.csv"];
    bench.run(&other).ok();
    calibrate(&bench, "other.csv", CALIBRATED_S, "alone.toml", &[]);
    calibrate(&bench, "other.csv", CALIBRATED_S, "taught.toml", &["--prior", "prior.toml"]);
    assert_eq!(bench.read("taught.toml"), bench.read("alone.toml"));
}

/// Each sensor of a batch is calibrated as by the command alone; another prior means another job.
#[test]
fn a_batch_learns_from_a_prior() {
    let bench = fleet();
    std::fs::create_dir(bench.path("rig")).unwrap();
    bench.write("rig/9.csv", bench.read("9.csv"));
    bench.write("rig/manifest.csv", "file,sensor,prior\n9.csv,listed,../prior.toml\n");
    bench.write("rig/bad.csv", "time_s,resistance_ohm,strain\n0,1600,0\n");
    let flags = ["--until", "20", "--estimator", "ekf"];
    calibrate(&bench, "9.csv", "20", "single.toml", &["--prior", "prior.toml"]);
    let batch = ["-q", "batch", "calibrate", "-o", "out", "--summary", "json"];
    let taught = [&batch[..], &["rig/9.csv", "rig/bad.csv", "--"], &flags, &["--prior", "prior.toml"]].concat();
    let state = |words: &[&str], code: i32| {
        let run = bench.run(words);
        assert_eq!(run.code, Some(code), "{}: {}", run.command, run.stderr);
        let rows: Value = serde_json::from_str(&bench.read("out/summary.json")).unwrap();
        (rows[0]["state"].as_str().unwrap().to_owned(), rows[0]["prior_sha256"].as_str().map(str::to_owned))
    };
    let (made, of_prior) = state(&taught, 5);
    assert_eq!(made, "done");
    assert_eq!(bench.read("out/9.toml"), bench.read("single.toml"));
    assert!(!bench.read("out/batch.jsonl").contains(".batch-"), "what is said of a draft names the output");
    assert_eq!(state(&taught, 5), ("kept".to_owned(), of_prior.clone()));
    bench.run(&["-q", "fleet", "fit", "1.toml", "2.toml", "3.toml", "-o", "prior.toml", "--force"]).ok();
    let (redone, of_another) = state(&taught, 5);
    assert_eq!(redone, "done");
    assert!(of_another.is_some() && of_another != of_prior);
    // A prior in a manifest is relative to the manifest, as recordings are.
    state(&[&batch[..], &["--manifest", "rig/manifest.csv", "--"], &flags].concat(), 0);
    assert_eq!(bench.read("out/listed.toml"), bench.read("out/9.toml"));
    // A file that is not a prior fails each job, and cannot be an output.
    bench.write("none.toml", "format = 4\n");
    assert_eq!(state(&[&batch[..], &["rig/9.csv", "--", "--prior", "none.toml"]].concat(), 5).0, "failed");
    std::fs::create_dir(bench.path("out2")).unwrap();
    bench.write("out2/9.toml", bench.read("prior.toml"));
    let onto = ["-q", "batch", "calibrate", "rig/9.csv", "-o", "out2", "--force", "--", "--prior", "out2/9.toml"];
    let run = bench.run(&onto);
    assert!(run.code == Some(2) && run.stderr.contains("it is an input"), "{}", run.stderr);
}

#[test]
fn what_is_no_fleet_is_refused() {
    let bench = Bench::calibrated();
    bench.write("two.toml", bench.read("sensor.toml"));
    let refused = |words: &[&str], code: i32, text: &str| {
        let run = bench.run(words);
        assert_eq!(run.code, Some(code), "{}: {}", run.command, run.stderr);
        assert!(run.stderr.contains(text), "{}: {}", run.command, run.stderr);
        assert!(!bench.path("out.toml").exists());
    };
    refused(&["fleet", "fit", "sensor.toml", "two.toml", "-o", "out.toml"], 4, "2 sensors; a fleet has at least 3");
    bench.write("angle.toml", bench.read("sensor.toml").replace("quantity = \"strain\"", "quantity = \"angle_deg\""));
    let mixed = "angle.toml: expected a sensor of `strain`, as sensor.toml is one, found one of `angle_deg`";
    refused(&["fleet", "fit", "sensor.toml", "two.toml", "angle.toml", "-o", "out.toml"], 4, mixed);
    refused(&["fleet", "fit", "trace.csv", "-o", "out.toml"], 4, "is a recording");
    let calibrate = ["calibrate", "trace.csv", "-o", "out.toml", "--prior"];
    refused(&[&calibrate[..], &["sensor.toml"]].concat(), 4, "field `format`: expected version 2, found 9");
    refused(&[&calibrate[..], &["missing.toml"]].concat(), 1, "cannot read");
    refused(&[&calibrate[..], &["sensor.toml", "--branches", "1"]].concat(), 2, "--branches");
    let three = ["fleet", "fit", "sensor.toml", "two.toml", "sensor.toml", "-o"];
    bench.run(&[&["-q"][..], &three, &["prior.toml"]].concat()).ok();
    // A sensor is not replaced by a prior.
    bench.write("other.toml", bench.read("sensor.toml"));
    let run = bench.run(&[&three[..], &["other.toml"]].concat());
    assert_ne!(run.code, Some(0), "{}", run.stdout);
    bench.write("prior.toml", bench.read("prior.toml").replace("quantity = \"strain\"", "quantity = \"angle_deg\""));
    refused(&[&calibrate[..], &["prior.toml"]].concat(), 4, "the prior is of angle_deg, the recordings are of strain");
}
