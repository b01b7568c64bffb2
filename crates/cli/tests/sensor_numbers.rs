//! Any changed number of a sensor file is refused by its name, or all resulting numbers are finite.

use ohmstrain::{Error, Estimate, Evaluation, Recording, Sensor};
use toml::Value;

use crate::common::{Bench, Csv};

/// Values that a number is changed to.
const HOSTILE: [f64; 9] = [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300, -1e300, 1e9, -1e9, 1e-12];

/// Collects the paths of all numbers that are not counts. Of purely informative numbers, and of the rows that a correction
/// learned from, one of each kind is enough.
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
            let is_sampled = ["uncertainty", "correction", "findings"].iter().any(|table| path.starts_with(table));
            for (index, value) in array.iter().enumerate().take(if is_sampled { 1 } else { array.len() }) {
                numbers(value, &format!("{path}[{index}]"), found);
            }
        }
        _ => {}
    }
}

/// Returns the value at a path.
fn at<'a>(value: &'a mut Value, path: &str) -> &'a mut Value {
    path.split(['.', '[']).fold(value, |value, step| match step.strip_suffix(']') {
        Some(index) => &mut value[index.parse::<usize>().unwrap()],
        None => &mut value[step],
    })
}

/// Returns true for the numbers of estimates that are missing; all others are finite.
#[track_caller]
fn missing(rows: &[Estimate]) -> Vec<bool> {
    let is_missing = |number: Option<f64>| {
        assert!(number.is_none_or(f64::is_finite), "{number:?}");
        number.is_none()
    };
    let known = |number: f64| Some(number).filter(|number| !number.is_nan());
    let of_row = |row: &Estimate| {
        let of_strain = [row.strain, row.strain_sd, row.strain_rate, row.strain_rate_sd].map(known);
        let of_law = [row.relaxation, row.relaxation_sd, row.baseline, row.p_beyond_border].map(known);
        let of_reading = [row.resistance, known(row.settled_resistance), known(row.settled_resistance_sd), row.nis];
        let of_phases = [row.p_extend, row.p_hold, row.p_retract];
        [&of_strain[..], &of_law, &of_reading, &of_phases].concat()
    };
    rows.iter().flat_map(of_row).map(is_missing).collect()
}

/// Filters, smooths and scores a short recording; returns which numbers are missing, and the scores.
fn used(sensor: &Sensor, recording: &Recording, [time_s, readings, _]: &[Vec<f64>; 3]) -> (Vec<bool>, Evaluation) {
    let mut filter = sensor.filter().build().unwrap();
    let filtered: Vec<Estimate> = time_s.iter().zip(readings).map(|(t, r)| filter.step(*t, *r).unwrap()).collect();
    let smoothed = sensor.smooth(time_s, readings).unwrap();
    (missing(&[filtered, smoothed].concat()), sensor.evaluate(recording).unwrap().unwrap())
}

/// Checks that a change is refused by the number's name and line: on its own, or together with a related number beside it or in
/// another table.
fn is_refused_by_name(error: &Error, path: &str, text: &str) {
    let message = error.in_file("changed.toml");
    let field = message.split('`').nth(1).unwrap();
    let table = |path: &str| path.rsplit_once('.').map(|(table, _)| table.to_string());
    let mut quoted = message.split('`').skip(1).step_by(2);
    let named = quoted.any(|name| path.starts_with(name)) || table(path) == table(field);
    assert!(message.contains(": field `") && named, "{path}: {message}");
    let line = message.strip_prefix("changed.toml:").unwrap().split(':').next().unwrap().parse::<usize>().unwrap();
    let line = text.lines().nth(line - 1).unwrap();
    let last = path.rsplit('.').next().unwrap().split('[').next().unwrap();
    assert!(line.starts_with(last) || line.contains(field.rsplit('.').next().unwrap()), "{path}: {line}");
}

/// Changes each number of `sensor.toml`, and uses every sensor that is not refused.
fn survives(bench: &Bench) {
    let file: Value = toml::from_str(&bench.read("sensor.toml")).unwrap();
    let mut paths = Vec::new();
    numbers(&file, "", &mut paths);
    assert!(paths.len() > 40, "{paths:?}");
    let rows = short(bench);
    let recording = Recording::new(&rows[0], &rows[1], &rows[2]).unwrap();
    let (expected, _) = used(&Sensor::from_toml(&bench.read("sensor.toml")).unwrap(), &recording, &rows);
    let mut refused = 0;
    for path in &paths {
        for hostile in HOSTILE {
            let mut changed = file.clone();
            *at(&mut changed, path) = Value::Float(hostile);
            let text = toml::to_string(&changed).unwrap();
            match Sensor::from_toml(&text) {
                Err(error) => {
                    is_refused_by_name(&error, path, &text);
                    refused += 1;
                }
                Ok(sensor) => {
                    let (found, scores) = used(&sensor, &recording, &rows);
                    assert_eq!(found, expected, "{path} = {hostile}");
                    let errors = [scores.filter.rmse, scores.smoother.rmse, scores.static_cubic.rmse];
                    assert!(errors.iter().all(|error| error.is_finite()), "{path} = {hostile}: {errors:?}");
                }
            }
        }
    }
    // For each number at least NaN; for most of them more values.
    assert!(refused > 2 * paths.len(), "{refused} of {}", paths.len());
}

/// Returns time, reading and strain of every fifth row of the first 24 s, with holds and movements; some readings are missing.
fn short(bench: &Bench) -> [Vec<f64>; 3] {
    let trace = Csv::new(&bench.read("trace.csv"));
    let rows = |name: &str| trace.numbers(name).into_iter().take(120).step_by(5).collect::<Vec<f64>>();
    let mut readings = rows("resistance_ohm");
    readings.iter_mut().skip(6).step_by(7).for_each(|reading| *reading = f64::NAN);
    [rows("time_s"), readings, rows("strain")]
}

#[test]
fn of_a_sensor_for_the_extended_kalman_filter() {
    let bench = Bench::calibrated();
    survives(&bench);
}

#[test]
fn of_a_sensor_for_phase_histories() {
    let bench = Bench::calibrated();
    bench.run(&["calibrate", "trace.csv", "--until", "60", "--estimator", "hypotheses", "-o", "sensor.toml"]).ok();
    survives(&bench);
}

#[test]
fn of_a_sensor_with_a_learned_correction() {
    let bench = Bench::calibrated();
    bench.run(&["calibrate", "trace.csv", "--until", "60", "-o", "sensor.toml"]).ok();
    survives(&bench);
}

/// A reversed range made `evaluate` panic.
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
