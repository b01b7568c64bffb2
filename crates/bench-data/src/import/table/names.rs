//! Lines of names above the data.

use std::borrow::Cow;

use crate::import::bytes::Cell;
use crate::import::table::data::{Data, Shape};
use crate::import::table::grid::{Grid, MONITOR_CLOCK, Separator, split};
use crate::import::table::value::{number_of, value_of};
use crate::import::words::names::{self, is_quantity};
use crate::import::words::{DecimalMark, Role, Value, is_stamp};

/// Number of rows with which a line of numbers is compared.
const ROWS_BELOW: usize = 20;

/// A line of names, one for each column.
pub(crate) struct Names {
    pub cells: Vec<String>,
    /// Number of names, if it differs from that of columns.
    pub given: Option<usize>,
}

impl Data {
    /// Returns the names in the line above the first line of data.
    pub(crate) fn names_above(&self, grid: &Grid, decimal: DecimalMark, data: usize) -> Option<Names> {
        let whole = |cells| Names { cells, given: None };
        self.heading_cells(grid, data.checked_sub(1)?)
            .or_else(|| self.numbers_as_names(grid, decimal, data))
            .or_else(|| self.counted_names(grid, decimal, data))
            .map(whole)
            .or_else(|| self.some_names(grid, data))
    }

    /// Returns the cells of a line of names or units, as many as the data has columns; `None` if the line is of another kind.
    pub(crate) fn heading_cells(&self, grid: &Grid, row: usize) -> Option<Vec<String>> {
        let width = self.shape.width;
        let mut cells = cells_above(grid, row)?;
        if let ([line], true) = (&cells[..], width > 1) {
            cells = split_otherwise(line, width).unwrap_or(cells);
        }
        if cells.len() != width {
            cells = joined_brackets(cells);
        }
        while cells.len() > width && cells.last().is_some_and(String::is_empty) {
            cells.pop();
        }
        // The last one names a column of remarks that has no cells.
        if cells.len() == width + 1 && width > 1 && cells.last().is_some_and(|last| names::role(last, None).is_none()) {
            cells.pop();
        }
        if cells.len() + 1 == width && self.is_numbered && !self.ends_empty {
            cells.insert(0, String::new());
        }
        let texts = cells.iter().filter(|cell| !cell.is_empty()).count();
        let fits = cells.len() == width || (cells.len() + 1 == width && width > 2);
        if !fits || !cells.iter().all(|cell| is_heading(cell)) || texts == 0 || (texts == 1 && width > 1) {
            return None;
        }
        cells.resize(width, String::new());
        Some(cells)
    }

    /// Returns names most of which are numbers, `length,1,2,3`: some cells are words where the data has numbers, and all are different.
    pub(crate) fn numbers_as_names(&self, grid: &Grid, decimal: DecimalMark, data: usize) -> Option<Vec<String>> {
        let above = data.checked_sub(1).filter(|above| grid.comment(*above).is_none())?;
        let (cells, below) = (grid.cells(above), grid.cells(data));
        let is_word = |cell: &Cell| matches!(cell, Cell::Text(text) if text.starts_with(char::is_alphabetic));
        let is_text = |cell: &Cell| value_of(cell, decimal, 0, &[]) == Value::Text;
        let is_above_a_number = |place: usize| below.get(place).is_some_and(|cell| number_of(cell, decimal).is_some());
        let words: Vec<usize> =
            (0..cells.len()).filter(|place| is_word(&cells[*place]) && is_text(&cells[*place])).collect();
        let names: Vec<String> = cells.iter().map(Cell::to_string).collect();
        let filled: Vec<&String> = names.iter().filter(|name| !name.is_empty()).collect();
        let are_alike = filled.iter().enumerate().any(|(i, name)| filled[..i].contains(name));
        let is_fit = cells.len() == self.shape.width
            && Shape::of(&cells, decimal).is_worded(self.shape)
            && words.first() == Some(&0)
            && words.iter().all(|place| is_above_a_number(*place))
            && !names.iter().any(|name| is_stamp(name))
            && !are_alike;
        is_fit.then_some(names)
    }

