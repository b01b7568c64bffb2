use std::io::Write;

use comfy_table::Table as TextTable;
use ohmstrain_bench_data::counted;
use ohmstrain_bench_data::import::{ChannelSurvey, ClockSurvey, PhaseSurvey, Role, Survey, Table, candidates};

use super::{Findings, Proposal};
use crate::error::CliError;
use crate::output;
use crate::printable::printable;

/// Characters of a cell that are shown.
const WIDEST: usize = 24;
/// Columns of a file that are shown.
const MOST_COLUMNS: usize = 24;

/// Prints what was found, and the command or the question that follows from it.
pub fn write(out: &mut dyn Write, findings: &Findings) -> Result<(), CliError> {
    for (index, table) in findings.tables.iter().enumerate() {
        writeln!(out, "{}: {}", printable(&table.file), layout(table))?;
        writeln!(out, "{}\n", columns(findings, index))?;
    }
    match &findings.plan {
        Ok(proposal) => write_proposal(out, proposal),
        Err(question) => Ok(writeln!(out, "before it can be imported: {question}")?),
    }
}

fn write_proposal(out: &mut dyn Write, proposal: &Proposal) -> Result<(), CliError> {
    let Survey { clock, readings, reference, phases, drift, alternation, lag, lag_unknown } = &proposal.survey;
    writeln!(out, "clock       {}", clock_line(clock))?;
    writeln!(out, "readings    {}", channel_line(readings))?;
    if let Some(allan) = allan_line(readings, reference.is_some()) {
        writeln!(out, "            {allan}")?;
    }
    if let Some(share) = alternation {
        writeln!(out, "polarity    flips with every reading: neighbours differ by {:.2} %", 100.0 * share)?;
    }
    if let Some(drift) = drift {
        let rest = if reference.is_some() { "at rest, from the first to the last time" } else { "from start to end" };
        writeln!(out, "drift       {:+.2} % {rest}", 100.0 * drift)?;
    }
    if let Some(reference) = reference {
        writeln!(out, "reference   {}", channel_line(reference))?;
    }
    if let Some(phases) = phases {
        writeln!(out, "phases      {}", phases_line(phases))?;
    }
    match (lag, lag_unknown) {
        (Some(lag), _) => {
            let (word, seconds) = if lag.lag_s < 0.0 { ("leads", -lag.lag_s) } else { ("lags", lag.lag_s) };
            let doubt = if lag.is_sure() { "" } else { "; without a lag they are explained about as well" };
            writeln!(
                out,
                "lag         the reference {word} the readings by {seconds:.3} ± {:.3} s, of which ± {:.3} s may be the sensor's own{doubt}",
                lag.sd_s.hypot(lag.own_s),
                lag.own_s
            )?;
        }
        (None, Some(why)) => writeln!(out, "lag         not known: {why}")?,
        (None, None) => {}
    }
    for remark in &proposal.remarks {
        writeln!(out, "note        {remark}")?;
    }
    match &proposal.next {
        Some(next) => Ok(writeln!(out, "\nit is a trace already and needs no import; go on with\n{next}")?),
        None => Ok(writeln!(out, "\nimport it with\n{}", proposal.command)?),
    }
}

/// How a file is written, in words.
fn layout(table: &Table) -> String {
    let layout = &table.layout;
    let mut words = vec![layout.format.clone()];
    words.extend(layout.encoding.map(str::to_owned));
    words.extend(layout.separator.map(|separator| format!("separated by {separator}")));
    if layout.separator.is_some() {
        words.push(format!("decimal mark `{}`", layout.decimal));
    }
    if layout.is_exchanged {
        words.push("rows and columns seem to be exchanged".to_owned());
    }
    if layout.values_in_turn {
        words.push("values in turn, a line each".to_owned());
    }
    if layout.skip > 0 {
        words.push(format!("{} above the header", counted(layout.skip, "line")));
    }
    words.push(match layout.header_lines {
        0 if table.has_names() => "names from the file itself".to_owned(),
        0 => "no header".to_owned(),
        1 => "1 header line".to_owned(),
        lines => format!("{lines} header lines"),
    });
    if layout.unit_line {
        words.push("a line of units".to_owned());
    }
    words.push(counted(table.len(), "row"));
    words.join(", ")
}

/// A row for each column: what it may be, or is proposed to be.
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
    // The columns that are something first, if not all can be shown.
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

/// Foreign text that fits a cell.
fn short(text: &str) -> String {
    let shown = printable(text);
    let cut: String = shown.chars().take(WIDEST).collect();
    if cut.len() < shown.len() { cut + "…" } else { cut }
}

fn clock_line(clock: &ClockSurvey) -> String {
    let ms = |seconds: f64| number(1e3 * seconds);
    let mut line = format!(
        "{} Hz: steps of {} ms, nine in ten from {} to {} ms; {} s",
        number(1.0 / clock.step_s),
        ms(clock.step_s),
        ms(clock.step_range_s.0),
        ms(clock.step_range_s.1),
        number(clock.span_s.1 - clock.span_s.0)
    );
    if clock.gaps.0 > 0 {
        line += &format!("; {}, the longest {} s", counted(clock.gaps.0, "gap"), number(clock.gaps.1));
    }
    line + &format!("; {}", counted(clock.duplicates, "duplicate"))
}

fn channel_line(channel: &ChannelSurvey) -> String {
    let mut line = format!("{} to {}, {} missing", number(channel.range.0), number(channel.range.1), channel.counts.1);
    for (count, end) in [(channel.clipped.0, "smallest"), (channel.clipped.1, "largest")] {
        if count > 0 {
            line += &format!("; {count} clipped at the {end}");
        }
    }
    format!("{line}; noise {} from row to row", number(channel.noise))
}

fn allan_line(channel: &ChannelSurvey, has_reference: bool) -> Option<String> {
    let first = channel.allan.first()?;
    let least = channel.allan.iter().min_by(|a, b| a.deviation.total_cmp(&b.deviation))?;
    let at = |deviation: f64, tau_s: f64| format!("{} over {} s", number(deviation), number(tau_s));
    Some(format!(
        "Allan deviation{} {}, least {}",
        if has_reference { " in the longest hold" } else { "" },
        at(first.deviation, first.tau_s),
        at(least.deviation, least.tau_s)
    ))
}

fn phases_line(survey: &PhaseSurvey) -> String {
    let names = [("stretch", "stretches"), ("hold", "holds"), ("release", "releases")];
    let phases = survey.phases.iter().zip(names).map(|((count, seconds), (one, many))| {
        format!("{count} {} ({} s)", if *count == 1 { one } else { many }, number(*seconds))
    });
    phases.collect::<Vec<_>>().join(", ")
}

/// Four digits.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
