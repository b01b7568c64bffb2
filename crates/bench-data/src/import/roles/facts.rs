use std::cell::OnceCell;

use crate::error::quote;
use crate::import::bytes::Cell;
use crate::import::roles::decision::FileColumn;
use crate::import::roles::preset::Preset;
use crate::import::table::number_of;
use crate::import::table::{Column, MONITOR_CLOCK, Table};
use crate::import::words::names::{self, Sureness};
use crate::import::words::stamp::{Order, Stamp, date_and_time, has_points, orders, stamp};
use crate::import::words::units::epoch_unit;
use crate::import::words::{Role, is_missing, is_stamp, nanoseconds, ohms};
use crate::order::median;

/// Number of cells that determine the role of a column without a name.
const FIRST_CELLS: usize = 5;

/// Least number of rows in which a constant resistance is a setting.
const FEWEST_ROWS: usize = 5;

/// Possible role of a column, by its name and unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The file, counted from 0.
    pub table: usize,
    /// The column, counted from 0.
    pub column: usize,
    /// Possible role.
    pub role: Role,
    /// True if the role follows from the name, not from the unit alone.
    pub is_named: bool,
}

impl Candidate {
    pub(crate) const fn place(&self) -> FileColumn {
        FileColumn { file: self.table, column: self.column }
    }
}

/// Findings in files.
#[derive(Clone, Debug)]
pub(crate) struct Found<'a> {
    /// Headings, units, layouts and metadata.
    pub tables: &'a [Table],
    /// Facts about each column of each file, found when they are first asked for.
    pub facts: Vec<Vec<OnceCell<Facts>>>,
    /// Possible roles of the columns.
    pub candidates: Vec<Candidate>,
    /// Known layout of one of the files.
    pub preset: Option<Preset>,
}

/// Findings in the cells of a column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Facts {
    pub dates: Dates,
    pub numbers: Numbers,
    /// First cell with a unit of its own.
    pub prefixed: Option<String>,
    /// Number of empty cells, and the line of the first.
    pub empty: (usize, u64),
    /// Number of rows with the same content as the previous row.
    pub repeated: usize,
}

impl Facts {
    fn of(table: &Table, place: usize) -> Self {
        let cells = &table.columns[place].cells;
        let empty: Vec<usize> = (0..cells.len()).filter(|row| cells.get(*row).is_empty()).collect();
        Self {
            dates: Dates::of(table, place),
            numbers: Numbers::of(table, place),
            prefixed: cells.iter().find(|cell| ohms(cell.trim(), table.layout.decimal).is_some()).map(quote),
            empty: (empty.len(), empty.first().map_or(1, |row| table.lines[*row])),
            repeated: (1..cells.len()).filter(|row| cells.get(*row) == cells.get(row - 1)).count(),
        }
    }
}

/// Order of day, month and year, if all cells are dates or times of day.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Dates {
    #[default]
    None,
    In(Order),
    /// A date whose day and month are ambiguous.
    Open,
}

/// Statistics of the numbers of a column; medians of an empty column are NaN.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Numbers {
    /// Median step from row to row.
    pub step: f64,
    pub has_fractions: bool,
    pub median: f64,
    /// Median and largest absolute value.
    pub size: f64,
    pub largest: f64,
    pub least: f64,
    /// True if they increase from row to row, with few exceptions.
    pub rise: bool,
}

impl Numbers {
    fn of(table: &Table, column: usize) -> Self {
        let decimal = table.layout.decimal;
        let known: Vec<f64> =
            table.columns[column].cells.cells().filter_map(|cell| number_of(&cell, decimal)).collect();
        let middle = |values: Vec<f64>| median(values).unwrap_or(f64::NAN);
        let steps: Vec<f64> = known.windows(2).map(|pair| pair[1] - pair[0]).collect();
        Self {
            has_fractions: known.iter().any(|number| number.fract() != 0.0),
            size: middle(known.iter().map(|number| number.abs()).collect()),
            largest: known.iter().fold(0.0, |largest: f64, number| largest.max(number.abs())),
            least: known.iter().copied().fold(f64::INFINITY, f64::min),
            step: middle(steps),
            median: middle(known),
            rise: table.increases(column),
        }
    }
}

impl Dates {
    fn of(table: &Table, column: usize) -> Self {
        let cells = &table.columns[column].cells;
        let filled = || cells.iter().filter(|cell| !is_missing(cell, &[]));
        let day = |cell: &str| date_and_time(cell).0.map(str::to_owned);
        match orders(filled())[..] {
            [] => Self::None,
            [order @ Order::Iso, ..] | [order] => Self::In(order),
            _ if filled().all(has_points) => Self::In(Order::Dmy),
            // If all dates are the same, the order of day and month does not matter.
            _ if filled().all(|cell| day(cell) == filled().next().and_then(day)) => Self::In(Order::Dmy),
            _ => Self::Open,
        }
    }
}

