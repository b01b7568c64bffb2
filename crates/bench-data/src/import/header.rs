use crate::error::Fault;
use crate::import::error::ImportError;
use crate::import::grid::Grid;
use crate::import::names::{self, Sureness};
use crate::import::number::{DecimalMark, Value, value};
use crate::import::stamp::is_stamp;
use crate::import::units;
use crate::metadata::Metadata;

/// Lines above the data that may belong to its header: two of names, one of units.
const MOST_HEADER_LINES: usize = 3;

/// What stands above the data.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// The first line of data, as an index of the grid.
    pub first_row: usize,
    /// Columns of the data.
    pub width: usize,
    /// Heading of each column; empty where there is none.
    pub headings: Vec<String>,
    /// Unit of each column, where a line of units has one.
    pub units: Vec<Option<String>>,
    /// Physical lines above the header, or above the data if there is none.
    pub skip: usize,
    /// Lines of names.
    pub header_lines: usize,
    /// Whether there is a line of units.
    pub unit_line: bool,
    /// What `# key = value` lines say.
    pub metadata: Metadata,
}

impl Header {
    /// Looks above the first line that is data, below `skip` physical lines.
    pub(crate) fn find(file: &str, grid: &Grid, decimal: DecimalMark, skip: usize) -> Result<Self, ImportError> {
        let first = (0..grid.len()).find(|row| grid.line(*row) > skip as u64).unwrap_or(grid.len());
        let width = width(grid, decimal, first);
        let is_row = |row: &usize| grid.comment(*row).is_none() && is_data(&cells(grid, *row), width, decimal);
        let Some(first_row) = (first..grid.len()).find(is_row) else {
            let line = grid.len().checked_sub(1).map_or(1, |last| grid.line(last));
            return Err(ImportError::content(file, line, Fault::new("rows of numbers", "none")));
        };
        let mut header = Self { first_row, width, headings: vec![String::new(); width], ..Self::default() };
        header.units = vec![None; width];
        header.read_metadata(file, grid)?;
        let top = header.read_names(file, grid, first)?;
        header.skip = (grid.line(top) - 1) as usize;
        Ok(header)
    }

    /// A label line is its own header.
    pub(crate) fn of_labels(labels: &[String], monitor: bool, skip: usize, first_row: usize) -> Self {
        let clock = monitor.then(|| MONITOR_CLOCK.to_owned());
        let headings: Vec<String> = clock.into_iter().chain(labels.iter().cloned()).collect();
        let width = headings.len();
        Self { width, units: vec![None; width], headings, skip, first_row, ..Self::default() }
    }

    /// They count wherever they stand above the data, in lines that are skipped too.
    fn read_metadata(&mut self, file: &str, grid: &Grid) -> Result<(), ImportError> {
        for row in 0..self.first_row {
            if let Some(comment) = grid.comment(row).filter(|comment| comment.contains('=')) {
                let taken = self.metadata.take_line(&format!("# {comment}"));
                taken.map_err(|fault| ImportError::content(file, grid.line(row), fault))?;
            }
        }
        Ok(())
    }

    /// Takes names and units from the lines above the data; the topmost line taken, or the first of data.
    fn read_names(&mut self, file: &str, grid: &Grid, first: usize) -> Result<usize, ImportError> {
        let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
        for row in (first..self.first_row).rev() {
            match heading_cells(grid, row, self.width) {
                Some(cells) if lines.len() < MOST_HEADER_LINES => lines.push((row, cells)),
                _ => break,
            }
        }
        if lines.is_empty() {
            self.refuse_commas_for_both(file, grid, first)?;
            return Ok(self.first_row);
        }
        let has_units = lines.len() > 1 && is_unit_line(&lines[0].1) || is_bracketed(&lines[0].1);
        if has_units {
            self.unit_line = true;
            self.units = lines[0].1.iter().map(|cell| Some(cell.clone()).filter(|cell| !cell.is_empty())).collect();
        }
        let names: Vec<&(usize, Vec<String>)> = lines.iter().skip(usize::from(has_units)).collect();
        let Some((row, nearest)) = names.first() else { return Ok(lines[0].0) };
        self.headings.clone_from(nearest);
        self.header_lines = 1;
        let mut top = *row;
        if let Some((row, above)) = names.get(1) {
            if has_twins(nearest) {
                // A line of groups above, `Sensor,Sensor,Stage,Stage`, tells columns of the same name apart.
                let join = |(group, name): (&String, &String)| format!("{group} {name}").trim().to_owned();
                self.headings = filled_to_the_right(above).iter().zip(nearest).map(join).collect();
                (self.header_lines, top) = (2, *row);
            } else if !has_twins(above) {
                // `Time,Resistance` above `Channel 1,DMM`: each column has the name that says what is measured.
                for (heading, above) in self.headings.iter_mut().zip(above) {
                    if is_quantity(above) && !is_quantity(heading) {
                        heading.clone_from(above);
                        (self.header_lines, top) = (2, *row);
                    }
                }
            }
        }
        Ok(top)
    }

