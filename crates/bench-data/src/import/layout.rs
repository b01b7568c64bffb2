use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::MOST_ROWS;
use crate::error::Fault;
use crate::import::bounds::LONGEST_LINE;
use crate::import::grid::{Separator, behind_arrow, split};
use crate::import::number::{DecimalMark, Value, ohms, value};
use crate::import::stamp::is_stamp;

/// Lines looked at to find out how a file is written.
pub(crate) const SAMPLE: usize = 1000;
/// Text has fewer NUL bytes than one in so many.
const MOST_NULS: usize = 50;

/// Text out of bytes, and what it was encoded in.
///
/// A byte-order mark decides; without one, NUL bytes in every other place mean UTF-16, and what is not UTF-8 is taken for
/// Windows-1252, which has Latin-1 in it and gives every byte a character. `None` for what is no text.
pub(crate) fn decode(bytes: &[u8]) -> Option<(Cow<'_, str>, &'static str)> {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        let name = if encoding == UTF_8 { "UTF-8 with a byte-order mark" } else { encoding.name() };
        return Some((encoding.decode_without_bom_handling(&bytes[mark..]).0, name));
    }
    let head = &bytes[..bytes.len().min(2000)];
    if head.contains(&0) {
        let nuls = |odd: usize| head.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
        let (even, odd) = (nuls(0), nuls(1));
        let encoding = match (even, odd) {
            (0, odd) if odd * 4 > head.len() => Some(UTF_16LE),
            (even, 0) if even * 4 > head.len() => Some(UTF_16BE),
            // A few are what a serial line brings when it is opened.
            (even, odd) if (even + odd) * MOST_NULS < head.len() => None,
            _ => return None,
        };
        if let Some(encoding) = encoding {
            return Some((encoding.decode_without_bom_handling(bytes).0, encoding.name()));
        }
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Some((text.into(), if text.is_ascii() { "ASCII" } else { "UTF-8" })),
        Err(_) => Some((WINDOWS_1252.decode_without_bom_handling(bytes).0, "Latin-1 (Windows-1252)")),
    }
}

/// Lines that are not blank, with their numbers, whatever ends them.
///
/// # Errors
/// The line that is too long, or one too many.
pub(crate) fn lines(text: &str) -> Result<Vec<(u64, &str)>, (u64, Fault)> {
    let ends: &[char] = if text.contains('\n') { &['\n'] } else { &['\r', '\n'] };
    let numbered = text.split(ends).zip(1..).map(|(line, number)| (number, line.trim_end_matches('\r')));
    let mut lines = Vec::new();
    for (number, line) in numbered.filter(|(_, line)| !line.trim().is_empty()) {
        if line.len() > LONGEST_LINE {
            return Err((number, Fault::new(format!("a line of at most {LONGEST_LINE} bytes"), "a longer one")));
        }
        if lines.len() == MOST_ROWS {
            let expected = format!("at most {MOST_ROWS} rows: make several files of it");
            return Err((number, Fault::new(expected, "more")));
        }
        lines.push((number, line));
    }
    Ok(lines)
}

/// How text is written.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TextLayout {
    pub separator: Separator,
    pub decimal: DecimalMark,
    /// Only cells like `1,234` speak for the mark.
    pub decimal_is_open: bool,
}

/// Finds separator and decimal mark: those under which most cells are numbers and fewest are text.
///
/// `monitor`: lines begin with the clock of a serial monitor.
pub(crate) fn text_layout(lines: &[(u64, &str)], monitor: bool, decimal: Option<DecimalMark>) -> TextLayout {
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
    let decimal_is_open = decimal.is_none() && mark_is_open(lines, separator, mark);
    TextLayout { separator, decimal: mark, decimal_is_open }
}

/// Numbers less texts, in lines of the best width. Numbers with marks of thousands count if `groups` says so.
fn score(lines: &[&str], separator: Separator, mark: DecimalMark, groups: bool) -> i64 {
    let mut by_width: Vec<(usize, i64)> = Vec::new();
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
        match by_width.iter_mut().find(|(width, _)| *width == cells.len()) {
            Some((_, score)) => *score += numbers - texts,
            None => by_width.push((cells.len(), numbers - texts)),
        }
    }
    by_width.into_iter().map(|(_, score)| score).max().unwrap_or(0)
}

fn kind(cell: &str, mark: DecimalMark, groups: bool) -> Value {
    let (own, other) = if mark == DecimalMark::Point { ('.', ',') } else { (',', '.') };
    if is_stamp(cell) {
        return Value::Number(0.0);
    }
    match amount(cell, mark) {
        // Unless the mark is known, the other one is taken for the mark, not for thousands.
        Value::Number(_) if !groups && cell.contains(other) && !cell.contains(own) => Value::Text,
        kind => kind,
    }
}

/// What a cell is where ohms may have a prefix.
fn amount(cell: &str, mark: DecimalMark) -> Value {
    match value(cell, mark, 0, &[]) {
        Value::Text => ohms(cell, mark).map_or(Value::Text, Value::Number),
        known => known,
    }
}

/// Whether every cell with a mark is as good with the other one: `1,234`, one to three digits before, three behind.
fn mark_is_open(lines: &[(u64, &str)], separator: Separator, mark: DecimalMark) -> bool {
    if mark == DecimalMark::Point {
        // `1.234`: points group thousands in files with decimal commas only, and then some cell would have a comma.
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
