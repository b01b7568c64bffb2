use std::path::{Path, PathBuf};

use ohmstrain_bench_data::counted;
use ohmstrain_bench_data::import::{EachPlan, Plan, Table};

use crate::args::ImportArgs;
use crate::error::CliError;
use crate::lab_files;
use crate::messages::Messages;
use crate::output::{IMPORT, Kind, Outputs};
use ohmstrain::MADE_BY;

/// Converts a lab's files to a trace, or to one trace per recording. The roles of the columns, and what was left out, go to
/// stderr.
pub fn run(args: &ImportArgs, messages: &Messages) -> Result<(), CliError> {
    let mut outputs = Outputs::new(args.replace.force, &args.files);
    let recipe = args.known.recipe();
    let parts = args.output.as_deref().filter(|_| args.split_recordings);
    let whole = args.output.as_deref().filter(|_| !args.split_recordings);
    let output = outputs.claim_or_stdout(whole, Kind::Import)?;
    let tables = lab_files::read(&args.files, &recipe)?;
    if args.each {
        let plan = EachPlan::new(&tables, &recipe, &args.pairs)?;
        name_channels(&plan, &tables, messages);
        return match parts {
            Some(path) => {
                split(outputs, path, &plan.recordings(&tables)?, messages, |part| each(&plan, part, messages))
            }
            None => outputs.publish_or_print(output, each(&plan, &tables, messages)?),
        };
    }
    let plan = Plan::new(&tables, &recipe)?;
    messages.remark(&columns(&plan, &tables));
    match parts {
        Some(path) => split(outputs, path, &plan.recordings(&tables)?, messages, |part| trace(&plan, part, messages)),
        None => outputs.publish_or_print(output, trace(&plan, &tables, messages)?),
    }
}

/// Writes each recording to a file of its own, all or none, and prints their names.
fn split(
    mut outputs: Outputs,
    path: &Path,
    recordings: &[Vec<Table>],
    messages: &Messages,
    text: impl Fn(&[Table]) -> Result<Vec<u8>, CliError>,
) -> Result<(), CliError> {
    if path == Path::new("-") {
        return Err(CliError::Arguments("--split-recordings: expected -o with the name of a file, found -".into()));
    }
    for (number, recording) in (1..).zip(recordings) {
        let path = numbered(path, number);
        let claim = outputs.claim(&path, Kind::Import)?;
        let lines = &recording[0].lines;
        let (first, last) = (lines.first().unwrap_or(&0), lines.last().unwrap_or(&0));
        let rows = counted(recording[0].len(), "row");
        messages.remark(&format!("{}: recording {number}, {rows}, lines {first} to {last}", path.display()));
        outputs.put(claim, text(recording)?);
    }
    outputs.publish()
}

/// Numbers a path: `trace.csv` → `trace-2.csv`.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |extension| format!(".{}", extension.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number}{extension}"))
}

/// Returns the text of a trace.
fn trace(plan: &Plan, tables: &[Table], messages: &Messages) -> Result<Vec<u8>, CliError> {
    let imported = plan.import(tables)?;
    imported.remarks.iter().for_each(|remark| messages.remark(remark));
    Ok(imported.trace.marked(&format!("{MADE_BY} {IMPORT}"))?)
}

/// Lists the channels with their references.
fn name_channels(plan: &EachPlan, tables: &[Table], messages: &Messages) {
    for (name, reading, reference) in plan.columns(tables) {
        let reference = reference.map_or("no reference".into(), |reference| format!("its reference {reference}"));
        messages.remark(&format!("{name} = {reading}, {reference}"));
    }
}

/// Returns the text of a recording of all channels.
fn each(plan: &EachPlan, tables: &[Table], messages: &Messages) -> Result<Vec<u8>, CliError> {
    let mut trace = plan.import(tables)?;
    trace.metadata.set_made_by(&format!("{MADE_BY} {IMPORT}"));
    trace.remarks.iter().for_each(|remark| messages.remark(remark));
    let mut bytes = Vec::new();
    trace.write(&mut bytes)?;
    Ok(bytes)
}

/// Lists the columns and their roles, on one line.
fn columns(plan: &Plan, tables: &[Table]) -> String {
    let of = |table: usize| if tables.len() > 1 { format!("{}: ", tables[table].file) } else { String::new() };
    let columns = plan.columns(tables).into_iter();
    let taken: Vec<String> =
        columns.map(|(role, table, _, column, unit)| format!("{role} = {}{column} in {unit}", of(table))).collect();
    let file = if tables.len() == 1 { tables[0].file.as_str() } else { "import" };
    format!("{file}: {}", taken.join(", "))
}
