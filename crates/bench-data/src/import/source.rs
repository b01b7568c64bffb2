use std::io::Read;

use crate::import::error::ImportError;
use crate::import::grid::{Grid, Separator};
use crate::import::header::{Header, Shape};
use crate::import::layout::{TextLayout, decode, lines, text_layout};
use crate::import::number::DecimalMark;
use crate::import::table::{Cells, Column, Layout, Table};
use crate::import::{names, parquet, workbook};

/// What is known of a file before it is read; what is not is found out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The decimal mark.
    pub decimal: Option<DecimalMark>,
    /// Lines above header and data.
    pub skip: Option<usize>,
    /// The sheet of a workbook.
    pub sheet: Option<String>,
}

/// Most bytes that a compressed file may unpack to, 4 GiB: a bound on what a small file can do.
const LARGEST_UNPACKED: u64 = 1 << 32;

/// Reads a file of any kind: text, XLSX and its relatives, Parquet, each of them in gzip too. `name` is what messages call
/// it.
///
/// # Errors
/// [`ImportError`] if it is nothing of that kind, or has no rows of numbers.
pub fn read_table(bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut inner = Vec::new();
        let unpacked =
            flate2::read::MultiGzDecoder::new(bytes.as_slice()).take(LARGEST_UNPACKED).read_to_end(&mut inner);
        unpacked.map_err(|error| ImportError::unreadable(name, format!("expected gzip data, found {error}")))?;
        let mut table = read_table(inner, name, options)?;
        table.layout.format = format!("gzip, {}", table.layout.format);
        return Ok(table);
    }
    if bytes.starts_with(b"PAR1") {
        return parquet::read(bytes, name);
    }
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(&[0xd0, 0xcf, 0x11, 0xe0]) {
        return workbook::read(bytes, name, options);
    }
    let Some((text, encoding)) = decode(&bytes) else {
        let what = "expected text, XLSX or Parquet, perhaps in gzip, found binary data";
        return Err(ImportError::unreadable(name, what));
    };
    read_text(&text, encoding, name, options)
}

fn read_text(text: &str, encoding: &'static str, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let lines = lines(text);
    let skip = options.skip.unwrap_or(0);
    let below = lines.partition_point(|(number, _)| *number <= skip as u64);
    let written = text_layout(&lines[below..], options.decimal);
    let TextLayout { separator, decimal, decimal_is_open, labels, monitor } = written;
    let layout = Layout {
        format: "text".to_owned(),
        encoding: Some(encoding),
        separator: Some(separator.words()),
        decimal,
        decimal_is_open,
        ..Layout::default()
    };
    let label_header = (separator == Separator::Labels).then(|| Header::of_labels(&labels, monitor, skip, below));
    let is_open = !text.ends_with(['\n', '\r']);
    let grid = Grid::Text { lines, separator, labels, monitor, is_open };
    let header = match label_header {
        Some(header) => header,
        None => Header::find(name, &grid, decimal, skip)?,
    };
    Ok(table(name, &grid, header, layout))
}

/// Where the lines begin that stand behind the data: text, sums with a word before them, and a line that was cut.
fn end_of_data(grid: &Grid, header: &Header, decimal: DecimalMark) -> usize {
    let is_behind = |row: &usize| {
        let shape = Shape::of(&grid.cells(*row), decimal);
        let is_cut = *row + 1 == grid.len()
            && matches!(grid, Grid::Text { is_open: true, .. })
            && shape.width < header.shape.width
            && shape.numbers < header.shape.numbers;
        grid.comment(*row).is_some() || shape.numbers == 0 || shape.is_worded(header.shape) || is_cut
    };
    (header.first_row..grid.len()).rev().take_while(is_behind).last().unwrap_or(grid.len())
}

/// A table out of lines of cells.
pub(crate) fn table(file: &str, grid: &Grid, header: Header, layout: Layout) -> Table {
    let mut layout =
        Layout { skip: header.skip, header_lines: header.header_lines, unit_line: header.unit_line, ..layout };
    let mut cells = vec![Cells::default(); header.shape.width];
    let (mut numbers, mut widths) = (Vec::new(), Vec::new());
    let end = end_of_data(grid, &header, layout.decimal);
    for row in header.first_row..grid.len() {
        let line = grid.cells(row);
        if row >= end || grid.comment(row).is_some() || Shape::of(&line, layout.decimal).numbers == 0 {
            layout.text_lines += 1;
            layout.first_text_line.get_or_insert(grid.line(row));
            continue;
        }
        widths.push(line.len());
        if !layout.has_groups {
            layout.has_groups = line.iter().any(|cell| crate::import::number::has_groups(cell, layout.decimal));
        }
        numbers.push(grid.line(row));
        for (column, cells) in cells.iter_mut().enumerate() {
            cells.push(line.get(column).map_or("", |cell| cell));
        }
    }
    let columns = header.headings.iter().zip(&header.units).zip(cells).map(|((heading, unit), cells)| {
        let (name, own) = names::take_apart(heading);
        Column { name, heading: heading.clone(), unit: unit.clone().or(own), cells }
    });
    // A separator at the end of each line makes a column of nothing.
    let mut columns: Vec<Column> = columns.collect();
    while columns.last().is_some_and(|last| last.heading.is_empty() && last.cells.iter().all(str::is_empty)) {
        columns.pop();
    }
    layout.short_lines = widths.into_iter().filter(|width| *width < columns.len()).count();
    Table { file: file.to_owned(), layout, metadata: header.metadata, columns, lines: numbers }
}
