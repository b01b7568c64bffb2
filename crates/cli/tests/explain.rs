//! What `calibrate --explain` and `--bootstrap` print.

#[allow(dead_code, reason = "each test program uses its own share")]
mod common;

use common::{Bench, SIMULATE};

#[test]
fn calibrate_explains_itself_and_changes_nothing() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let calibrate = ["calibrate", "trace.csv", "--estimator", "ekf", "--until", "120"];
    assert_eq!(bench.run(&[&calibrate[..], &["-o", "plain.toml"]].concat()).ok(), "");
    let explain = |seed: &str, output: &str| {
        let flags = ["--explain", "--bootstrap", "8", "--seed", seed, "-o", output];
        bench.run(&[&calibrate[..], &flags[..]].concat()).ok()
    };
    let printed = explain("1", "explained.toml");
    assert_eq!(bench.read("plain.toml"), bench.read("explained.toml"));
    for words in
        ["what to record next", "condition number", "rest_reading", "tunnelling", "97.5 %", "branches[1].tau_s"]
    {
        assert!(printed.contains(words), "{words}: {printed}");
    }
    assert_eq!(printed, explain("1", "again.toml"));
    assert_ne!(printed, explain("2", "other.toml"));
}
