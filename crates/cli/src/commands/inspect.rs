use ohmstrain_bench_data::import::{ImportError, Plan, Recipe, Survey, Table};

use crate::args::InspectArgs;
use crate::commands::inspect_json;
use crate::commands::inspect_text;
use crate::error::CliError;
use crate::lab_files;
use crate::output::print;

/// What `inspect` found.
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
    /// What it remarks.
    pub remarks: Vec<String>,
    /// What the trace looks like.
    pub survey: Survey,
}

/// Says what stands in a lab's files, and how to import them.
pub fn run(args: &InspectArgs) -> Result<(), CliError> {
    let recipe = args.known.recipe();
    let tables = lab_files::read(&args.files, &recipe)?;
    if args.suggest {
        let plan = proposed(&tables, &recipe)?.0;
        let command = lab_files::command(&args.files, &tables, &plan)?;
        return print(|out| Ok(writeln!(out, "{command}")?));
    }
    let plan = match proposed(&tables, &recipe) {
        Ok((plan, remarks, survey)) => {
            let command = lab_files::command(&args.files, &tables, &plan)?;
            Ok(Proposal { plan, command, remarks, survey })
        }
        Err(error) => Err(error),
    };
    let findings = Findings { tables, plan };
    print(|out| if args.json { inspect_json::write(out, &findings) } else { inspect_text::write(out, &findings) })
}

/// A plan that has been tried.
fn proposed(tables: &[Table], recipe: &Recipe) -> Result<(Plan, Vec<String>, Survey), ImportError> {
    let plan = Plan::propose(tables, recipe)?;
    let imported = plan.import(tables)?;
    let survey = Survey::new(&imported);
    Ok((plan, imported.remarks, survey))
}
