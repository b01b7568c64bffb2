//! Scores of an exported filter on a recording, beside the promised ones and those of the filter on this computer.

use ohmstrain::Sensor;
use ohmstrain::trace::TraceFile;
use ohmstrain_calib::{Baseline, ScoredRow};
use ohmstrain_sensor::{Scores, SensorParams};

use crate::args::ExportArgs;
use crate::error::CliError;
use crate::output::print;
use ohmstrain_export::{self as export, Compared, ExportTarget, Plan, Promise, ReplayedRow};

/// A recording with a reference, and the live estimates of this computer and of a static cubic for it.
pub struct OnRecording {
    /// Name of its file.
    pub name: String,
    from_s: Option<f64>,
    dt_s: f64,
    rows: Vec<ReplayedRow>,
    program: Vec<ScoredRow>,
    static_cubic: Vec<ScoredRow>,
}

impl OnRecording {
    /// Runs both over the whole recording.
    pub fn new(args: &ExportArgs, dt_s: f64, sensor: &Sensor, recording: &TraceFile) -> Result<Self, CliError> {
        let (recording, sensor) = (recording.at_reference_temperature(sensor), &recording.sensor_for(sensor));
        let refused = |error: &dyn std::fmt::Display| CliError::Input(format!("{}: {error}", recording.name));
        let mut builder = sensor.filter();
        if let Some(kind) = args.estimator.chosen() {
            builder = builder.estimator(kind);
        }
        let mut filter = builder.build().map_err(|error| refused(&error))?;
        let mut cubic = ohmstrain_calib::running_cubic(sensor.params().static_cubic);
        let mut rows = Vec::new();
        let [mut program, mut static_cubic] = [const { Vec::new() }; 2];
        let mut last_s = None;
        for row in 0..recording.trace.len() {
            let (time_s, reading) = recording.reading(row);
            // The exported filter takes the usual interval for its first step.
            let since_s = last_s.replace(time_s).map_or(dt_s, |last_s| time_s - last_s) as f32;
            rows.push(ReplayedRow { since_s, reading: reading.value, reading_sd: reading.sd });
            let estimate = filter.step(time_s, reading).map_err(|error| refused(&error))?;
            let truth = recording.truth(row);
            program.push(ScoredRow { time_s, truth, strain: estimate.strain, sd: Some(estimate.strain_sd) });
            static_cubic.push(ScoredRow { time_s, truth, strain: cubic.strain(time_s, reading.value), sd: None });
        }
        Ok(Self { name: recording.name.clone(), from_s: args.from, dt_s, rows, program, static_cubic })
    }

    /// Returns the scores of the requested rows.
    fn scores(&self, rows: &[ScoredRow]) -> Result<Scores, CliError> {
        let counted = |row: &&ScoredRow| row.truth.is_finite() && self.from_s.is_none_or(|from_s| row.time_s >= from_s);
        ohmstrain_calib::score(&rows.iter().filter(counted).copied().collect::<Vec<_>>()).ok_or_else(|| {
            CliError::Input(format!("{}: expected rows with a reference to score, found none", self.name))
        })
    }

    /// Returns the scores of the exported code.
    pub fn exported(&self, params: &SensorParams, plan: &Plan, args: &ExportArgs) -> Result<Scores, CliError> {
        let replayed = export::replay(params, plan, self.dt_s, &self.rows)
            .map_err(|error| CliError::export(&error, &args.sensor.display().to_string()))?;
        let of = |(row, estimate): (&ScoredRow, &export::ChipEstimate)| ScoredRow {
            strain: estimate.strain.into(),
            sd: Some(estimate.sd.into()),
            ..*row
        };
        self.scores(&self.program.iter().zip(&replayed).map(of).collect::<Vec<_>>())
    }

    /// Compares the exported code with the filter on this computer and with a static cubic.
    pub fn compared(&self, params: &SensorParams, plan: &Plan, args: &ExportArgs) -> Result<Compared, CliError> {
        Ok(Compared {
            exported: self.exported(params, plan, args)?,
            computer: self.scores(&self.program)?,
            static_cubic: self.scores(&self.static_cubic)?,
        })
    }
}

/// Prints the candidates and the promise; refuses a filter that is worse than a static cubic on `recording`, unless forced.
pub fn print_promise(
    args: &ExportArgs,
    candidates: &[String],
    promise: &Promise,
    worse_on: Option<&str>,
) -> Result<(), CliError> {
    let printed = print(|out| {
        for line in candidates.iter().chain(&promise.lines) {
            writeln!(out, "{line}")?;
        }
        // Costs of Rust were counted once, by scripts/exported-c.sh, for docs/chip.md.
        let of = match args.target.into() {
            ExportTarget::C => "",
            ExportTarget::Rust => " of the same in C",
        };
        Ok(writeln!(out, "{}; instructions a step of a Cortex-M4F{of}, estimated as is the rest", promise.words)?)
    });
    match worse_on {
        Some(name) if !args.force => Err(CliError::Input(format!(
            "{name}: what would be exported is worse than a static cubic here; --force exports it"
        ))),
        _ => printed,
    }
}
