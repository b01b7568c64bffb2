use std::collections::HashMap;

use crate::import::table::grid::{SAMPLE, Separator, behind_arrow, split};
use crate::import::words::{DecimalMark, Value, amount, is_stamp};

/// Finds the separator and the decimal mark with which most cells are numbers and fewest are text. Also returns whether the mark is
/// ambiguous because all evidence is of the form `1,234`.
///
/// `monitor`: lines begin with the clock of a serial monitor.
pub(crate) fn text_layout(
    lines: &[(u64, &str)],
    monitor: bool,
    decimal: Option<DecimalMark>,
) -> (Separator, DecimalMark, bool) {
    let sample = || lines.iter().take(SAMPLE).map(|(_, line)| *line);
    let bodies: Vec<&str> = sample().map(|line| if monitor { behind_arrow(line) } else { line }).collect();
    let marks = decimal.map_or(vec![DecimalMark::Point, DecimalMark::Comma], |mark| vec![mark]);
    let mut best = (i64::MIN, Separator::Comma, marks[0]);
    for separator in Separator::CELLS {
        for &mark in &marks {
            let score = score(&bodies, separator, mark, decimal.is_some());
            if score > best.0 {
                best = (score, separator, mark);
            }
        }
    }
    let (_, separator, mark) = best;
    (separator, mark, decimal.is_none() && mark_is_open(lines, separator, mark))
}

/// Counts numbers minus texts, in lines of the best width. Numbers with marks of thousands count if `groups`.
fn score(lines: &[&str], separator: Separator, mark: DecimalMark, groups: bool) -> i64 {
    let mut by_width = HashMap::<usize, i64>::new();
    for line in lines {
        let cells = split(line, separator);
        let (numbers, texts) = cells.iter().fold((0, 0), |(numbers, texts), cell| match kind(cell, mark, groups) {
            Value::Number(_) => (numbers + 1, texts),
            Value::Text => (numbers, texts + 1),
            Value::Missing => (numbers, texts),
        });
        if numbers == 0 {
            continue;
        }
        *by_width.entry(cells.len()).or_default() += numbers - texts;
    }
    by_width.into_values().max().unwrap_or(0)
}

fn kind(cell: &str, mark: DecimalMark, groups: bool) -> Value {
    let (own, other) = if mark == DecimalMark::Point { ('.', ',') } else { (',', '.') };
    if is_stamp(cell) {
        return Value::Number(0.0);
    }
    match amount(cell, mark) {
        // Unless the decimal mark is known, the other mark counts as a decimal mark, not as a thousands mark.
        Value::Number(_) if !groups && cell.contains(other) && !cell.contains(own) => Value::Text,
        kind => kind,
    }
}

/// True if every cell with a mark is also a number with the other one: `1,234`, one to three digits before, three after it.
fn mark_is_open(lines: &[(u64, &str)], separator: Separator, mark: DecimalMark) -> bool {
    if mark == DecimalMark::Point {
        // In `1.234`, points group thousands only if commas are decimal marks, and then some cell would have a comma.
        return false;
    }
    let mut some = false;
    for (_, line) in lines {
        for cell in split(line, separator) {
            if cell.contains(',') && matches!(amount(&cell, DecimalMark::Comma), Value::Number(_)) {
                let grouped = matches!(amount(&cell, DecimalMark::Point), Value::Number(_));
                if !grouped || cell.trim_start_matches(['-', '+']).starts_with('0') {
                    return false;
                }
                some = true;
            }
        }
    }
    some
}
