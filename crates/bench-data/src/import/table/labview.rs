//! LabVIEW measurement files. Without a column of times, these follow from `X0` and `Delta_X` in the header of each segment.

use crate::error::{Fault, quote};
use crate::import::bytes::{Cell, Rows};
use crate::import::words::{DecimalMark, number, units};

/// Start of the first line, end of a header, and the first key of a segment's header.
const MAGIC: &str = "LabVIEW Measurement";
const END: &str = "***End_of_Header***";
const SEGMENT: &str = "Channels";
/// Number of decimals of a time whose step is written with an exponent.
const MOST_DECIMALS: usize = 12;

/// Columns of times in a file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Times {
    /// None.
    Computed,
    /// The first column.
    One,
    /// One before the column of each channel.
    Multi,
}

/// Returns the names and rows of such a file, each row after its time, and its decimal mark; `None` if the file is of another kind.
///
/// # Errors
/// The line and the fault, if channels of a segment have different steps.
pub(crate) fn rows<'a>(lines: &[(u64, &'a str)]) -> Option<Result<(Rows<'a>, DecimalMark), (u64, Fault)>> {
    let first = lines.first()?.1.trim_start_matches('\u{feff}').trim_start();
    let end = lines.iter().position(|(_, line)| line.starts_with(END)).filter(|_| first.starts_with(MAGIC))?;
    let separator = if value(&lines[..end], "Separator") == Some("Comma") { ',' } else { '\t' };
    let keys = |key| lines[..end].iter().find_map(|(_, line)| line.strip_prefix(key)?.strip_prefix(separator));
    let times = match keys("X_Columns")?.trim() {
        "No" => Times::Computed,
        "One" => Times::One,
        "Multi" => Times::Multi,
        _ => return None,
    };
    let is_comma = keys("Decimal_Separator").is_some_and(|mark| mark.trim() == ",");
    let decimal = if is_comma { DecimalMark::Comma } else { DecimalMark::Point };
    let (mut out, mut segment) = (Rows::new(), Segment::default());
    let (mut in_header, mut has_names) = (true, false);
    for &(line, text) in &lines[end + 1..] {
        let cells: Vec<&str> = text.split(separator).map(str::trim).collect();
        if cells[0] == SEGMENT {
            (in_header, segment) = (true, Segment::default());
        }
        if cells[0] == END {
            (in_header, has_names) = (false, false);
        } else if in_header {
            // With columns of times, the steps do not matter.
            if let (Times::Computed, ["Delta_X", first, others @ ..]) = (times, &cells[..])
                && let Some(other) = others.iter().find(|other| !other.is_empty() && *other != first)
            {
                return Some(Err((
                    line,
                    Fault::new(format!("one step between rows, {first}, for all channels"), quote(other)),
                )));
            }
            segment.take(&cells);
        } else if !has_names {
            has_names = true;
            let names = segment.names(&cells, times);
            // Later segments repeat the names of the first, or are another table.
            if out.first().is_none_or(|(_, first)| *first != names) {
                out.push((line, names));
            }
        } else if times == Times::Computed {
            out.push((line, segment.row(&cells, decimal)?));
        } else {
            out.push((line, cells.iter().map(|cell| Cell::text(cell)).collect()));
        }
    }
    Some(Ok((out, decimal)))
}

/// Header of a segment.
#[derive(Default)]
struct Segment<'a> {
    /// The first time, and the step from row to row.
    first: &'a str,
    step: &'a str,
    units: Vec<&'a str>,
    rows: u32,
}

impl<'a> Segment<'a> {
    fn take(&mut self, cells: &[&'a str]) {
        match cells {
            ["X0", first, ..] => self.first = first,
            ["Delta_X", step, ..] => self.step = step,
            ["Y_Unit_Label", units @ ..] => self.units = units.to_vec(),
            _ => {}
        }
    }

    /// Returns the names of the columns, each with its unit from the header.
    fn names(&self, cells: &[&'a str], times: Times) -> Vec<Cell<'a>> {
        let channel = |(place, name): (usize, &&'a str)| {
            let unit = match times {
                Times::Multi if place % 2 == 1 => return Cell::text(name),
                Times::Multi => self.units.get(place / 2),
                Times::Computed | Times::One => self.units.get(place),
            };
            match unit {
                Some(unit) if units::is_unit(unit) && !name.ends_with(')') => {
                    Cell::Text(format!("{name} ({unit})").into())
                }
                _ => Cell::text(name),
            }
        };
        let first = if times == Times::Computed { "Time (s)" } else { cells[0] };
        [Cell::text(first)].into_iter().chain(cells[1..].iter().enumerate().map(channel)).collect()
    }

    /// Returns the next row, after its time; `None` if the header has no step between rows.
    fn row(&mut self, cells: &[&'a str], decimal: DecimalMark) -> Option<Vec<Cell<'a>>> {
        let step = number(self.step, decimal, 0)?;
        let first = number(self.first, decimal, 0).unwrap_or(0.0);
        let decimals = |text: &str| match text.split_once(decimal.character()) {
            _ if text.contains(['e', 'E']) => MOST_DECIMALS,
            Some((_, fraction)) => fraction.len().min(MOST_DECIMALS),
            None => 0,
        };
        let decimals = decimals(self.step).max(decimals(self.first));
        let time = format!("{:.decimals$}", first + step * f64::from(self.rows));
        self.rows += 1;
        let time = Cell::Number(time.parse().ok()?);
        Some([time].into_iter().chain(cells[1..].iter().map(|cell| Cell::text(cell))).collect())
    }
}

/// Returns the value after a key, whatever separates them.
fn value<'a>(lines: &[(u64, &'a str)], key: &str) -> Option<&'a str> {
    let behind = lines.iter().find_map(|(_, line)| line.strip_prefix(key))?;
    behind.split(['\t', ',']).nth(1).map(str::trim)
}
