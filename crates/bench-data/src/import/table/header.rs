use crate::error::{Fault, quote};
use crate::import::bytes::Cell;
use crate::import::error::ImportError;
use crate::import::table::data::{Data, Shape};
use crate::import::table::grid::{Grid, MONITOR_CLOCK, Separator};
use crate::import::table::records::Records;
use crate::import::table::value::value_of;
use crate::import::words::names::{self, is_quantity};
use crate::import::words::{DecimalMark, Value, units};
use crate::metadata::Metadata;

/// Largest number of header lines above the data: two of names, one of units.
const MOST_HEADER_LINES: usize = 3;
/// Processes by which a logger reduces its samples to a row; a line of them below the units is skipped.
const PROCESSES: [&str; 8] = ["smp", "avg", "max", "min", "std", "tot", "med", "win"];

/// Lines above the data.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// The first line of data, as an index of the grid.
    pub first_row: usize,
    /// Shape of most lines of data.
    pub shape: Shape,
    /// Heading of each column; empty if there is none.
    pub headings: Vec<String>,
    /// Unit of each column, from a line of units.
    pub units: Vec<Option<String>>,
    /// Physical lines above the header, or above the data if there is none.
    pub skip: usize,
    /// Number of lines of names.
    pub header_lines: usize,
    /// True if there is a line of units.
    pub unit_line: bool,
    /// Number of names, if it differs from that of columns.
    pub given_names: Option<usize>,
    /// Metadata of the `# key = value` lines.
    pub metadata: Metadata,
}

impl Header {
    /// Finds the header above the first line that is data, below `skip` physical lines.
    pub(crate) fn find(file: &str, grid: &Grid, decimal: DecimalMark, skip: usize) -> Result<Self, ImportError> {
        let first = (0..grid.len()).find(|row| grid.line(*row) > skip as u64).unwrap_or(grid.len());
        let data = Data::find(grid, decimal, first);
        let Some(first_row) = data.first_row(grid, decimal, first) else {
            let last = grid.len().checked_sub(1);
            let cell = last.and_then(|last| grid.cells(last).first().map(Cell::to_string)).unwrap_or_default();
            let found = if cell.starts_with(|c: char| c.is_ascii_digit()) {
                format!("cells like {}: take units and other words out of them", quote(&cell))
            } else {
                "none".to_owned()
            };
            let line = last.map_or(1, |last| grid.line(last));
            return Err(ImportError::content(file, line, Fault::new("rows of numbers", found)));
        };
        let width = data.shape.width;
        let mut header = Self { first_row, shape: data.shape, headings: vec![String::new(); width], ..Self::default() };
        header.units = vec![None; width];
        header.read_metadata(file, grid)?;
        let top = header.read_names(file, grid, decimal, first, &data)?;
        header.skip = (grid.line(top) - 1) as usize;
        Ok(header)
    }

    /// Builds the header of records, whose labels are the headings.
    pub(crate) fn of_records(records: &Records, decimal: DecimalMark, skip: usize) -> Self {
        let headings = records.headings.clone();
        let shape = records.rows.get(records.fullest).map_or_else(Shape::default, |row| Shape::of(&row.1, decimal));
        Self { shape, units: vec![None; headings.len()], headings, skip, ..Self::default() }
    }

    /// Reads metadata anywhere above the data, including skipped lines.
    fn read_metadata(&mut self, file: &str, grid: &Grid) -> Result<(), ImportError> {
        for row in 0..self.first_row {
            if let Some(comment) = grid.comment(row).filter(|comment| comment.contains('=')) {
                let taken = self.metadata.take_line(&format!("# {comment}"));
                taken.map_err(|fault| ImportError::content(file, grid.line(row), fault))?;
            }
        }
        Ok(())
    }

