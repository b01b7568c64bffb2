use std::time::Instant;

use ohmstrain::{Calibrated, Calibration, Closing, Estimate, Sensor};
use ohmstrain_bench_data::simulate::{Material, SimulationSettings};

use super::calibrate::calibrate_recordings;
use super::reporting::{Wanted, drawn};
use super::score_table::{KEY, add_scores, score_table};
use super::simulate;
use super::smooth::write_estimates;
use crate::args::{DemoArgs, DemoMaterial, ReportArgs};
use crate::error::CliError;
use crate::input;
use crate::messages::Messages;
use crate::output::{Kind, Outputs, print};
use crate::progress::Progress;
use crate::sensor_file;
use ohmstrain_report::{Reporting, Sample, Scored, estimate, scoring};

/// Share of the recording used for calibration; the rest is the test.
const CALIBRATION_SHARE: f64 = 0.5;

/// Runs the whole chain on a simulated sensor outside the fitted family of models.
pub fn run(args: &DemoArgs, messages: &Messages) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.replace.force, []);
    outputs.folder(&args.out)?;
    let mut claim = |name: &str, kind| outputs.claim(&args.out.join(name), kind);
    let trace_output = claim("trace.csv", Kind::Simulation)?;
    let sensor_output = claim("sensor.toml", Kind::Sensor)?;
    let filtered_output = claim("estimates.csv", Kind::Estimates)?;
    let smoothed_output = claim("smoothed.csv", Kind::Estimates)?;
    let report = ReportArgs { report: Some(args.out.join("report.html")), figures: None };
    let wanted = Wanted::claim(&report, &mut outputs)?;

    let progress = Progress::new("simulating a bench session", messages);
    let trace = simulate::bytes(&settings(args.material, args.seed)).map_err(CliError::Other)?;
    let recording = input::parse(&trace, &args.out.join("trace.csv"), &Default::default())?;
    outputs.put(trace_output, trace);
    let middle = (recording.trace.len() as f64 * CALIBRATION_SHARE) as usize;
    let test_from = recording.trace.time_s[middle];

    let training = recording.rows(0..middle);
    let start = Instant::now();
    let Calibrated { sensor, findings, .. } =
        calibrate_recordings(std::slice::from_ref(&training), Calibration::new(), &progress)?;
    let calibration_s = start.elapsed().as_secs_f64();
    let params = sensor.params();
    outputs.put(sensor_output, sensor_file::text(&sensor)?);

    progress.doing("filtering and smoothing");
    let estimated =
        estimate(&recording, &sensor, None, None, &[]).map_err(|error| CliError::reporting(error, &recording.name))?;
    outputs.put(filtered_output, estimates(&sensor, &estimated.filtered)?);
    outputs.put(smoothed_output, estimates(&sensor, &estimated.smoothed)?);
    progress.doing("writing the report");
    let part = Scored::since(Some(test_from));
    let closing = Closing {
        file: Some("sensor.toml"),
        params,
        findings: findings.as_ref(),
        tested: None,
        calibration_s: Some(calibration_s),
        more: "--explain",
    };
    let reporting = Reporting {
        recording: &recording,
        sensor: &sensor,
        kind: None,
        rest_resistance: None,
        part,
        sample: Sample::Out,
        tested: None,
        facts: &closing.facts(),
    };
    if let Some(wanted) = wanted {
        wanted.put(drawn(&reporting)?, &mut outputs)?;
    }
    outputs.publish()?;
    drop(progress);

    let mut table = score_table();
    let scores = [
        ("filter", scoring::of_estimates(&recording, &estimated.filtered, part)),
        ("smoother", scoring::of_estimates(&recording, &estimated.smoothed, part)),
        (
            "static cubic",
            scoring::of_baseline(&recording, ohmstrain_calib::running_cubic(params.static_cubic), part, 1.0),
        ),
    ];
    for (name, scores) in scores {
        if let Some(scores) = scores {
            add_scores(&mut table, name, &scores);
        }
    }
    print(|out| {
        writeln!(out, "second half, not calibrated on: errors in strain\n{table}\n\n{KEY}")?;
        Ok(writeln!(out, "\nSee {}", args.out.join("report.html").display())?)
    })
}

fn settings(material: DemoMaterial, seed: u64) -> SimulationSettings {
    let material = match material {
        DemoMaterial::Representative => Material::Representative,
        DemoMaterial::WorstCase => Material::Ecoflex0030,
    };
    SimulationSettings { material, seed, ..SimulationSettings::example() }
}

fn estimates(sensor: &Sensor, estimates: &[Estimate]) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    write_estimates(&mut bytes, sensor, estimates)?;
    Ok(bytes)
}
