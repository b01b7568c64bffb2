mod json;
mod text;

use std::path::PathBuf;

use ohmstrain_bench_data::import::{ImportError, Imported, Plan, Recipe, Survey, Table};
use ohmstrain_bench_data::{Metadata, Trace};

use crate::args::InspectArgs;
use crate::error::{CliError, shell_word};
use crate::input;
use crate::lab_files;
use crate::output::print;

/// Findings of `inspect`.
pub struct Findings {
    /// The files.
    pub tables: Vec<Table>,
    /// The import that it proposes, or what is to be answered first.
    pub plan: Result<Proposal, ImportError>,
}

/// An import and what it leads to.
pub struct Proposal {
    /// The import.
    pub plan: Plan,
    /// Its command.
    pub command: String,
    /// Remarks of the plan.
    pub remarks: Vec<String>,
    /// Survey of the trace.
    pub survey: Survey,
    /// Advice on a file that is a trace already: importing it changes nothing.
    pub next: Option<String>,
}

/// Describes the contents of a lab's files, and the import that fits them.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let recipe = args.known.recipe();
    args.files.iter().try_for_each(|path| lab_files::refuse_results(path))?;
    let tables = lab_files::read(&args.files, &recipe)?;
    if args.suggest {
        let plan = proposed(&tables, &recipe)?.0;
        let command = lab_files::command(&args.files, &tables, &plan);
        return print(|out| Ok(writeln!(out, "{command}")?));
    }
    let plan = match proposed(&tables, &recipe) {
        Ok((plan, imported, survey)) => {
            let command = lab_files::command(&args.files, &tables, &plan);
            let next = next(&args.files, &imported.trace);
            Ok(Proposal { plan, command, remarks: imported.remarks, survey, next })
        }
        Err(error) => Err(error),
    };
    let findings = Findings { tables, plan };
    print(|out| if args.json { json::write(out, &findings) } else { text::write(out, &findings) })
}

/// A plan that has been tried.
fn proposed(tables: &[Table], recipe: &Recipe) -> Result<(Plan, Imported, Survey), ImportError> {
    let plan = Plan::propose(tables, recipe)?;
    let imported = plan.import(tables)?;
    let survey = Survey::new(&imported);
    Ok((plan, imported, survey))
}

/// The command that uses a file which reads as it would be imported.
fn next(files: &[PathBuf], imported: &Trace) -> Option<String> {
    // What stdin and pipes had in them has been read.
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