    /// Takes names and units from the lines above the data, and returns the topmost line taken, or the first line of
    /// data.
    fn read_names(
        &mut self,
        file: &str,
        grid: &Grid,
        decimal: DecimalMark,
        first: usize,
        data: &Data,
    ) -> Result<usize, ImportError> {
        let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
        let is_passed = |row: usize| is_process_line(grid, row) || is_without_values(grid, row, decimal);
        let below = (first..self.first_row).rev().find(|row| !is_passed(*row)).map_or(first, |row| row + 1);
        for row in (first..below).rev().take(MOST_HEADER_LINES) {
            let cells = if row + 1 == below {
                let names = data.names_above(grid, decimal, below);
                self.given_names = names.as_ref().and_then(|names| names.given);
                names.map(|names| names.cells)
            } else {
                data.heading_cells(grid, row)
            };
            let Some(cells) = cells else { break };
            lines.push((row, cells));
            // If the number of names differs from that of columns, it is unclear to which columns the names above
            // belong.
            if self.given_names.is_some() {
                break;
            }
        }
        if let (true, Some(clock)) = (grid.has_monitor_clock(), self.headings.first_mut()) {
            MONITOR_CLOCK.clone_into(clock);
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
        if let (false, [_, (_, above), ..]) = (has_units, &lines[..])
            && is_unit_line(above)
        {
            self.unit_line = true;
            self.units = above.iter().map(|cell| Some(cell.clone()).filter(|cell| !cell.is_empty())).collect();
            lines.remove(1);
        }
        let names: Vec<&(usize, Vec<String>)> = lines.iter().skip(usize::from(has_units)).collect();
        let Some((row, nearest)) = names.first() else { return Ok(lines[0].0) };
        self.headings.clone_from(nearest);
        self.header_lines = 1;
        let mut top = *row;
        if let Some((row, above)) = names.get(1) {
            if has_twins(nearest) {
                // A line of groups above, `Sensor,Sensor,Stage,Stage`, distinguishes columns of the same name.
                let join = |(group, name): (&String, &String)| format!("{group} {name}").trim().to_owned();
                self.headings = filled_to_the_right(above).iter().zip(nearest).map(join).collect();
                (self.header_lines, top) = (2, *row);
            } else if !has_twins(above) {
                // `Time,Resistance` above `Channel 1,DMM`: each column takes the name that states the measured
                // quantity.
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

    /// Refuses `0,05,1600,1` under two names: separating commas and decimal commas are ambiguous.
    fn refuse_commas_for_both(&self, file: &str, grid: &Grid, first: usize) -> Result<(), ImportError> {
        let Some(above) = self.first_row.checked_sub(1).filter(|row| *row >= first) else { return Ok(()) };
        let names = grid.cells(above).len();
        let is_text = matches!(grid, Grid::Text { separator: Separator::Comma, .. });
        if is_text && names > 1 && self.shape.width == 2 * names {
            let expected = format!("{names} cells, as in the header");
            let found = format!("{}: commas that separate and decimal commas cannot be told apart", self.shape.width);
            return Err(ImportError::content(file, grid.line(self.first_row), Fault::new(expected, found)));
        }
        Ok(())
    }
}

/// True if a line states how samples were reduced.
fn is_process_line(grid: &Grid, row: usize) -> bool {
    let cells = grid.cells(row);
    let mut filled = cells.iter().filter(|cell| !cell.is_empty()).peekable();
    filled.peek().is_some() && filled.all(|cell| PROCESSES.contains(&cell.to_string().to_lowercase().as_str()))
}

/// True if a line has cells, and no value in any of them: `,,`, `NaN;NaN`.
fn is_without_values(grid: &Grid, row: usize, decimal: DecimalMark) -> bool {
    let cells = grid.cells(row);
    let is_missing = |cell: &Cell| value_of(cell, decimal, 0, &[]) == Value::Missing;
    grid.comment(row).is_none() && cells.len() > 1 && cells.iter().all(is_missing)
}

/// True if all cells, apart from empty ones, are units, or short words beside at least as many units.
fn is_unit_line(cells: &[String]) -> bool {
    // `TS` and `RN` are the times and the row numbers of a logger.
    let filled = || cells.iter().filter(|cell| !cell.is_empty() && !matches!(cell.as_str(), "TS" | "RN"));
    let units = filled().filter(|cell| units::is_unit(cell)).count();
    units > 0 && filled().all(|cell| cell.chars().count() <= 12) && 2 * units >= filled().count() && {
        // `t`, `R`, `x` are primarily names: in a line of units, a cell that names a quantity must also be a unit.
        filled().all(|cell| units::is_unit(cell) || names::role(cell, None).is_none())
    }
}

fn is_bracketed(cells: &[String]) -> bool {
    let mut filled = cells.iter().filter(|cell| !cell.is_empty()).peekable();
    filled.peek().is_some() && filled.all(|cell| cell.starts_with(['(', '[']) && cell.ends_with([')', ']']))
}

fn has_twins(names: &[String]) -> bool {
    names.iter().enumerate().any(|(i, name)| names[..i].contains(name))
}

/// Fills merged cells of groups, whose first cell has the name.
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
