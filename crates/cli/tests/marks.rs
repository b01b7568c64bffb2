//! `calibrate --marks`: strains known at marks, in place of a reference.

use crate::common::{Bench, Csv, change_rows, first_rows};

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

/// Marks stand in place of a reference: the rows kept from a calibration test nothing, and their marks are left out.
#[test]
fn marks_of_other_rows_are_left_out() {
    let bench = Bench::calibrated();
    let trace = without_reference(&bench);
    bench.write("marks.csv", turning_points(&trace));
    bench.write("reference.csv", first_rows(&bench.read("trace.csv"), 1000));
    let calibrate = ["calibrate", "--marks", "marks.csv", "--until", "150", "--estimator", "ekf", "--branches", "0"];
    for recording in ["readings.csv", "reference.csv"] {
        let run = bench.run(&[&calibrate[..], &[recording, "-o", "marked.toml", "--json"]].concat());
        let says = run.stderr.contains(" marks outside of the rows of the calibration left out");
        assert!(run.code == Some(0) && says, "{}", run.stderr);
        assert!(run.stdout.contains("\"tested\": null"), "{}", run.stdout);
    }
}

/// Marks are converted as a reference in the recording is: from percent, and from degrees around the recording's joint.
#[test]
fn marks_are_in_the_unit_of_a_reference() {
    let bench = Bench::calibrated();
    let trace = without_reference(&bench);
    let marks = turning_points(&trace);
    let (arm, length) = (4.4, 30.0);
    let converted =
        |to: &dyn Fn(f64) -> f64| change_rows(&marks, |_, cells| cells[1] = to(cells[1].parse().unwrap()).to_string());
    let percent = converted(&|strain| 100.0 * strain);
    bench.write("marks.csv", &marks);
    bench.write("percent.csv", &percent);
    bench.write("line.csv", format!("# strain_unit = percent\n{percent}"));
    let degrees = converted(&|strain: f64| (strain * length / arm).to_degrees());
    bench.write("degrees.csv", degrees.replace("strain", "angle_deg"));
    let joint = format!("# joint = prestrain=0 moment_arm_mm={arm} gauge_length_mm={length}\n");
    bench.write("joint.csv", joint + &bench.read("readings.csv"));
    let calibrate = |recording: &str, marks: &str, more: &[&str]| {
        let words =
            ["calibrate", recording, "--marks", marks, "-o", "marked.toml", "--estimator", "ekf", "--branches", "0"];
        bench.run(&[&words[..], more].concat())
    };
    let number = |table: &str, name: &str| {
        let sensor: toml::Table = bench.read("marked.toml").parse().unwrap();
        assert_eq!(sensor["quantity"].as_str(), Some("strain"));
        sensor[table][name].as_float().unwrap()
    };
    assert_eq!(calibrate("readings.csv", "marks.csv", &[]).code, Some(0));
    let upper = number("limits", "upper");
    for (recording, marks, more) in [
        ("readings.csv", "percent.csv", &["--unit", "strain=percent"][..]),
        ("readings.csv", "line.csv", &[]),
        ("joint.csv", "degrees.csv", &[]),
    ] {
        let run = calibrate(recording, marks, more);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!((number("limits", "upper") / upper - 1.0).abs() < 1e-3, "{marks}");
    }
    let doubted = calibrate("readings.csv", "percent.csv", &[]);
    let says = "percent.csv:1: expected the reference as a fraction of the length";
    assert!(doubted.code == Some(4) && doubted.stderr.contains(says), "{}", doubted.stderr);
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
    fails("time_s,strain\r\n1,0\r\n2,x\r\n", "marks.csv:3: column `strain`: expected a number, found `x`");
    fails("# strain_unit = percent\ntime_s,strain\n\n1,0\n\n2,x\n", "marks.csv:6: column `strain`: expected a number");
    fails(
        "# strain_unit = ppm\ntime_s,strain\n1,0\n",
        "marks.csv:1: expected `strain_unit` to be `fraction` or `percent`",
    );
    fails("time_s,strain\n1,0\n", "marks.csv: expected at least two marks of different strains, found 1");
}