impl<'a> Found<'a> {
    /// Collects the facts about files.
    pub(crate) fn of(tables: &'a [Table]) -> Self {
        let facts = |table: &Table| vec![OnceCell::new(); table.columns.len()];
        Self {
            tables,
            facts: tables.iter().map(facts).collect(),
            candidates: candidates(tables),
            preset: tables.iter().find_map(Preset::that_fits),
        }
    }

    pub(crate) fn table(&self, place: FileColumn) -> &'a Table {
        &self.tables[place.file]
    }

    pub(crate) fn column(&self, place: FileColumn) -> &'a Column {
        &self.tables[place.file].columns[place.column]
    }

    pub(crate) fn facts(&self, place: FileColumn) -> &Facts {
        self.facts[place.file][place.column].get_or_init(|| Facts::of(self.table(place), place.column))
    }

    /// Returns the name of a column in messages.
    pub(crate) fn name(&self, place: FileColumn) -> String {
        self.table(place).name(place.column)
    }

    /// Returns all columns of all files.
    pub(crate) fn places(&self) -> impl Iterator<Item = FileColumn> {
        let files = self.tables.iter().enumerate();
        files.flat_map(|(file, table)| (0..table.columns.len()).map(move |column| FileColumn { file, column }))
    }

    /// True if a column of times does not distinguish rows.
    pub(crate) fn is_coarse(&self, place: FileColumn) -> bool {
        is_coarse(self.facts(place).repeated, self.table(place).len())
    }

    /// Returns columns of a file whose numbers increase from row to row.
    pub(crate) fn rising(&self, file: usize) -> Vec<usize> {
        let rises = |column: &usize| self.facts(FileColumn { file, column: *column }).numbers.rise;
        (0..self.facts[file].len()).filter(rises).collect()
    }
}

/// True if so many rows repeat the time of the previous row that a clock does not distinguish rows.
pub(crate) const fn is_coarse(repeated: usize, rows: usize) -> bool {
    repeated * 5 > rows
}

/// Returns possible roles of the columns of files.
#[must_use]
pub fn candidates(tables: &[Table]) -> Vec<Candidate> {
    let says = |table: &Table| (0..table.columns.len()).map(|column| says(table, column)).collect::<Vec<_>>();
    tables.iter().enumerate().flat_map(|(file, table)| among(file, &says(table))).collect()
}

/// Returns the candidates in a file, by its columns' names and units. `R_1` beside `R` is another quantity.
pub(crate) fn among(table: usize, says: &[Option<(Role, Sureness)>]) -> Vec<Candidate> {
    let is_strong = |role: Role| says.contains(&Some((role, Sureness::Strong)));
    let suggested =
        says.iter().enumerate().filter_map(|(column, suggested)| suggested.map(|(role, how)| (column, role, how)));
    suggested
        .filter(|(_, role, how)| *how != Sureness::Indexed || !is_strong(*role))
        .map(|(column, role, how)| Candidate { table, column, role, is_named: how != Sureness::Weak })
        .collect()
}

/// Returns the role that a column's name and unit suggest, if it has any number or date. A column of dates beside one of times of day has
/// none. Without a name, times since 1970 and moments are the time.
fn says(table: &Table, place: usize) -> Option<(Role, Sureness)> {
    let (column, decimal) = (&table.columns[place], table.layout.decimal);
    let mut filled = column.cells.iter().filter(|cell| !cell.is_empty()).take(FIRST_CELLS).peekable();
    let is_filled = filled.peek().is_some();
    let first: Vec<&str> = filled.collect();
    let all = |is_kind: &dyn Fn(Stamp) -> bool| {
        let is_kind = |cell: &&str| Order::ALL.iter().any(|order| stamp(cell, *order).is_some_and(is_kind));
        is_filled && first.iter().all(is_kind)
    };
    let is_since_1970 =
        |cell: &&str| nanoseconds(cell, decimal, 0).is_some_and(|count| epoch_unit(count as f64 / 1e9, 0.0).is_some());
    let suggested = if column.heading == MONITOR_CLOCK {
        Some((Role::Time, Sureness::Weak))
    } else if !column.heading.is_empty() {
        names::role(&column.name, column.unit.as_deref()).filter(|_| !all(&|stamp| !stamp.has_time))
    } else {
        let is_time = all(&|stamp| stamp.has_time) || (is_filled && first.iter().all(is_since_1970));
        is_time.then_some((Role::Time, Sureness::Weak))
    };
    let is_value = |cell: Cell| {
        number_of(&cell, decimal).is_some()
            || matches!(cell, Cell::Text(text) if is_stamp(&text) || ohms(&text, decimal).is_some())
    };
    let found = suggested.filter(|_| column.cells.cells().any(is_value));
    // A constant resistance is a setting, such as the range of a meter or the other arm of a divider, unless its name says otherwise.
    let ohms = || column.cells.iter().filter(|cell| !cell.is_empty());
    let is_setting =
        || column.cells.len() >= FEWEST_ROWS && ohms().next().is_some_and(|first| ohms().all(|cell| cell == first));
    let is_named = || names::role(&column.name, None).is_some_and(|(role, _)| role == Role::Resistance);
    found.filter(|(role, _)| *role != Role::Resistance || is_named() || !is_setting())
}
