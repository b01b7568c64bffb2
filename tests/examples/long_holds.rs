//! Every estimator, and the static inverse, on a simulated sensor outside the fitted family: release peaks and holds of
//! 300 s. Prints `docs/long-holds.md`:
//!
//! ```text
//! cargo run --release -p ohmstrain-tests --example long_holds > docs/long-holds.md
//! ```
//!
//! The scenario and its seeds were fixed before anything was tuned on them, and nothing has been tuned on them since.

mod scenario;

use std::error::Error;

use comfy_table::{Table, presets};
use ohmstrain_bench_data::Trace;
use ohmstrain_calib::{
    EstimatorKind, LawOptions, Quantity, ReadingUnit, Samples, ScoredRow, Scores, SensorParams, Start, build_filter,
    calibrate,
};
use ohmstrain_ekf::Reading;
use scenario::{CALIBRATION_SEED, TEST_SEEDS, session};

fn samples(trace: &Trace) -> Samples<'_> {
    let strain = trace.reference.as_ref().map_or(&[][..], |reference| &reference.values);
    Samples::new(&trace.time_s, &trace.readings.values, strain).expect("a simulated trace")
}

fn main() -> Result<(), Box<dyn Error>> {
    let training = session(CALIBRATION_SEED)?;
    let calibration = calibrate(
        &[samples(&training)],
        LawOptions::candidates(EstimatorKind::Corrected),
        &EstimatorKind::ALL,
        |_| (),
    )?;
    let params = calibration.into_sensor("", Quantity::Strain, ReadingUnit::Ohm);
    let tests = TEST_SEEDS.map(session).collect::<Result<Vec<_>, _>>()?;
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["estimate", "RMSE, %FS", "worst seed", "95 % covers", "wrong branch", "worst seed"]);
    for kind in EstimatorKind::ALL {
        let scores = tests.iter().map(|test| score_estimator(&params, kind, test)).collect::<Result<Vec<_>, _>>()?;
        add_row(&mut table, kind.name(), &scores);
    }
    let scores = tests.iter().map(|test| score_static(&params, test)).collect::<Result<Vec<_>, _>>()?;
    add_row(&mut table, "static cubic", &scores);
    println!("{}", include_str!("long_holds.md").trim_end());
    println!("\n{table}");
    Ok(())
}

fn score_estimator(params: &SensorParams, kind: EstimatorKind, test: &Trace) -> Result<Scores, Box<dyn Error>> {
    let mut filter = build_filter(params, Some(kind), Start::Unknown)?;
    let samples = samples(test);
    let mut rows = Vec::with_capacity(samples.len());
    for k in 0..samples.len() {
        filter.step(samples.time_s()[k], Some(Reading::from(samples.reading()[k] / params.rest_reading - 1.0)))?;
        let strain = filter.strain();
        let (time_s, truth) = (samples.time_s()[k], samples.strain()[k]);
        rows.push(ScoredRow { time_s, truth, strain: strain.mean, sd: Some(strain.sd()) });
    }
    Scores::new(&rows).ok_or_else(|| "nothing to score".into())
}

fn score_static(params: &SensorParams, test: &Trace) -> Result<Scores, Box<dyn Error>> {
    let samples = samples(test);
    let row = |k: usize| {
        let (time_s, truth) = (samples.time_s()[k], samples.strain()[k]);
        ScoredRow { time_s, truth, strain: params.static_cubic.strain(samples.reading()[k]), sd: None }
    };
    Scores::new(&(0..samples.len()).map(row).collect::<Vec<_>>()).ok_or_else(|| "nothing to score".into())
}

fn add_row(table: &mut Table, name: &str, scores: &[Scores]) {
    let mean = |of: &dyn Fn(&Scores) -> f64| scores.iter().map(of).sum::<f64>() / scores.len() as f64;
    let worst = |of: &dyn Fn(&Scores) -> f64| scores.iter().map(of).fold(0.0, f64::max);
    let covers = mean(&|s| s.coverage_95.unwrap_or(f64::NAN));
    table.add_row([
        name.to_string(),
        format!("{:.1}", mean(&|s| s.rmse_percent_fs)),
        format!("{:.1}", worst(&|s| s.rmse_percent_fs)),
        if covers.is_nan() { String::new() } else { format!("{:.0} %", 100.0 * covers) },
        format!("{:.1} %", 100.0 * mean(&|s| s.wrong_branch)),
        format!("{:.1} %", 100.0 * worst(&|s| s.wrong_branch)),
    ]);
}
