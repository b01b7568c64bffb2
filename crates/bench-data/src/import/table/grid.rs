//! Lines split into cells.

use std::borrow::Cow;

use crate::import::bytes::{Cell, Rows};
use crate::import::words::is_stamp;

/// Number of lines examined to determine the format of a file.
pub(crate) const SAMPLE: usize = 1000;

/// Text that a serial monitor puts between its clock and the line.
pub(crate) const ARROW: &str = " -> ";

/// The name of the clock that a serial monitor writes.
pub(crate) const MONITOR_CLOCK: &str = "monitor clock";

/// Separator of the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Tab,
    Semicolon,
    Comma,
    Pipe,
    Spaces,
}

impl Separator {
    /// Separators between cells; if two fit a file equally well, the first one wins.
    pub(crate) const CELLS: [Self; 5] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Pipe, Self::Spaces];

    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Tab => "tabs",
            Self::Semicolon => "semicolons",
            Self::Comma => "commas",
            Self::Pipe => "bars",
            Self::Spaces => "spaces",
        }
    }

    pub(crate) const fn byte(self) -> Option<u8> {
        match self {
            Self::Tab => Some(b'\t'),
            Self::Semicolon => Some(b';'),
            Self::Comma => Some(b','),
            Self::Pipe => Some(b'|'),
            Self::Spaces => None,
        }
    }
}

/// True if most of some lines begin with a time of day and an arrow.
pub(crate) fn is_monitor<'a>(lines: impl Iterator<Item = &'a str>) -> bool {
    let (mut all, mut arrows) = (0_usize, 0_usize);
    for line in lines {
        all += 1;
        arrows += usize::from(line.split_once(ARROW).is_some_and(|(clock, _)| is_stamp(clock)));
    }
    arrows * 10 > all * 8
}

/// Returns the part of a line after the clock of a serial monitor.
pub(crate) fn behind_arrow(line: &str) -> &str {
    line.split_once(ARROW).map_or(line, |(_, rest)| rest)
}

/// Splits a line of text into cells.
pub(crate) fn split(line: &str, separator: Separator) -> Vec<Cow<'_, str>> {
    let Some(byte) = separator.byte() else {
        return line.split([' ', '\u{a0}']).filter(|cell| !cell.is_empty()).map(|cell| unquoted(cell).into()).collect();
    };
    if !line.contains('"') {
        return line.split(char::from(byte)).map(|cell| Cow::from(cell.trim())).collect();
    }
    quoted(line, byte)
        .unwrap_or_else(|| line.split(char::from(byte)).map(|cell| unquoted(cell.trim()).into()).collect())
}

fn unquoted(cell: &str) -> &str {
    cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).unwrap_or(cell)
}

/// Splits a line with quotation marks into cells.
fn quoted(line: &str, byte: u8) -> Option<Vec<Cow<'static, str>>> {
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(byte)
        .has_headers(false)
        .buffer_capacity(line.len() + 1)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    let record = reader.records().next()?.ok()?;
    Some(record.iter().map(|cell| Cow::from(cell.trim().to_owned())).collect())
}

/// A file as lines of cells, whatever its container.
pub(crate) enum Grid<'a> {
    /// Lines of text with their numbers in the file.
    Text {
        lines: Vec<(u64, &'a str)>,
        separator: Separator,
        monitor: bool,
        /// True if the last line has no end and may have been truncated.
        is_open: bool,
    },
    /// Rows of a sheet, or records.
    Rows(Rows<'a>),
}

impl Grid<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Text { lines, .. } => lines.len(),
            Self::Rows(rows) => rows.len(),
        }
    }

    /// True if the first cell of each line is the clock of a serial monitor.
    pub(crate) const fn has_monitor_clock(&self) -> bool {
        matches!(self, Self::Text { monitor: true, .. })
    }

    pub(crate) fn line(&self, row: usize) -> u64 {
        match self {
            Self::Text { lines, .. } => lines[row].0,
            Self::Rows(rows) => rows[row].0,
        }
    }

    /// Returns the cells of a line.
    pub(crate) fn cells(&self, row: usize) -> Cow<'_, [Cell<'_>]> {
        match self {
            Self::Rows(rows) => rows[row].1.as_slice().into(),
            Self::Text { lines, separator, monitor, .. } => {
                let line = lines[row].1;
                let (clock, rest) = match line.split_once(ARROW).filter(|_| *monitor) {
                    Some((clock, rest)) => (Some(clock), Some(rest)),
                    None if *monitor => (Some(line), None),
                    None => (None, Some(line)),
                };
                let rest = rest.into_iter().flat_map(|rest| split(rest, *separator));
                clock.map(Cell::text).into_iter().chain(rest.map(Cell::Text)).collect::<Vec<_>>().into()
            }
        }
    }

    /// Returns the text of a comment line, without its mark.
    pub(crate) fn comment(&self, row: usize) -> Option<&str> {
        match self {
            Self::Rows(_) => None,
            Self::Text { lines, separator, .. } => {
                let line = lines[row].1.trim_start();
                let mark = ["//", "#", "%"].into_iter().find(|mark| line.starts_with(mark))?;
                let rest = &line[mark.len()..];
                // `%;s;Ohm` is a line of units, `#,Time,R` one of names. A tab is also a blank, so this is checked
                // before trimming.
                let is_cell =
                    separator.byte().is_some_and(|byte| rest.trim_start_matches(' ').as_bytes().first() == Some(&byte));
                (!is_cell).then_some(rest.trim())
            }
        }
    }
}
