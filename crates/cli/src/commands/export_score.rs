//! Scores of an exported filter on a recording, beside the promised ones and those of the filter on this computer.

use ohmstrain::Sensor;
use ohmstrain_calib::{Baseline, ScoredRow};
use ohmstrain_sensor::{Scores, SensorParams};

use crate::args::ExportArgs;
use crate::commands::score_table::covered;
use crate::error::CliError;
use crate::input::TraceFile;
use crate::output::{self, print};
use ohmstrain_export::{self as export, ChipFilter, Cost, ExportTarget, Plan, ReplayedRow};

/// A recording with a reference, and what this computer and a static cubic make of it, as they would live.
pub struct OnRecording {
    name: String,
    from_s: Option<f64>,
    dt_s: f64,
    rows: Vec<ReplayedRow>,
    program: Vec<ScoredRow>,
    static_cubic: Vec<ScoredRow>,
}

impl OnRecording {
    /// Runs both over the whole recording.
    pub fn new(args: &ExportArgs, dt_s: f64, sensor: &Sensor, recording: &TraceFile) -> Result<Self, CliError> {
        let refused = |error: &dyn std::fmt::Display| CliError::Input(format!("{}: {error}", recording.name));
        let mut builder = sensor.filter();
        if let Some(estimator) = args.estimator.chosen() {
            builder = builder.estimator(estimator.0);
        }
        let mut filter = builder.build().map_err(|error| refused(&error))?;
        let mut cubic = ohmstrain_calib::running_cubic(sensor.params().static_cubic);
        let mut rows = Vec::new();
        let [mut program, mut static_cubic] = [const { Vec::new() }; 2];
        let mut last_s = None;
        for row in 0..recording.trace.len() {
            let (time_s, reading) = recording.reading(row);
            // What is exported takes an interval for its first step.
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
    fn exported(&self, params: &SensorParams, plan: &Plan, args: &ExportArgs) -> Result<Scores, CliError> {
        let replayed = export::replay(params, plan, self.dt_s, &self.rows)
            .map_err(|error| CliError::export(&error, &args.sensor.display().to_string()))?;
        let of = |(row, said): (&ScoredRow, &export::Said)| ScoredRow {
            strain: said.strain.into(),
            sd: Some(said.sd.into()),
            ..*row
        };
        self.scores(&self.program.iter().zip(&replayed).map(of).collect::<Vec<_>>())
    }

    /// Its error, percent of full scale.
    pub fn error(&self, params: &SensorParams, plan: &Plan, args: &ExportArgs) -> Result<f64, CliError> {
        Ok(self.exported(params, plan, args)?.rmse_percent_fs)
    }
}

/// Promise of an exported filter: its errors and its costs.
pub struct Promise {
    /// A table of errors and costs, for the header of the exported code, too.
    pub lines: Vec<String>,
    words: String,
    /// The recording on which it is worse than a static cubic.
    worse_on: Option<String>,
}

impl Promise {
    /// Creates the promise of a plan; it has scores if there is a recording.
    pub fn new(
        args: &ExportArgs,
        dt_s: f64,
        params: &SensorParams,
        plan: &Plan,
        recording: Option<&OnRecording>,
    ) -> Result<Self, CliError> {
        let name = args.sensor.display().to_string();
        let chip = ChipFilter::new(params, plan).map_err(|error| CliError::export(&error, &name))?;
        let cost = export::cost(params, plan, dt_s).map_err(|error| CliError::export(&error, &name))?;
        let mut table =
            output::table(["estimate", "%FS", "50/90/95 %", "instructions", "flash, B", "RAM, B", "of it stack, B"]);
        let mut worse_on = None;
        let of = |error: f64, coverage: String| vec![format!("{error:.2}"), coverage];
        let of_95 = |percent: f64| format!("-/-/{percent:.0}");
        let of_all = |scores: &Scores| {
            of(scores.rmse_percent_fs, covered([scores.coverage_50, scores.coverage_90, scores.coverage_95]))
        };
        let mut add = |name: &str, cells: Vec<String>| {
            table.add_row(std::iter::once(name.to_owned()).chain(cells));
        };
        let is_default = plan.kind.is_none_or(|kind| kind == params.default_estimator) && !chip.is_smaller();
        let whose = if is_default { "" } else { " of the default" };
        if let Some(summary) = &params.summary {
            let promised = of(summary.left_out_percent_fs, of_95(summary.coverage_95_percent));
            add(&format!("promised{whose}: left out"), promised);
            add("static cubic: left out", of(summary.static_cubic_percent_fs, String::new()));
        }
        if let Some(tested) = &params.tested {
            add(
                &format!("tested{whose}: rows kept from calibration"),
                of(tested.filter_percent_fs, of_95(tested.coverage_95_percent)),
            );
            add("static cubic: these rows", of(tested.static_cubic_percent_fs, String::new()));
        }
        let mut exported = vec![String::new(); 2];
        if let Some(recording) = recording {
            let scores = recording.exported(params, plan, args)?;
            let (program, cubic) = (recording.scores(&recording.program)?, recording.scores(&recording.static_cubic)?);
            add("static cubic", of_all(&cubic));
            add("this computer", of_all(&program));
            exported = of_all(&scores);
            worse_on = (scores.rmse > cubic.rmse).then(|| recording.name.clone());
        }
        let of_cost =
            |cost: &Cost| [cost.instructions, cost.flash, cost.ram(), cost.stack].map(|number| number.to_string());
        exported.extend(of_cost(&cost));
        add("exported", exported);
        if let Some((budget, board)) = args.budget.as_ref().and_then(|budget| Some((budget, budget.board()?))) {
            let nothing = || vec![String::new(); 2];
            let cost = budget.cost(params, plan, dt_s).map_err(|error| CliError::export(&error, &name))?;
            add(&format!("on {}", board.title), [nothing(), of_cost(&cost).to_vec()].concat());
            let room = budget.room(dt_s);
            let most = [room.instructions, room.flash, room.ram].map(|number| number.to_string());
            add("room for it there", [nothing(), most.to_vec()].concat());
        }
        let words = format!("{}; a reading every {dt_s} s", chip.words());
        Ok(Self { lines: table.lines().collect(), words, worse_on })
    }

    /// Prints the candidates, and it; refuses what is worse than a static cubic, unless it is forced.
    pub fn print(&self, args: &ExportArgs, candidates: &[String]) -> Result<(), CliError> {
        print(|out| {
            for line in candidates.iter().chain(&self.lines) {
                writeln!(out, "{line}")?;
            }
            // Rust was counted once, by scripts/exported-c.sh, for docs/chip.md.
            let of = match args.target.into() {
                ExportTarget::C => "",
                ExportTarget::Rust => " of the same in C",
            };
            Ok(writeln!(out, "{}; instructions a step of a Cortex-M4F{of}, estimated as is the rest", self.words)?)
        })?;
        match &self.worse_on {
            Some(name) if !args.force => Err(CliError::Input(format!(
                "{name}: what would be exported is worse than a static cubic here; --force exports it"
            ))),
            _ => Ok(()),
        }
    }
}