    /// `0,05,1600,1` under two names: commas that separate and commas that are decimal marks cannot be told apart.
    fn refuse_commas_for_both(&self, file: &str, grid: &Grid, first: usize) -> Result<(), ImportError> {
        let Some(above) = self.first_row.checked_sub(1).filter(|row| *row >= first) else { return Ok(()) };
        let names = grid.cells(above).len();
        let is_text = matches!(grid, Grid::Text { separator: crate::import::grid::Separator::Comma, .. });
        if is_text && names > 1 && self.width == 2 * names {
            let expected = format!("{names} cells, as in the header");
            let found = format!("{}: commas that separate and decimal commas cannot be told apart", self.width);
            return Err(ImportError::content(file, grid.line(self.first_row), Fault::new(expected, found)));
        }
        Ok(())
    }
}

/// The name of the clock that a serial monitor writes.
pub(crate) const MONITOR_CLOCK: &str = "monitor clock";

fn cells(grid: &Grid, row: usize) -> Vec<String> {
    grid.cells(row).into_iter().map(Into::into).collect()
}

fn is_number(cell: &str, decimal: DecimalMark) -> bool {
    is_stamp(cell) || matches!(value(cell, decimal, 0, &[]), Value::Number(_))
}

/// The commonest number of cells in lines with a number.
fn width(grid: &Grid, decimal: DecimalMark, first: usize) -> usize {
    let mut widths: Vec<(usize, usize)> = Vec::new();
    for row in (first..grid.len()).take(1000).filter(|row| grid.comment(*row).is_none()) {
        let cells = grid.cells(row);
        if !cells.iter().any(|cell| is_number(cell, decimal)) {
            continue;
        }
        match widths.iter_mut().find(|(width, _)| *width == cells.len()) {
            Some((_, count)) => *count += 1,
            None => widths.push((cells.len(), 1)),
        }
    }
    widths.into_iter().max_by_key(|(width, count)| (*count, *width)).map_or(1, |(width, _)| width)
}

/// Whether a line is data: as wide as the data, with a number, and not mostly text.
fn is_data(cells: &[String], width: usize, decimal: DecimalMark) -> bool {
    let numbers = cells.iter().filter(|cell| is_number(cell, decimal)).count();
    let texts = cells.iter().filter(|cell| value(cell, decimal, 0, &[]) == Value::Text && !is_stamp(cell)).count();
    cells.len() == width && numbers > 0 && numbers >= texts
}

/// The cells of a line of names or units, as many as the data has columns; `None` if it is no such line.
fn heading_cells(grid: &Grid, row: usize, width: usize) -> Option<Vec<String>> {
    let commented;
    let mut cells: Vec<String> = match (grid.comment(row), grid) {
        (Some(comment), Grid::Text { separator, .. }) if !comment.contains('=') => {
            commented = comment;
            crate::import::grid::split(commented, *separator, &[]).into_iter().map(Into::into).collect()
        }
        (Some(_), _) => return None,
        (None, _) => cells(grid, row),
    };
    if cells.len() != width {
        cells = joined_brackets(cells);
    }
    while cells.len() > width && cells.last().is_some_and(String::is_empty) {
        cells.pop();
    }
    let texts = cells.iter().filter(|cell| !cell.is_empty()).count();
    let is_heading = |cell: &String| cell.is_empty() || cell.parse::<f64>().is_err() && !is_stamp(cell);
    let fits = cells.len() == width || (cells.len() + 1 == width && width > 2);
    if !fits || !cells.iter().all(is_heading) || texts == 0 || (texts == 1 && width > 1) {
        return None;
    }
    cells.resize(width, String::new());
    Some(cells)
}

/// `Time`, `(s)` → `Time (s)`, where blanks separate the names too.
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

/// Whether all cells are units, empty ones aside, or short words beside at least one unit.
fn is_unit_line(cells: &[String]) -> bool {
    let filled = || cells.iter().filter(|cell| !cell.is_empty());
    let units = filled().filter(|cell| units::is_unit(cell)).count();
    units > 0 && filled().all(|cell| cell.chars().count() <= 12) && 2 * units >= filled().count() && {
        // `t`, `R`, `x` are names first: a line of units has none that names a quantity and is no unit.
        filled().all(|cell| units::is_unit(cell) || names::role(cell, None).is_none())
    }
}

fn is_bracketed(cells: &[String]) -> bool {
    let mut filled = cells.iter().filter(|cell| !cell.is_empty()).peekable();
    filled.peek().is_some() && filled.all(|cell| cell.starts_with(['(', '[']) && cell.ends_with([')', ']']))
}

/// Whether a name says what is measured.
fn is_quantity(heading: &str) -> bool {
    let (name, unit) = names::take_apart(heading);
    matches!(names::role(&name, unit.as_deref()), Some((_, Sureness::Strong)))
}

fn has_twins(names: &[String]) -> bool {
    names.iter().enumerate().any(|(i, name)| names[..i].contains(name))
}

/// Groups of merged cells have their name in the first of them.
fn filled_to_the_right(groups: &[String]) -> Vec<String> {
    let mut last = String::new();
    let filled = groups.iter().map(|group| {
        if !group.is_empty() {
            last.clone_from(group);
        }
        last.clone()
    });
    filled.collect()
}
