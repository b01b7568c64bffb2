//! Several recordings in one file.

use ohmstrain_bench_data::import::{Plan, Recipe};

use crate::import_files::{asks, decimal, file, proposed, tables, truth};

/// Returns three recordings, one below the other, the last one with other readings; each row has the number of its
/// trial.
fn stacked(is_numbered: bool) -> String {
    let trial = |number: i64| {
        file("", |ms, ohm, strain| {
            let trial = if is_numbered { format!("{number};") } else { String::new() };
            let ohm = ohm + 100 * i64::from(number == 3);
            format!("{trial}{};{};{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
        })
    };
    let names = if is_numbered { "trial;t (s);R (Ohm);strain (%)\n" } else { "t (s);R (Ohm);strain (%)\n" };
    names.to_owned() + &trial(1) + &trial(2) + &trial(3)
}

#[test]
fn a_clock_that_begins_anew_is_asked_about() {
    asks(&[("runs.csv", &stacked(false))], &Recipe::default(), &["runs.csv:62", "--split-recordings", "--recording 1"]);
}

#[test]
fn one_recording_is_chosen_by_its_number_or_by_a_column() {
    for known in [
        Recipe { recording: Some(3), ..Recipe::default() },
        Recipe { rows: vec!["trial=3".parse().unwrap()], ..Recipe::default() },
        Recipe { rows: vec!["1=3.0".parse().unwrap()], ..Recipe::default() },
    ] {
        let text = stacked(known.recording.is_none());
        let (_, imported) = proposed(&[("runs.csv", text.into())], &known).unwrap();
        let expected: Vec<f64> = truth().ohm().iter().map(|ohm| (10.0 * ohm + 100.0).round() / 10.0).collect();
        assert_eq!(imported.trace.readings.values, expected);
        assert_eq!(imported.trace.time_s, truth().time_s());
    }
    let known = Recipe { rows: vec!["trial=4".parse().unwrap()], ..Recipe::default() };
    asks(&[("runs.csv", &stacked(true))], &known, &["`trial` has no `4`", "`1`, `2`, `3`"]);
    let known = Recipe { recording: Some(4), ..Recipe::default() };
    asks(&[("runs.csv", &stacked(true))], &known, &["no recording 4"]);
}

#[test]
fn all_recordings_are_taken_apart() {
    for is_numbered in [false, true] {
        let tables = tables(&[("runs.csv", stacked(is_numbered).into())], &Recipe::default()).unwrap();
        let plan = Plan::new(&tables, &Recipe::default()).unwrap();
        let recordings = plan.recordings(&tables).unwrap();
        assert_eq!(recordings.len(), 3);
        for recording in &recordings {
            assert_eq!(plan.import(recording).unwrap().trace.time_s, truth().time_s());
        }
    }
    // Rows that are out of order are not recordings.
    let text = "t (s);R (Ohm)\n0.0;700\n0.1;701\n0.2;702\n0.1;703\n0.05;704\n0.3;705\n0.4;706\n";
    let tables = tables(&[("runs.csv", text.into())], &Recipe::default()).unwrap();
    let error = Plan::new(&tables, &Recipe::default()).unwrap().recordings(&tables).unwrap_err().to_string();
    assert!(error.starts_with("runs.csv:5:") && error.contains("out of order"), "{error}");
}