    /// Returns names that number the columns, from 0 or 1, if at least one of them is far from all values below it.
    pub(crate) fn counted_names(&self, grid: &Grid, decimal: DecimalMark, data: usize) -> Option<Vec<String>> {
        let above = data.checked_sub(1).filter(|above| data < grid.len() && grid.comment(*above).is_none())?;
        let cells = grid.cells(above);
        let names: Vec<String> = cells.iter().map(Cell::to_string).collect();
        let counts = &names[usize::from(names.first().is_some_and(String::is_empty))..];
        let first = counts.first().and_then(|count| count.parse::<usize>().ok()).filter(|first| *first < 2)?;
        let is_counted = counts.iter().zip(first..).all(|(count, expected)| *count == expected.to_string());
        if cells.len() != self.shape.width || counts.len() < 2 || !is_counted {
            return None;
        }
        // Two numbers may also be the first row.
        let times = if counts.len() < 3 { 20.0 } else { 2.0 };
        let far = |place: usize| {
            let name = names[place].parse::<f64>().ok()?;
            let below = (data..grid.len())
                .take(ROWS_BELOW)
                .filter_map(|row| grid.cells(row).get(place).and_then(|cell| number_of(cell, decimal)).map(f64::abs));
            Some(below.fold(f64::INFINITY, f64::min) > times * name.max(1.0))
        };
        (0..names.len()).any(|place| far(place) == Some(true)).then_some(names)
    }

    /// Assigns names that are more or fewer than the columns to the first columns, if one of them is that of a measured quantity.
    fn some_names(&self, grid: &Grid, data: usize) -> Option<Names> {
        let (width, mut cells) = (self.shape.width, cells_above(grid, data.checked_sub(1)?)?);
        while cells.last().is_some_and(String::is_empty) {
            cells.pop();
        }
        let given = cells.len();
        let separator = match grid {
            Grid::Text { separator, .. } => Some(*separator),
            Grid::Rows(_) => None,
        };
        // Blanks within names make them look like more.
        let is_torn = given > width && separator == Some(Separator::Spaces);
        // Commas may also be decimal marks.
        let is_open = 2 * given == width
            && separator == Some(Separator::Comma)
            && !grid.cells(data).iter().any(|cell| cell.to_string().contains('.'));
        let has_quantity = cells.iter().take(width).any(|cell| is_quantity(cell));
        let are_names = given > 1 && cells.iter().all(|cell| is_heading(cell)) && has_quantity;
        if !are_names || is_torn || is_open || 2 * given < width || given > 2 * width {
            return None;
        }
        cells.resize(width, String::new());
        Some(Names { cells, given: Some(given) })
    }
}

/// Returns the cells of a line above the data, or of a comment; the clock of a serial monitor has a name.
fn cells_above(grid: &Grid, row: usize) -> Option<Vec<String>> {
    let mut cells: Vec<String> = match (grid.comment(row), grid) {
        (Some(comment), Grid::Text { lines, separator, .. }) if !comment.contains('=') => {
            let mut cells: Vec<String> = split(comment, *separator).into_iter().map(Cow::into_owned).collect();
            // `% Strain, R, Time`: a comment, or percent.
            if let Some(first) =
                cells.first_mut().filter(|first| lines[row].1.trim_start().starts_with('%') && is_strain(first))
            {
                first.insert_str(0, "% ");
            }
            cells
        }
        (Some(_), _) => return None,
        (None, _) => grid.cells(row).iter().map(Cell::to_string).collect(),
    };
    if let (true, Some(clock)) = (grid.has_monitor_clock(), cells.first_mut()) {
        MONITOR_CLOCK.clone_into(clock);
    }
    Some(cells)
}

/// Splits a line of names with another separator than that of the data.
fn split_otherwise(line: &str, width: usize) -> Option<Vec<String>> {
    let cells = |mark: char| line.split(mark).map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let is_fit = |cells: &Vec<String>| cells.len() == width && cells.iter().any(|cell| is_quantity(cell));
    [';', ',', '\t', '|'].into_iter().map(cells).find(is_fit)
}

/// True if a heading is that of a strain without a unit.
fn is_strain(heading: &str) -> bool {
    let (name, unit) = names::take_apart(heading);
    unit.is_none() && matches!(names::role(&name, None), Some((Role::Strain, _)))
}

/// True if a cell may be a name: it is neither a number nor a date.
fn is_heading(cell: &str) -> bool {
    cell.is_empty() || cell.parse::<f64>().is_err() && !is_stamp(cell)
}

/// Joins `Time`, `(s)` to `Time (s)`, because blanks also separate the names.
fn joined_brackets(cells: Vec<String>) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for cell in cells {
        match out.last_mut() {
            Some(last) if cell.starts_with(['(', '[']) => *last = format!("{last} {cell}"),
            _ => out.push(cell),
        }
    }
    out
}
