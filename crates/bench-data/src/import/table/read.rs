use crate::error::{Fault, quote};
use crate::import::bytes::bounds::check_cells;
use crate::import::bytes::text::lines;
use crate::import::bytes::{Cell, Cells, Contents, NamedSheets, RawColumn, open};
use crate::import::error::{ImportError, quoted};
use crate::import::table::columns::{Column, Layout, Table};
use crate::import::table::data::Shape;
use crate::import::table::date_column;
use crate::import::table::fractions;
use crate::import::table::grid::{Grid, SAMPLE, is_monitor};
use crate::import::table::header::Header;
use crate::import::table::layout::text_layout;
use crate::import::table::options::ReadOptions;
use crate::import::table::rate::rate;
use crate::import::table::records::{self, Records};
use crate::import::table::transposed::exchanged;
use crate::import::table::unit_column;
use crate::import::table::value::number_of;
use crate::import::table::{interleaved, json, labview};
use crate::import::words::names::is_quantity;
use crate::import::words::{DecimalMark, has_groups};

/// Reads a file of any kind: text, XLSX and its relatives, Parquet, each also in gzip. `name` is its name in messages.
///
/// # Errors
/// [`ImportError`] if the file is of no such kind, has no rows of numbers, or exceeds a bound.
pub fn read_table(bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let (contents, wrappings) = open(bytes, name, options.sheet.as_deref())?;
    let mut table = match contents {
        Contents::Text(text, encoding) => of_text(&text, encoding, name, options)?,
        Contents::Sheets(sheets) => of_sheets(sheets, name, options)?,
        Contents::Columns(columns, metadata, format) => Table { metadata, ..of_columns(columns, name, format) },
    };
    fractions::join(&mut table);
    date_column::join(&mut table);
    unit_column::take(&mut table);
    options.rows.iter().try_for_each(|filter| table.keep(filter))?;
    table.layout.format.insert_str(0, &wrappings);
    Ok(table)
}

fn of_text(text: &str, encoding: &'static str, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    if let Some(rows) = json::rows(text) {
        let layout = Layout { format: "JSON".to_owned(), encoding: Some(encoding), ..Layout::default() };
        return of_lines(name, &Grid::Rows(rows), layout, 0);
    }
    let lines = lines(text).map_err(|(line, fault)| ImportError::content(name, line, fault))?;
    let skip = options.skip.unwrap_or(0);
    let below = &lines[lines.partition_point(|(number, _)| *number <= skip as u64)..];
    let monitor = is_monitor(below.iter().take(SAMPLE).map(|(_, line)| *line));
    let layout = Layout { format: "text".to_owned(), encoding: Some(encoding), ..Layout::default() };
    let labview = labview::rows(&lines).transpose();
    let labview = labview.map_err(|(line, fault)| ImportError::content(name, line, fault))?;
    if let Some((rows, decimal)) = labview {
        let layout = Layout { format: "LabVIEW measurement".to_owned(), decimal, ..layout };
        return of_lines(name, &Grid::Rows(rows), layout, skip);
    }
    if let Some(records) = Records::find(below, monitor) {
        let (decimal, decimal_is_open) = options.decimal.map_or(records.decimal, |mark| (mark, false));
        let layout = Layout { separator: Some(records::SEPARATOR), decimal, decimal_is_open, ..layout };
        let header = Header::of_records(&records, decimal, skip);
        return of_grid(name, &Grid::Rows(records.rows), header, layout);
    }
    let (separator, decimal, decimal_is_open) = text_layout(below, monitor, options.decimal);
    let layout = Layout { separator: Some(separator.words()), decimal, decimal_is_open, ..layout };
    if let Some(rows) = interleaved::rows(below, decimal).filter(|_| !monitor) {
        let layout = Layout { values_in_turn: true, ..layout };
        return of_lines(name, &Grid::Rows(rows), layout, skip);
    }
    let is_open = !text.ends_with(['\n', '\r']);
    let grid = Grid::Text { lines, separator, monitor, is_open };
    of_lines(name, &grid, layout, skip)
}

/// Makes a table of the lines below `skip` others, which include the header; lines may be columns.
fn of_lines(name: &str, grid: &Grid, layout: Layout, skip: usize) -> Result<Table, ImportError> {
    let decimal = layout.decimal;
    if let Some(rows) = exchanged(grid, decimal).filter(|_| skip == 0) {
        let grid = Grid::Rows(rows);
        let header = Header::find(name, &grid, decimal, 0)?;
        return of_grid(name, &grid, header, Layout { is_exchanged: true, ..layout });
    }
    let header = Header::find(name, grid, decimal, skip)?;
    of_grid(name, grid, header, layout)
}

