use crate::error::{Fault, quote};
use crate::import::error::ImportError;
use crate::import::grid::Grid;
use crate::import::names::{self, Sureness};
use crate::import::number::{DecimalMark, Value, ohms, value};
use crate::import::records::Records;
use crate::import::stamp::is_stamp;
use crate::import::units;
use crate::metadata::Metadata;

/// Lines above the data that may belong to its header: two of names, one of units.
const MOST_HEADER_LINES: usize = 3;
/// Lines looked at to find out what data looks like.
const SAMPLE: usize = 1000;

/// What a line is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Cells.
    pub width: usize,
    /// Cells that are numbers, dates or times of day.
    pub numbers: usize,
    /// Cells that are neither, nor a missing value.
    pub texts: usize,
}

impl Shape {
    pub(crate) fn of(cells: &[impl AsRef<str>], decimal: DecimalMark) -> Self {
        let mut shape = Self { width: cells.len(), ..Self::default() };
        let mut prefixed = 0;
        for cell in cells.iter().map(AsRef::as_ref) {
            if is_number(cell, decimal) {
                shape.numbers += 1;
            } else if value(cell, decimal, 0, &[]) == Value::Text {
                shape.texts += 1;
                prefixed += usize::from(ohms(cell, decimal).is_some());
            }
        }
        // `time,10k,22k` are names of columns.
        if shape.numbers > 0 {
            (shape.numbers, shape.texts) = (shape.numbers + prefixed, shape.texts - prefixed);
        }
        shape
    }

    /// Whether words stand where data has numbers: `Date;13.5.2024`, `Maximum;1600`.
    pub(crate) const fn is_worded(self, data: Self) -> bool {
        self.numbers < data.numbers && self.texts > data.texts
    }
}

