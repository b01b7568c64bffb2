use ohmstrain_bench_data::import::{Plan, Table};

use crate::args::ImportArgs;
use crate::error::CliError;
use crate::lab_files;
use crate::messages::Messages;
use crate::output::{IMPORT, Kind, Outputs};
use ohmstrain::MADE_BY;

/// Makes a trace of a lab's files. What was taken for what, and what was left out, goes to stderr.
pub fn run(args: &ImportArgs, messages: &Messages) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.replace.force, &args.files);
    let output = outputs.claim_or_stdout(args.output.as_deref(), Kind::Import)?;
    let recipe = args.known.recipe();
    let tables = lab_files::read(&args.files, &recipe)?;
    let plan = Plan::new(&tables, &recipe)?;
    let mut imported = plan.import(&tables)?;
    let other = &mut imported.trace.metadata.other;
    other.retain(|(key, _)| key != "made_by");
    other.push(("made_by".into(), format!("{MADE_BY} {IMPORT}")));
    messages.remark(&columns(&plan, &tables));
    imported.remarks.iter().for_each(|remark| messages.remark(remark));
    let mut bytes = Vec::new();
    imported.trace.write(&mut bytes)?;
    outputs.publish_or_print(output, bytes)
}

/// What is what, on one line.
fn columns(plan: &Plan, tables: &[Table]) -> String {
    let of = |table: usize| if tables.len() > 1 { format!("{}: ", tables[table].file) } else { String::new() };
    let columns = plan.columns(tables).into_iter();
    let taken: Vec<String> =
        columns.map(|(role, table, _, column, unit)| format!("{role} = {}{column} in {unit}", of(table))).collect();
    let file = if tables.len() == 1 { tables[0].file.as_str() } else { "import" };
    format!("{file}: {}", taken.join(", "))
}
