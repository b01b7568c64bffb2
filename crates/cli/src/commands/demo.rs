use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings};
use ohmstrain_calib::{LawOptions, Output, RECIPE, SensorParams};

use super::calibrate::{Calibrated, calibrate_recordings, report};
use super::score_table::{add_scores, score_table};
use super::smooth::write_estimates;
use super::{scoring, simulate};
use crate::args::DemoArgs;
use crate::error::CliError;
use crate::input::{self, Recording};
use crate::output::{Kind, Outputs, print};
use crate::progress::Progress;
use crate::run::estimate;
use crate::sensor_file;

/// Share of the recording that calibrates; the rest is the test.
const CALIBRATION_SHARE: f64 = 0.5;

/// The whole chain on a simulated sensor that is not of the fitted model's family.
pub fn run(args: &DemoArgs) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.force, []);
    outputs.folder(&args.out)?;
    let mut claim = |name: &str, kind| outputs.claim(&args.out.join(name), kind);
    let trace_output = claim("trace.csv", Kind::Trace)?;
    let sensor_output = claim("sensor.toml", Kind::Sensor)?;
    let filtered_output = claim("estimates.csv", Kind::Estimates)?;
    let smoothed_output = claim("smoothed.csv", Kind::Estimates)?;
    let report_output = claim("report.html", Kind::Report)?;

    let progress = Progress::new("simulating a bench session");
    let trace = simulate::bytes(&settings(args.seed)).map_err(CliError::Other)?;
    let recording = input::parse(&trace, &args.out.join("trace.csv"), &Default::default())?;
    outputs.put(trace_output, trace);
    let middle = (recording.trace.len() as f64 * CALIBRATION_SHARE) as usize;
    let test_from = recording.trace.time_s[middle];

    let training = recording.rows(0..middle);
    let estimator = RECIPE.estimator;
    let structures = LawOptions::candidates(estimator);
    let Calibrated { params, .. } =
        calibrate_recordings(std::slice::from_ref(&training), structures, estimator, &progress)?;
    outputs.put(sensor_output, sensor_file::text(&params)?);

    progress.doing("filtering and smoothing");
    let estimated = estimate(&recording, &params, params.rest_reading, None)?;
    outputs.put(filtered_output, estimates(&recording, &params, &estimated.filtered)?);
    outputs.put(smoothed_output, estimates(&recording, &params, &estimated.smoothed)?);
    progress.doing("writing the report");
    outputs.put(report_output, report(&recording, &params, Some(test_from))?);
    outputs.publish()?;
    drop(progress);

    let mut table = score_table(params.quantity.name(), &[]);
    let part = scoring::Part::since(Some(test_from));
    let scores = [
        ("filter", scoring::of_outputs(&recording, &estimated.filtered, part)),
        ("smoother", scoring::of_outputs(&recording, &estimated.smoothed, part)),
        ("static cubic", scoring::of_baseline(&recording, params.static_cubic.start(), part, 1.0)),
    ];
    for (name, scores) in scores {
        if let Some(scores) = scores {
            add_scores(&mut table, "second half", name, &scores, &[]);
        }
    }
    print(|out| {
        writeln!(out, "{table}")?;
        Ok(writeln!(out, "\nSee {}", args.out.join("report.html").display())?)
    })
}

fn settings(seed: u64) -> SimulationSettings {
    SimulationSettings {
        speed_mm_s: 5.0,
        mismatched: true,
        seed,
        ..SimulationSettings::new(Material::Ecoflex0030, Protocol::MIXED)
    }
}

fn estimates(recording: &Recording, params: &SensorParams, outputs: &[Output]) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    write_estimates(&mut bytes, recording, params, params.rest_reading, outputs, &[])?;
    Ok(bytes)
}
