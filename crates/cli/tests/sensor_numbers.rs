//! Whatever one number of a sensor file is changed to: it is refused by its name, or every number that comes out is one.

use crate::common::{Bench, Csv, change_rows};
use toml::Value;

/// What a number is changed to.
const HOSTILE: [f64; 9] = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300, -1e300, 1e9, -1e9, 1e-12];

/// Paths of all numbers that are no counts. Of what is only told, and of the rows that a correction
/// learned from, one of each kind will do.
fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Float(_) => found.push(path.to_string()),
        Value::Table(table) => {
            for (name, value) in table {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                numbers(value, &path, found);
            }
        }
        Value::Array(array) => {
            let told = ["uncertainty", "correction", "findings"].iter().any(|table| path.starts_with(table));
            for (index, value) in array.iter().enumerate().take(if told { 1 } else { array.len() }) {
                numbers(value, &format!("{path}[{index}]"), found);
            }
        }
        _ => {}
    }
}

/// The value at a path.
fn at<'a>(value: &'a mut Value, path: &str) -> &'a mut Value {
    path.split(['.', '[']).fold(value, |value, step| match step.strip_suffix(']') {
        Some(index) => &mut value[index.parse::<usize>().unwrap()],
        None => &mut value[step],
    })
}

/// Which cells of estimates are empty; all others are finite numbers or words.
#[track_caller]
fn empty_cells(estimates: &str) -> Vec<bool> {
    let csv = Csv::new(estimates);
    let columns = csv.header.split(',').filter(|name| *name != "flags");
    let cells = columns.flat_map(|name| csv.cells(name));
    let is_empty = |cell: &str| {
        assert!(cell.is_empty() || cell.parse::<f64>().is_ok_and(f64::is_finite), "{cell}");
        cell.is_empty()
    };
    cells.map(is_empty).collect()
}

/// Runs all commands that read a sensor file on each of its changes.
fn survives(bench: &Bench) {
    let sensor: Value = toml::from_str(&bench.read("sensor.toml")).unwrap();
    let mut paths = Vec::new();
    numbers(&sensor, "", &mut paths);
    assert!(paths.len() > 40, "{paths:?}");
    let run = |command: &[&str], file| bench.run(&[command, &["short.csv", "--sensor", file]].concat());
    let estimates = [&["filter"][..], &["smooth"]];
    let evaluate = ["evaluate", "--json"];
    let empty = estimates.map(|command| empty_cells(&run(command, "sensor.toml").ok()));
    let nulls = run(&evaluate, "sensor.toml").ok().matches("null").count();
    let mut refused = 0;
    for path in &paths {
        for hostile in HOSTILE {
            let mut changed = sensor.clone();
            *at(&mut changed, path) = Value::Float(hostile);
            bench.write("changed.toml", toml::to_string(&changed).unwrap());
            let first = run(estimates[0], "changed.toml");
            if first.code == Some(4) {
                refused += 1;
                let field = first.stderr.split('`').nth(1).unwrap();
                // By itself, or by what it has to go together with: a number beside it, or another table.
                let table = |path: &str| path.rsplit_once('.').map(|(table, _)| table.to_string());
                let mut quoted = first.stderr.split('`').skip(1).step_by(2);
                let named = quoted.any(|name| path.starts_with(name)) || table(path) == table(field);
                assert!(first.stderr.contains(": field `") && named, "{path}: {}", first.stderr);
                assert!(first.stderr.starts_with("ohmstrain: changed.toml:") && first.stdout.is_empty());
                let line = first.stderr.split(':').nth(2).unwrap().parse::<usize>().unwrap();
                let text = bench.read("changed.toml");
                let last = path.rsplit('.').next().unwrap().split('[').next().unwrap();
                let table = field.rsplit('.').next().unwrap();
                let line = text.lines().nth(line - 1).unwrap();
                assert!(line.starts_with(last) || line.contains(table), "{path}: {line}");
                continue;
            }
            assert_eq!(empty_cells(&first.ok()), empty[0], "filter: {path} = {hostile}");
            assert_eq!(empty_cells(&run(estimates[1], "changed.toml").ok()), empty[1], "smooth: {path} = {hostile}");
            let scores = run(&evaluate, "changed.toml").ok();
            assert_eq!(scores.matches("null").count(), nulls, "{path} = {hostile}: {scores}");
        }
    }
    // Of each number at least NaN; of most of them more.
    assert!(refused > 2 * paths.len(), "{refused} of {}", paths.len());
}

/// The first and every fifth row of a minute: holds and movements.
fn short(bench: &Bench) {
    let mut row = 0;
    let kept = |line: &&str| {
        let is_row = line.starts_with(|first: char| first.is_ascii_digit());
        row += usize::from(is_row);
        !is_row || (row % 5 == 1 && row < 300)
    };
    let trace = bench.read("trace.csv");
    let short: String = trace.lines().filter(kept).map(|line| format!("{line}\n")).collect();
    // A reading is missing now and then.
    bench.write(
        "short.csv",
        change_rows(&short, |row, cells| {
            if row % 7 == 6 {
                cells[1].clear()
            }
        }),
    );
}

#[test]
fn of_a_sensor_for_the_extended_kalman_filter() {
    let bench = Bench::calibrated();
    short(&bench);
    survives(&bench);
}

#[test]
fn of_a_sensor_for_phase_histories() {
    let bench = Bench::calibrated();
    short(&bench);
    bench.run(&["calibrate", "trace.csv", "--until", "60", "--estimator", "hypotheses", "-o", "sensor.toml"]).ok();
    survives(&bench);
}

#[test]
fn of_a_sensor_with_a_learned_correction() {
    let bench = Bench::calibrated();
    short(&bench);
    bench.run(&["calibrate", "trace.csv", "--until", "60", "-o", "sensor.toml"]).ok();
    survives(&bench);
}

/// The reversed range made `evaluate` panic.
#[test]
fn a_reversed_range_is_refused_where_it_stands() {
    let bench = Bench::calibrated();
    let mut sensor: Value = toml::from_str(&bench.read("sensor.toml")).unwrap();
    *at(&mut sensor, "static_cubic.range.lower") = Value::Float(0.5);
    let text = toml::to_string(&sensor).unwrap();
    let table = text.lines().position(|line| line == "[static_cubic.range]").unwrap();
    bench.write("changed.toml", &text);
    let run = bench.run(&["evaluate", "trace.csv", "--sensor", "changed.toml"]);
    let upper = at(&mut sensor, "static_cubic.range.upper").as_float().unwrap();
    let place = format!("changed.toml:{}: column 9", table + 3);
    run.fails(4, &format!("{place}: field `static_cubic.range.upper`: expected more than `lower`, 0.5, found {upper}"));
}
