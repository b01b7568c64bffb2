//! Agreement of a board with this computer: the exported sketch, compiled for this computer with a stand-in for Arduino.

use std::process::Command;

use crate::common::Bench;
use crate::export::{DT_S, compilers};

const PLOTTER: &str = "c/examples/ohmstrain_plotter/ohmstrain_plotter.ino";

/// Returns the output of a calibrated sensor's sketch, after a change of the sketch.
fn printed(bench: &Bench, change: impl Fn(&str) -> String) -> Option<String> {
    bench.run(&["export", "--sensor", "sensor.toml", "--dt-s", DT_S, "--target", "c", "-o", "c", "--force"]).ok();
    bench.write(PLOTTER, change(&bench.read(PLOTTER)));
    printed_by(bench, PLOTTER)
}

/// Returns the output of an exported sketch on a computer.
fn printed_by(bench: &Bench, sketch: &str) -> Option<String> {
    let arduino = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/exported-c");
    let compiler = compilers().first().map(|c| if *c == "gcc" { "g++" } else { "clang++" })?;
    let board = format!("{arduino}/board.cpp");
    let flags =
        ["-std=gnu++11", "-O2", "-ffp-contract=off", "-DOHMSTRAIN_CHECK=1", "-I", arduino, "-include", "Arduino.h"];
    let sources = ["-I", "c/src", "-x", "c++", sketch, "c/src/ohmstrain.c", &board];
    let compiled = Command::new(compiler)
        .current_dir(bench.path(""))
        .args(flags)
        .args(sources)
        .args(["-lm", "-o", "board"])
        .output();
    let compiled = compiled.unwrap();
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let run = Command::new(bench.path("board")).output().unwrap();
    assert!(run.status.success());
    Some(String::from_utf8(run.stdout).unwrap())
}

/// Returns the same output with one number replaced everywhere.
fn with(printed: &str, label: &str, number: &str) -> String {
    let cell = |cell: &str| if cell.starts_with(label) { format!("{label}{number}") } else { cell.to_owned() };
    let line = |line: &str| line.split(',').map(cell).collect::<Vec<_>>().join(",") + "\n";
    printed.lines().map(line).collect()
}

const CHECK: [&str; 7] = ["serial-check", "--sensor", "sensor.toml", "--port", "board.txt", "--dt-s", DT_S];

#[test]
fn a_board_agrees_until_it_runs_something_else() {
    let bench = Bench::calibrated_by_default();
    let Some(printed) = printed(&bench, str::to_owned) else { return };
    bench.write("board.txt", &printed);
    let output = bench.run(&CHECK).ok();
    let steps = printed.matches("step:").count();
    assert!(steps > 500 && output.starts_with(&format!("{steps} steps, 1 other lines\n")), "{output}");
    assert!(output.ends_with("\nThe board computes what this computer does.\n"), "{output}");
    // Another estimator than the board's, other intervals than its own, and other flags.
    let wrong = |what: &str, args: &[&str], message: &str| {
        let run = bench.run(args);
        assert!(run.code == Some(3) && run.stderr.contains(message), "{what}: {}", run.stderr);
    };
    wrong("estimator", &[&CHECK[..], &["--estimator", "ekf"]].concat(), "on the board; was it exported");
    bench.write("board.txt", with(&printed, "us:", "100000"));
    wrong("times", &CHECK, "on the board; was it exported");
    bench.write("board.txt", with(&printed, "flags:", "0"));
    wrong("flags", &CHECK, &format!(" of {steps} steps: other flags on the board"));
}

/// A filter that refuses every tenth step.
const REFUSES: &str = r#"#include "ohmstrain.h"
static ohmstrain_status now_and_then(ohmstrain_state *state, float dt_s, float reading, float sd, ohmstrain_residual *out) {
  static int steps = 0;
  return ++steps % 10 ? ohmstrain_step_after(state, dt_s, reading, sd, out) : OHMSTRAIN_ERR_STATE;
}
"#;

