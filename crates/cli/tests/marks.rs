//! `calibrate --marks`: strains known at marks, in place of a reference.

use crate::common::{Bench, Csv, first_rows};

/// Readings of the first half of the bench's recording, without its reference.
fn without_reference(bench: &Bench) -> Csv {
    let trace = Csv::new(&first_rows(&bench.read("trace.csv"), 1000));
    let rows = trace.cells("time_s").into_iter().zip(trace.cells("resistance_ohm"));
    let rows: String = rows.map(|(time_s, ohm)| format!("{time_s},{ohm}\n")).collect();
    bench.write("readings.csv", format!("time_s,resistance_ohm\n{rows}"));
    trace
}

/// Returns the extreme strains of the recording that are far enough from the previous one, as a person would note them.
fn turning_points(trace: &Csv) -> String {
    let (time_s, strain) = (trace.numbers("time_s"), trace.numbers("strain"));
    let span = strain.iter().fold(0.0, |most: f64, x| most.max(*x));
    let mut marks = vec![0];
    for k in 1..strain.len() - 1 {
        let turns = (strain[k] - strain[k - 1]) * (strain[k + 1] - strain[k]) <= 0.0;
        if turns && (strain[k] - strain[marks[marks.len() - 1]]).abs() > 0.1 * span {
            marks.push(k);
        }
    }
    let lines = marks.iter().map(|&k| format!("{},{}\n", time_s[k], strain[k]));
    format!("time_s,strain\n{}", lines.collect::<String>())
}

#[test]
fn marks_make_a_sensor() {
    let bench = Bench::calibrated();
    let trace = without_reference(&bench);
    bench.write("marks.csv", turning_points(&trace));
    let calibrate = ["calibrate", "readings.csv", "--marks", "marks.csv", "--estimator", "ekf", "-o", "marked.toml"];
    let run = bench.run(&calibrate);
    let says = run.stderr.contains("marks.csv: ") && run.stderr.contains(" marks, held at ");
    assert!(run.code == Some(0) && says, "{}", run.stderr);
    bench.run(&["filter", "readings.csv", "--sensor", "marked.toml", "-o", "estimates.csv"]).ok();
}

#[test]
fn a_mark_that_is_wrong_is_named_and_nothing_is_written() {
    let bench = Bench::calibrated();
    without_reference(&bench);
    let fails = |marks: &str, message: &str| {
        bench.write("marks.csv", marks);
        let run = bench.run(&["calibrate", "readings.csv", "--marks", "marks.csv", "-o", "marked.toml"]);
        assert!(run.code == Some(4) && run.stderr.contains(message), "{}", run.stderr);
        assert!(!bench.path("marked.toml").exists());
    };
    fails("time_s,force\n1,0\n", "marks.csv:1: expected the columns `time_s`, `strain`");
    fails("time_s,strain\n1,0\n2,x\n", "marks.csv:3: column `strain`: expected a number, found `x`");
    fails("time_s,strain\n1,0\n2e9,0.1\n", "marks.csv:3: expected a time between");
    fails("time_s,until_s,strain\n1,5,0\n3,,0.1\n", "marks.csv:3: expected a time after 5 s");
    fails("time_s,strain\n1,0\n", "marks.csv: expected at least two marks of different strains, found 1");
}
