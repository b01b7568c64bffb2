//! How soon after a hold begins does the filter know where the resistance will end, and does its interval hold it? Prints
//! `docs/settled-holds.md`, for the simulated sensor of `long_holds`:
//!
//! ```text
//! cargo run --release -p ohmstrain-tests --example settled_holds > docs/settled-holds.md
//! ```
//!
//! With trace CSVs as arguments it prints the same for each of them, calibrated on its first half.

mod scenario;

use std::error::Error;
use std::fs::File;

use comfy_table::{Table, presets};
use ohmstrain_bench_data::{Trace, segment};
use ohmstrain_calib::{EstimatorKind, LawOptions, Quantity, ReadingUnit, Samples, Start, build_filter, calibrate};
use ohmstrain_ekf::Reading;
use ohmstrain_model::Phase;
use scenario::{CALIBRATION_SEED, TEST_SEEDS, session};

/// Shortest hold that counts, s: it must come near to where it ends.
const SHORTEST_HOLD_S: f64 = 100.0;
/// Times after the beginning of a hold at which the prediction is looked at, s.
const TIMES_S: [f64; 4] = [5.0, 20.0, 60.0, 95.0];
/// Half-width of the interval that counts as knowing, in spans of the reading.
const NARROW: f64 = 0.02;
const Z_95: f64 = 1.96;

fn main() -> Result<(), Box<dyn Error>> {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    let at = TIMES_S.map(|time_s| format!("covers after {time_s} s (± % of span)"));
    table.set_header(
        [vec!["sensor".into(), "holds".into(), "± 2 % of span after".into(), "covers then".into()], at.into()].concat(),
    );
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        let tests = TEST_SEEDS.map(session).collect::<Result<Vec<_>, _>>()?;
        let holds = study(&session(CALIBRATION_SEED)?, &tests, 0)?;
        table.add_row(row("simulated, mismatched", &holds));
        println!("{}", include_str!("settled_holds.md").trim_end());
        println!();
    }
    for name in &files {
        let trace = Trace::read(File::open(name)?, name)?;
        let middle = trace.len() / 2;
        let holds = study(&trace.until(trace.time_s[middle]), std::slice::from_ref(&trace), middle)?;
        table.add_row(row(name, &holds));
    }
    println!("{table}");
    Ok(())
}

/// One hold: predictions at each row, relative to the span of the reading.
struct Hold {
    /// Time since the hold began, s; half-width of the interval; whether it holds the end.
    rows: Vec<(f64, f64, bool)>,
}

/// Calibrates on one recording and looks at the holds of others that begin at row `from` or later.
fn study(training: &Trace, tests: &[Trace], from: usize) -> Result<Vec<Hold>, Box<dyn Error>> {
    let strain = |trace: &Trace| trace.reference.as_ref().map_or(vec![], |reference| reference.values.clone());
    let known = strain(training);
    let samples = Samples::new(&training.time_s, &training.readings.values, &known)?;
    let calibration =
        calibrate(&[samples], LawOptions::candidates(EstimatorKind::Corrected), &[EstimatorKind::Corrected], |_| ())?;
    let params = calibration.into_sensor("", Quantity::Strain, ReadingUnit::Ohm);
    let finite = training.readings.values.iter().copied().filter(|r| r.is_finite());
    let (low, high) = finite.fold((f64::MAX, f64::MIN), |(low, high), r| (low.min(r), high.max(r)));
    let mut holds = Vec::new();
    for test in tests {
        let mut filter = build_filter(&params, None, Start::Unknown)?;
        let mut settled = Vec::with_capacity(test.len());
        for (&time_s, &reading) in test.time_s.iter().zip(&test.readings.values) {
            let relative = reading.is_finite().then(|| Reading::from(reading / params.rest_reading - 1.0));
            filter.step(time_s, relative)?;
            settled.push(filter.output().estimate.settled);
        }
        for segment in segment(&test.time_s, &strain(test)) {
            let rows = segment.rows;
            let lasts_s = test.time_s[rows.end - 1] - test.time_s[rows.start];
            if segment.phase != Phase::Hold || lasts_s < SHORTEST_HOLD_S || rows.start < from {
                continue;
            }
            let last: Vec<f64> =
                test.readings.values[rows.end - 5..rows.end].iter().copied().filter(|r| r.is_finite()).collect();
            let end = last.iter().sum::<f64>() / last.len() as f64;
            let row = |k: usize| {
                let (mean, sd) = (params.rest_reading * (1.0 + settled[k].mean), params.rest_reading * settled[k].sd());
                let covers = (mean - end).abs() <= Z_95 * sd;
                (test.time_s[k] - test.time_s[rows.start], Z_95 * sd / (high - low), covers)
            };
            holds.push(Hold { rows: rows.clone().map(row).collect() });
        }
    }
    Ok(holds)
}

fn row(name: &str, holds: &[Hold]) -> Vec<String> {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let narrow: Vec<(f64, f64, bool)> =
        holds.iter().filter_map(|hold| hold.rows.iter().copied().find(|(_, half, _)| *half <= NARROW)).collect();
    let mut after: Vec<f64> = narrow.iter().map(|(time_s, _, _)| *time_s).collect();
    after.sort_by(f64::total_cmp);
    let soon = match after.get(after.len() / 2) {
        Some(median) => format!("{median:.0} s in {} of {}", after.len(), holds.len()),
        None => "never".into(),
    };
    let covers = narrow.iter().filter(|(_, _, covers)| *covers).count() as f64 / narrow.len() as f64;
    let then = if narrow.is_empty() { String::new() } else { percent(covers) };
    let mut cells = vec![name.to_string(), holds.len().to_string(), soon, then];
    for time_s in TIMES_S {
        let at: Vec<(f64, f64, bool)> =
            holds.iter().filter_map(|hold| hold.rows.iter().copied().find(|(t, _, _)| *t >= time_s)).collect();
        let count = at.len() as f64;
        let covered = at.iter().filter(|(_, _, covers)| *covers).count() as f64 / count;
        let half = at.iter().map(|(_, half, _)| half).sum::<f64>() / count;
        cells.push(format!("{} (± {:.0})", percent(covered), 100.0 * half));
    }
    cells
}