/// The sketch reports it and continues: the next step includes the time of the refused one.
#[test]
fn a_sketch_goes_on_after_a_refused_step() {
    let bench = Bench::calibrated();
    let change = |sketch: &str| {
        let sketch = sketch.replace("ohmstrain_step_after(&state", "now_and_then(&state");
        assert!(sketch.contains("now_and_then(&state"));
        sketch.replace("#include \"ohmstrain.h\"\n", REFUSES)
    };
    let Some(printed) = printed(&bench, change) else { return };
    bench.write("board.txt", &printed);
    let (steps, refused) = (printed.matches("step:").count(), printed.matches("ohmstrain_step_after: -4").count());
    assert!(refused > 50 && (steps + 1) / 9 >= refused && steps / 10 < refused, "{steps} {refused}");
    let output = bench.run(&CHECK).ok();
    assert!(output.starts_with(&format!("{steps} steps, {} other lines\n", 1 + refused)), "{output}");
}

#[test]
fn lost_and_missing_lines_are_reported() {
    let bench = Bench::calibrated();
    let line =
        |step: u32| format!("step:{step},us:200000,ohm:1700.0000,strain:0.01000,lo:0.00000,hi:0.02000,flags:0\n");
    for (lines, message) in [
        (line(0) + &line(1) + &line(3), "expected step 2, found step 3: lines were lost; send fewer, or faster"),
        (line(57) + &line(58), "expected step 0 first, found step 57: reset the board while it is listened to"),
        (
            "strain:0.01,lo:0.0,hi:0.02\n".into(),
            "expected lines like step:0,us:50000,ohm:1600.0000,reading_sd:4.000000,strain:0.10000,lo:0.08000,hi:0.12000,flags:0, \
             found none in 1; is OHMSTRAIN_CHECK 1 in the sketch?",
        ),
    ] {
        bench.write("board.txt", &lines);
        bench.run(&CHECK).fails(4, &format!("board.txt: {message}"));
    }
}

/// The recorder prints a trace of converter codes that every command reads, including `import`.
#[test]
fn what_the_recorder_prints_is_a_trace() {
    let bench = Bench::calibrated();
    bench.run(&["export", "--sensor", "sensor.toml", "--target", "c", "-o", "c", "--force"]).ok();
    let Some(printed) = printed_by(&bench, "c/examples/recorder/recorder.ino") else { return };
    // The board's own message at its start does not belong to it.
    let (_, trace) = printed.split_once('\n').unwrap();
    assert!(trace.starts_with("# front_end = divider reference_ohm=10000.0 side=low bits=10 noise_codes="), "{trace}");
    assert!(trace.contains("\ntime_us,adc\r\n"), "{trace}");
    bench.write("recorded.csv", trace);
    let args = ["filter", "recorded.csv", "--sensor", "sensor.toml"];
    let estimates = bench.run(&args).ok();
    // A header, and a row for each reading.
    assert_eq!(estimates.lines().count(), trace.lines().count() - 1);
    assert_eq!(bench.run(&["import", "recorded.csv", "-o", "imported.csv"]).code, Some(0));
    assert!(bench.read("imported.csv").contains("side=low"));
}

/// The command in the exported README is one that works.
#[test]
fn the_exported_command_names_the_estimator() {
    let bench = Bench::calibrated();
    for (flags, command) in [
        (&[][..], "serial-check --sensor sensor.toml --dt-s "),
        (&["--estimator", "static-cubic"], "serial-check --sensor sensor.toml --estimator static-cubic --dt-s "),
    ] {
        let export = ["export", "--sensor", "sensor.toml", "--dt-s", DT_S, "--target", "c", "-o", "c", "--force"];
        bench.run(&[&export[..], flags].concat()).ok();
        assert!(bench.read("c/README.md").contains(command), "{}", bench.read("c/README.md"));
    }
}
