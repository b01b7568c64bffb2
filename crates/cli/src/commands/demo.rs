use std::path::Path;

use ohmstrain_bench_data::simulate::{Material, Protocol, SimulationSettings, simulate};
use ohmstrain_calib::{EstimatorKind, LawOptions, Output, SensorParams};

use super::calibrate::{calibrate_recordings, write_report};
use super::score_table::{add_scores, score_table};
use super::scoring;
use super::smooth::write_estimates;
use crate::args::DemoArgs;
use crate::error::CliError;
use crate::input::{self, Recording};
use crate::output::{make_folder, write_file, write_to};
use crate::progress::Progress;
use crate::run::estimate;
use crate::sensor_file;

/// Share of the recording that calibrates; the rest is the test.
const CALIBRATION_SHARE: f64 = 0.5;

/// The whole chain on a simulated sensor that is not of the fitted model's family.
pub fn run(args: &DemoArgs) -> Result<(), CliError> {
    make_folder(&args.out)?;
    let progress = Progress::new("simulating a bench session");
    let trace_path = args.out.join("trace.csv");
    simulate_session(&trace_path, args.seed)?;
    let recording = input::read(&trace_path, &Default::default())?;
    let middle = (recording.trace.len() as f64 * CALIBRATION_SHARE) as usize;
    let test_from = recording.trace.time_s[middle];

    let training = recording.rows(0..middle);
    let ensemble = EstimatorKind::Ensemble;
    let structures = LawOptions::candidates(ensemble);
    let params = calibrate_recordings(std::slice::from_ref(&training), structures, ensemble, &progress)?;
    sensor_file::write(&args.out.join("sensor.toml"), &params)?;

    progress.doing("filtering and smoothing");
    let estimated = estimate(&recording, &params, None)?;
    write_outputs(&args.out.join("estimates.csv"), &recording, &params, &estimated.filtered)?;
    write_outputs(&args.out.join("smoothed.csv"), &recording, &params, &estimated.smoothed)?;
    progress.doing("writing the report");
    write_report(&args.out.join("report.html"), &recording, &params, Some(test_from))?;
    drop(progress);

    let mut table = score_table(params.quantity.name(), &[]);
    let part = scoring::Part::since(Some(test_from));
    let scores = [
        ("filter", scoring::of_outputs(&recording, &estimated.filtered, part)),
        ("smoother", scoring::of_outputs(&recording, &estimated.smoothed, part)),
        ("static cubic", scoring::of_baseline(&recording, params.static_cubic.start(), part)),
    ];
    for (name, scores) in scores {
        if let Some(scores) = scores {
            add_scores(&mut table, "second half", name, &scores, &[]);
        }
    }
    write_to(None, |out| {
        writeln!(out, "{table}")?;
        Ok(writeln!(out, "\nSee {}", args.out.join("report.html").display())?)
    })
}

fn simulate_session(path: &Path, seed: u64) -> Result<(), CliError> {
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        mismatched: true,
        seed,
        ..SimulationSettings::new(Material::Ecoflex0030, Protocol::MIXED)
    };
    let trace = simulate(&settings).map_err(|error| CliError::Other(error.to_string()))?;
    write_file(path, |mut out| Ok(trace.write(&mut out)?))
}

fn write_outputs(
    path: &Path,
    recording: &Recording,
    params: &SensorParams,
    outputs: &[Output],
) -> Result<(), CliError> {
    write_file(path, |out| write_estimates(out, recording, params, params.rest_reading, outputs, &[]))
}