/// What stands above the data.
#[derive(Debug, Default)]
pub(crate) struct Header {
    /// The first line of data, as an index of the grid.
    pub first_row: usize,
    /// What most lines of data are.
    pub shape: Shape,
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
        let data = Data::find(grid, decimal, first);
        let Some(first_row) = data.first_row(grid, decimal, first) else {
            let last = grid.len().checked_sub(1);
            let found = last.map_or("none".to_owned(), |last| match grid.cells(last).first() {
                Some(cell) if cell.starts_with(|c: char| c.is_ascii_digit()) => {
                    format!("cells like {}: take units and other words out of them", quote(cell))
                }
                _ => "none".to_owned(),
            });
            let line = last.map_or(1, |last| grid.line(last));
            return Err(ImportError::content(file, line, Fault::new("rows of numbers", found)));
        };
        let width = data.shape.width;
        let mut header = Self { first_row, shape: data.shape, headings: vec![String::new(); width], ..Self::default() };
        header.units = vec![None; width];
        header.read_metadata(file, grid)?;
        let top = header.read_names(file, grid, first, &data)?;
        header.skip = (grid.line(top) - 1) as usize;
        Ok(header)
    }

    /// Labels are their own header.
    pub(crate) fn of_records(records: &Records, monitor: bool, decimal: DecimalMark, skip: usize) -> Self {
        let clock = monitor.then(|| MONITOR_CLOCK.to_owned());
        let headings: Vec<String> = clock.into_iter().chain(records.headings().map(str::to_owned)).collect();
        let shape = Shape::of(&records.cells(records.fullest()), decimal);
        Self { shape, units: vec![None; headings.len()], headings, skip, ..Self::default() }
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
    fn read_names(&mut self, file: &str, grid: &Grid, first: usize, data: &Data) -> Result<usize, ImportError> {
        let mut lines: Vec<(usize, Vec<String>)> = Vec::new();
        for row in (first..self.first_row).rev() {
            match data.heading_cells(grid, row) {
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
        if is_text && names > 1 && self.shape.width == 2 * names {
            let expected = format!("{names} cells, as in the header");
            let found = format!("{}: commas that separate and decimal commas cannot be told apart", self.shape.width);
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

/// What the lines of data have in common.
struct Data {
    shape: Shape,
    /// Their last cells are empty: a separator at the end.
    ends_empty: bool,
    /// Their first cells count them.
    is_numbered: bool,
}

impl Data {
    /// The commonest number of cells in lines with a number, and the commonest shape of that width.
    fn find(grid: &Grid, decimal: DecimalMark, first: usize) -> Self {
        let rows =
            || (first..grid.len()).filter(|row| grid.comment(*row).is_none()).take(SAMPLE).map(|row| grid.cells(row));
        let shapes: Vec<Shape> =
            rows().map(|cells| Shape::of(&cells, decimal)).filter(|shape| shape.numbers > 0).collect();
        let commonest = |among: &dyn Fn(&Shape) -> Option<(usize, usize)>| {
            let mut counts: Vec<((usize, usize), usize)> = Vec::new();
            for of in shapes.iter().filter_map(among) {
                match counts.iter_mut().find(|(known, _)| *known == of) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((of, 1)),
                }
            }
            counts.into_iter().max_by_key(|(of, count)| (*count, *of)).map(|(of, _)| of)
        };
        let width = commonest(&|shape| Some((shape.width, 0))).map_or(1, |(width, _)| width);
        let of_width = |shape: &Shape| (shape.width == width).then_some((shape.numbers, shape.texts));
        let (numbers, texts) = commonest(&of_width).unwrap_or((1, 0));
        let shape = Shape { width, numbers, texts };
        let data = || rows().filter(|cells| Shape::of(cells, decimal) == shape);
        let ends_empty = data().all(|cells| cells.last().is_none_or(|cell| cell.is_empty()));
        let counts: Vec<i64> = data().map_while(|cells| cells.first()?.parse().ok()).collect();
        let is_numbered = counts.len() > 2
            && counts.len() == data().count()
            && counts.windows(2).all(|pair| pair[1] > pair[0])
            && matches!(counts[0], 0 | 1);
        Self { shape, ends_empty, is_numbered }
    }

    /// The first line of data at or below `first`.
    fn first_row(&self, grid: &Grid, decimal: DecimalMark, first: usize) -> Option<usize> {
        let is_comment = |row: usize| grid.comment(row).is_some();
        let shape = |row: usize| Shape::of(&grid.cells(row), decimal);
        let is_data = |row: &usize| {
            let shape = shape(*row);
            !is_comment(*row) && shape.width == self.shape.width && shape.numbers > 0 && shape.numbers >= shape.texts
        };
        let found = (first..grid.len()).find(is_data)?;
        // `Date;13.5.2024` above the names has a number, too.
        let sure = (found..grid.len()).find(|row| is_data(row) && !shape(*row).is_worded(self.shape)).unwrap_or(found);
        let found = if (found..sure).any(|row| !is_comment(row) && shape(row).numbers == 0) { sure } else { found };
        // Below the names a row may lack its last cells.
        let is_short = |row: &usize| {
            let shape = shape(*row);
            !is_comment(*row) && (2..self.shape.width).contains(&shape.width) && shape.texts == 0 && shape.numbers > 1
        };
        let short = (first..found).rev().take_while(is_short).last();
        let is_below_names = |row: &usize| *row > first && self.heading_cells(grid, *row - 1).is_some();
        Some(short.filter(is_below_names).unwrap_or(found))
    }

    /// The cells of a line of names or units, as many as the data has columns; `None` if it is no such line.
    fn heading_cells(&self, grid: &Grid, row: usize) -> Option<Vec<String>> {
        let width = self.shape.width;
        let commented;
        let mut cells: Vec<String> = match (grid.comment(row), grid) {
            (Some(comment), Grid::Text { separator, .. }) if !comment.contains('=') => {
                commented = comment;
                crate::import::grid::split(commented, *separator).into_iter().map(Into::into).collect()
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
        // A name for remarks, of which there are none.
        if cells.len() == width + 1 && width > 1 && cells.last().is_some_and(|last| names::role(last, None).is_none()) {
            cells.pop();
        }
        if cells.len() + 1 == width && self.is_numbered && !self.ends_empty {
            cells.insert(0, String::new());
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
