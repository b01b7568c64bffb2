//! Output of `calibrate --explain` and `--bootstrap`.

use crate::common::{Bench, SIMULATE};

#[test]
fn calibrate_explains_itself_and_changes_nothing() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let calibrate = ["calibrate", "trace.csv", "--estimator", "ekf", "--branches", "2", "--until", "120"];
    bench.run(&[&calibrate[..], &["-o", "plain.toml"]].concat()).ok();
    let explain = |seed: &str, output: &str| {
        let flags = ["--explain", "--bootstrap", "8", "--seed", seed, "-o", output];
        bench.run(&[&calibrate[..], &flags[..]].concat()).ok()
    };
    // The last lines name the file, and how long it took.
    let explain = |seed: &str, output: &str| {
        let printed = explain(seed, output);
        printed[..printed.find("Written").unwrap()].to_owned()
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
