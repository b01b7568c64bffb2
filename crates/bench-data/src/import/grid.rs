use std::borrow::Cow;

use crate::import::records::Records;
use crate::import::stamp::is_stamp;

/// What separates the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Separator {
    Tab,
    Semicolon,
    Comma,
    Pipe,
    Spaces,
}

impl Separator {
    /// Those between cells; where two explain a file alike, the first.
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

    const fn byte(self) -> Option<u8> {
        match self {
            Self::Tab => Some(b'\t'),
            Self::Semicolon => Some(b';'),
            Self::Comma => Some(b','),
            Self::Pipe => Some(b'|'),
            Self::Spaces => None,
        }
    }
}

/// A file as lines of cells, however they are kept.
pub(crate) enum Grid<'a> {
    /// Lines of text with their numbers in the file.
    Text {
        lines: Vec<(u64, &'a str)>,
        separator: Separator,
        monitor: bool,
        /// The last line has no end: it may have been cut.
        is_open: bool,
    },
    /// Cells of a sheet, with their rows in it.
    Sheet(Vec<(u64, Vec<String>)>),
    /// Records `label: value`.
    Records(Records<'a>),
}

/// What a serial monitor puts between its clock and the line.
pub(crate) const ARROW: &str = " -> ";

impl Grid<'_> {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Text { lines, .. } => lines.len(),
            Self::Sheet(rows) => rows.len(),
            Self::Records(records) => records.len(),
        }
    }

    pub(crate) fn line(&self, row: usize) -> u64 {
        match self {
            Self::Text { lines, .. } => lines[row].0,
            Self::Sheet(rows) => rows[row].0,
            Self::Records(records) => records.line(row),
        }
    }

    /// The cells of a line, without blanks around them.
    pub(crate) fn cells(&self, row: usize) -> Vec<Cow<'_, str>> {
        match self {
            Self::Sheet(rows) => rows[row].1.iter().map(|cell| Cow::from(cell.trim())).collect(),
            Self::Records(records) => records.cells(row),
            Self::Text { lines, separator, monitor, .. } => {
                let line = lines[row].1;
                match (monitor, line.split_once(ARROW)) {
                    (true, Some((clock, rest))) => {
                        let mut cells = vec![Cow::from(clock.trim())];
                        cells.extend(split(rest, *separator));
                        cells
                    }
                    (true, None) => vec![Cow::from(line)],
                    (false, _) => split(line, *separator),
                }
            }
        }
    }

    /// The text of a comment line, without its mark.
    pub(crate) fn comment(&self, row: usize) -> Option<&str> {
        match self {
            Self::Sheet(_) | Self::Records(_) => None,
            Self::Text { lines, separator, .. } => {
                let line = lines[row].1.trim_start();
                let mark = ["//", "#", "%"].into_iter().find(|mark| line.starts_with(mark))?;
                let rest = &line[mark.len()..];
                // `%;s;Ohm` is a line of units, `#,Time,R` one of names. A tab is a blank too: look before trimming.
                let is_cell =
                    separator.byte().is_some_and(|byte| rest.trim_start_matches(' ').as_bytes().first() == Some(&byte));
                (!is_cell).then_some(rest.trim())
            }
        }
    }
}

/// Whether most of some lines begin with a time of day and an arrow.
pub(crate) fn is_monitor<'a>(lines: impl Iterator<Item = &'a str>) -> bool {
    let (mut all, mut arrows) = (0_usize, 0_usize);
    for line in lines {
        all += 1;
        arrows += usize::from(line.split_once(ARROW).is_some_and(|(clock, _)| is_stamp(clock)));
    }
    arrows * 10 > all * 8
}

/// The line behind the clock of a serial monitor.
pub(crate) fn behind_arrow(line: &str) -> &str {
    line.split_once(ARROW).map_or(line, |(_, rest)| rest)
}

/// The cells of a line of text.
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

/// The cells of a line with quotation marks.
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