/// Makes a table of the only sheet with rows of numbers.
fn of_sheets(sheets: NamedSheets, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let decimal = options.decimal.unwrap_or(DecimalMark::Point);
    let (mut found, mut answers, mut last_error) = (Vec::new(), Vec::new(), None);
    for (sheet, rows) in sheets {
        let grid = Grid::Rows(rows);
        let layout = Layout { format: format!("workbook, sheet `{sheet}`"), decimal, ..Layout::default() };
        match of_lines(name, &grid, layout, options.skip.unwrap_or(0)) {
            Ok(table) => {
                found.push(table);
                answers.push(format!("--sheet {}", quoted(&sheet)));
            }
            Err(error) => last_error = Some(error),
        }
    }
    match (found.pop(), last_error) {
        (Some(table), _) if found.is_empty() => Ok(table),
        (None, Some(error)) => Err(error),
        _ => Err(ImportError::question(name, "several sheets have rows of numbers", answers)),
    }
}

fn of_columns(columns: Vec<RawColumn>, name: &str, format: &str) -> Table {
    let rows = columns.first().map_or(0, |column| column.cells.len() as u64);
    let columns = columns.into_iter().map(|raw| Column::new(raw.heading, raw.unit, raw.cells)).collect();
    let layout = Layout { format: format.to_owned(), ..Layout::default() };
    Table { file: name.to_owned(), layout, columns, lines: (1..=rows).collect(), ..Table::default() }
}

/// Makes a table of lines of cells.
///
/// # Errors
/// If it has too many cells.
fn of_grid(file: &str, grid: &Grid, header: Header, layout: Layout) -> Result<Table, ImportError> {
    check_cells(file, grid.len(), header.shape.width)?;
    let mut layout = Layout {
        skip: header.skip,
        header_lines: header.header_lines,
        unit_line: header.unit_line,
        given_names: header.given_names,
        rate: rate(grid, layout.decimal, header.first_row),
        ..layout
    };
    let mut cells = vec![Cells::default(); header.shape.width];
    let (mut numbers, mut widths) = (Vec::new(), Vec::new());
    let end = end_of_data(grid, &header, layout.decimal);
    for row in header.first_row..grid.len() {
        let line = grid.cells(row);
        if row >= end || grid.comment(row).is_some() || Shape::of(&line, layout.decimal).numbers == 0 {
            if header.header_lines == 1 && names_others(&line, &header.headings) {
                let names = header.headings.join(", ");
                let found = line.iter().map(Cell::to_string).collect::<Vec<_>>().join(", ");
                let expected = format!("columns {names}, as above");
                let fault = Fault::new(expected, format!("{}: make files of their own of such parts", quote(&found)));
                return Err(ImportError::content(file, grid.line(row), fault));
            }
            layout.text_lines += 1;
            layout.first_text_line.get_or_insert(grid.line(row));
            continue;
        }
        let width = header.shape.width;
        if let Some(beyond) = line.iter().skip(width).find(|cell| number_of(cell, layout.decimal).is_some()) {
            let found = format!("{}, the first beyond them {}", line.len(), quote(&beyond.to_string()));
            let fault = Fault::new(format!("{width} cells, as in most lines"), found);
            return Err(ImportError::content(file, grid.line(row), fault));
        }
        widths.push(line.len());
        if !layout.has_groups {
            let has_groups = |cell: &Cell| matches!(cell, Cell::Text(text) if has_groups(text, layout.decimal));
            layout.has_groups = line.iter().any(has_groups);
        }
        numbers.push(grid.line(row));
        for (column, cells) in cells.iter_mut().enumerate() {
            cells.push_cell(line.get(column).unwrap_or(&Cell::Empty));
        }
    }
    let named = header.headings.into_iter().zip(header.units).zip(cells);
    let mut columns: Vec<Column> = named.map(|((heading, unit), cells)| Column::new(heading, unit, cells)).collect();
    // A separator at the end of each line makes an empty column.
    while columns.last().is_some_and(|last| last.heading.is_empty() && last.cells.iter().all(str::is_empty)) {
        columns.pop();
    }
    layout.short_lines = widths.into_iter().filter(|width| *width < columns.len()).count();
    Ok(Table { file: file.to_owned(), layout, metadata: header.metadata, columns, lines: numbers })
}

/// True if a line names columns, at least one of them a quantity, and not those of the header: another table begins.
fn names_others(line: &[Cell], headings: &[String]) -> bool {
    let names: Vec<String> = line.iter().map(Cell::to_string).collect();
    names.len() >= headings.len()
        && names.iter().zip(headings).any(|(name, heading)| name != heading && !heading.is_empty() && is_quantity(name))
}

/// Returns the first line after the data: text, sums after a word, or a truncated line.
fn end_of_data(grid: &Grid, header: &Header, decimal: DecimalMark) -> usize {
    let is_behind = |row: &usize| {
        let cells = grid.cells(*row);
        let shape = Shape::of(&cells, decimal);
        let is_sum = shape.is_worded(header.shape)
            && cells
                .first()
                .is_some_and(|cell| matches!(cell, Cell::Text(text) if text.starts_with(char::is_alphabetic)));
        let is_cut = *row + 1 == grid.len()
            && matches!(grid, Grid::Text { is_open: true, .. })
            && shape.width < header.shape.width
            && shape.numbers < header.shape.numbers;
        grid.comment(*row).is_some() || shape.numbers == 0 || is_sum || is_cut
    };
    (header.first_row..grid.len()).rev().take_while(is_behind).last().unwrap_or(grid.len())
}
