use std::io::Write;

use comfy_table::Table as TextTable;
use ohmstrain_bench_data::import::{Role, candidates};

use super::{Each, Findings, Proposal};
use crate::error::CliError;
use crate::output;
use crate::printable::printable;

/// Largest number of characters that are shown of a cell.
const WIDEST: usize = 24;
/// Largest number of columns that are shown of a file.
const MOST_COLUMNS: usize = 24;

/// Prints the findings, and the command or the question that follows from them.
pub fn write(out: &mut dyn Write, findings: &Findings) -> Result<(), CliError> {
    for (index, table) in findings.tables.iter().enumerate() {
        writeln!(out, "{}: {}", printable(&table.file), table.description())?;
        writeln!(out, "{}\n", columns(findings, index))?;
    }
    match &findings.plan {
        Ok(proposal) => write_proposal(out, proposal),
        Err(question) => match &findings.each {
            Some(each) if each.are_joints => write_each(out, each),
            Some(each) => {
                let command = &each.command;
                Ok(writeln!(out, "before it can be imported: {question}\nor all of them as one recording:\n{command}")?)
            }
            None => Ok(writeln!(out, "before it can be imported: {question}")?),
        },
    }
}

/// Prints the import of several joints.
fn write_each(out: &mut dyn Write, each: &Each) -> Result<(), CliError> {
    for (name, readings, reference) in &each.channels {
        let reference = reference.as_deref().unwrap_or("none");
        writeln!(out, "{:12}{}, its reference {}", printable(name), printable(readings), printable(reference))?;
    }
    if let Some(next) = &each.next {
        return Ok(writeln!(
            out,
            "\nit is a recording of all channels already and needs no import; go on with\n{next}"
        )?);
    }
    let command = &each.command;
    Ok(writeln!(out, "\nimport all of them with\n{command}\nor one of them with --column 'resistance=…'")?)
}

fn write_proposal(out: &mut dyn Write, proposal: &Proposal) -> Result<(), CliError> {
    for (name, text) in proposal.survey.lines() {
        writeln!(out, "{name:12}{text}")?;
    }
    for remark in &proposal.remarks {
        writeln!(out, "note        {remark}")?;
    }
    match &proposal.next {
        Some(next) => Ok(writeln!(out, "\nit is a trace already and needs no import; go on with\n{next}")?),
        None => Ok(writeln!(out, "\nimport it with\n{}", proposal.command)?),
    }
}

/// Returns a table with one row per column: its possible or proposed role.
fn columns(findings: &Findings, index: usize) -> TextTable {
    let table = &findings.tables[index];
    let mut text = output::table(["#", "column", "unit", "taken for", "first", "last"]);
    let taken = findings.plan.as_ref().map(|proposal| proposal.plan.columns(&findings.tables)).unwrap_or_default();
    let found = candidates(&findings.tables);
    let is_something = |place: usize| {
        taken.iter().any(|(_, table, column, ..)| (*table, *column) == (index, place))
            || found.iter().any(|it| (it.table, it.column) == (index, place))
    };
    let mut shown: Vec<usize> = (0..table.columns.len()).collect();
    // Columns with a role come first, if not all can be shown.
    shown.sort_by_key(|place| (table.columns.len() > MOST_COLUMNS && !is_something(*place), *place));
    shown.truncate(MOST_COLUMNS);
    shown.sort_unstable();
    for &place in &shown {
        let column = &table.columns[place];
        let is_here =
            |(_, table, column, ..): &&(Role, usize, usize, String, &str)| (*table, *column) == (index, place);
        let role = match (taken.iter().find(is_here), found.iter().find(|it| (it.table, it.column) == (index, place))) {
            (Some((role, _, _, _, unit)), _) => format!("{role}, {unit}"),
            (None, Some(candidate)) => format!("({}?)", candidate.role),
            (None, None) => String::new(),
        };
        text.add_row([
            (place + 1).to_string(),
            short(&column.heading),
            short(column.unit.as_deref().unwrap_or_default()),
            role,
            short(column.cells.get(0)),
            short(column.cells.get(column.cells.len().saturating_sub(1))),
        ]);
    }
    let others = table.columns.len() - shown.len();
    if others > 0 {
        text.add_row(["…".to_owned(), format!("{others} more")]);
    }
    text
}

/// Shortens foreign text to fit a cell.
fn short(text: &str) -> String {
    let shown = printable(text);
    let cut: String = shown.chars().take(WIDEST).collect();
    if cut.len() < shown.len() { cut + "…" } else { cut }
}
