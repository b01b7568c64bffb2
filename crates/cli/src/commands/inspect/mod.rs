mod json;
mod text;

use std::path::PathBuf;

use ohmstrain_bench_data::import::{EachPlan, ImportError, Imported, Plan, Recipe, Role, Survey, Table};
use ohmstrain_bench_data::{Metadata, Trace};

use crate::args::InspectArgs;
use crate::channels;
use crate::error::{CliError, shell_word};
use crate::input;
use crate::lab_files;
use crate::output::print;

/// Findings of `inspect`.
pub struct Findings {
    /// The files.
    pub tables: Vec<Table>,
    /// The proposed import, or the question to be answered first.
    pub plan: Result<Proposal, ImportError>,
    /// Import of all channels into one recording, if the open question is which channel is meant.
    pub each: Option<Each>,
}

/// An import of all channels.
pub struct Each {
    /// Its command.
    pub command: String,
    /// Name, readings and reference of each channel.
    pub channels: Vec<(String, String, Option<String>)>,
    /// True if each channel has a reference of its own.
    pub are_joints: bool,
    /// Next command, if the file is already such a recording.
    pub next: Option<String>,
}

/// A proposed import and its result.
pub struct Proposal {
    /// The import.
    pub plan: Plan,
    /// Its command.
    pub command: String,
    /// Remarks of the plan.
    pub remarks: Vec<String>,
    /// Survey of the trace.
    pub survey: Survey,
    /// Next command, if the file is already a trace, which an import would not change.
    pub next: Option<String>,
}

/// Describes the contents of a lab's files, and the import that suits them.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let recipe = args.known.recipe();
    args.files.iter().try_for_each(|path| lab_files::refuse_results(path))?;
    let tables = lab_files::read(&args.files, &recipe)?;
    let found = proposed(&tables, &recipe);
    let each = if found.is_err() { each(&args.files, &tables, &recipe) } else { None };
    if args.suggest {
        let command = match (found, each.filter(|each| each.are_joints)) {
            (Err(_), Some(each)) => each.command,
            (found, _) => lab_files::command(&args.files, &tables, &found?.0),
        };
        return print(|out| Ok(writeln!(out, "{command}")?));
    }
    let plan = match found {
        Ok((plan, imported, survey)) => {
            let command = lab_files::command(&args.files, &tables, &plan);
            let next = next(&args.files, &imported.trace);
            Ok(Proposal { plan, command, remarks: imported.remarks, survey, next })
        }
        Err(error) => Err(error),
    };
    let findings = Findings { tables, plan, each };
    print(|out| if args.json { json::write(out, &findings) } else { text::write(out, &findings) })
}

/// Returns the import of all channels, if the user has named no channel and if it works.
fn each(files: &[PathBuf], tables: &[Table], recipe: &Recipe) -> Option<Each> {
    let is_reading = |role: Role| matches!(role, Role::Resistance | Role::Ratio | Role::Adc);
    if recipe.columns.iter().any(|(role, _)| is_reading(*role)) {
        return None;
    }
    let plan = EachPlan::new(tables, recipe, &[]).ok()?;
    let recordings = plan.recordings(tables).ok()?;
    recordings.iter().try_for_each(|recording| plan.import(recording).map(drop)).ok()?;
    let flags: &[&str] = if recordings.len() > 1 { &["--each", "--split-recordings"] } else { &["--each"] };
    let command = lab_files::command_of(files, recipe, flags);
    let is_one = |file: &&PathBuf| channels::Table::read(file).is_ok_and(|table| table.is_some());
    let next = files.first().filter(|file| files.len() == 1 && recordings.len() == 1 && is_one(file));
    let next = next.map(|file| format!("ohmstrain calibrate {} -o hand.toml", shell_word(&file.display().to_string())));
    Some(Each { command, channels: plan.columns(tables), are_joints: plan.are_joints(), next })
}

/// Returns a plan that has been tried.
fn proposed(tables: &[Table], recipe: &Recipe) -> Result<(Plan, Imported, Survey), ImportError> {
    let plan = Plan::propose(tables, recipe)?;
    let imported = plan.import(tables)?;
    let survey = Survey::new(&imported);
    Ok((plan, imported, survey))
}

/// Returns the command that uses the file itself, if an import would not change it.
fn next(files: &[PathBuf], imported: &Trace) -> Option<String> {
    // The contents of stdin and pipes are consumed.
    let [file] = files else { return None };
    let trace = file.is_file().then(|| input::read(file, &Metadata::default()).ok())??.trace;
    let numbers = |trace: &Trace| -> Vec<u64> {
        let reference = trace.reference.iter().flat_map(|reference| &reference.values);
        trace.time_s.iter().chain(&trace.readings.values).chain(reference).map(|number| number.to_bits()).collect()
    };
    let is_same = trace.readings.kind == imported.readings.kind && numbers(&trace) == numbers(imported);
    let name = shell_word(&file.display().to_string());
    is_same.then(|| match trace.reference {
        Some(_) => format!("ohmstrain calibrate {name} -o sensor.toml"),
        None => format!("ohmstrain filter {name} --sensor sensor.toml > estimates.csv"),
    })
}
