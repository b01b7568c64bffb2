use std::borrow::Cow;
use std::fmt;

use chrono::{Duration, NaiveDate};

/// A cell as its container has it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Cell<'a> {
    /// Nothing.
    #[default]
    Empty,
    /// Text without blanks around it.
    Text(Cow<'a, str>),
    /// A number, which has no decimal mark.
    Number(f64),
    /// Days since the end of 1899; less than one is a time of day.
    Date(f64),
}

impl<'a> Cell<'a> {
    /// A text without the blanks around it.
    pub(crate) fn text(text: &'a str) -> Self {
        Self::Text(text.trim().into())
    }

    /// A whole number; as text where a float would round it.
    pub(crate) fn count(count: i64) -> Self {
        let number = count as f64;
        if number as i64 == count && number.abs() < 9e15 {
            Self::Number(number)
        } else {
            Self::Text(count.to_string().into())
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        matches!(self, Self::Empty) || matches!(self, Self::Text(text) if text.is_empty())
    }
}

/// Cells by row, with the row's number in the file.
pub(crate) type Rows<'a> = Vec<(u64, Vec<Cell<'a>>)>;

/// The cell as text that reads back as the same number or date. A date goes to the microsecond: a 64-bit number of days
/// tells no more.
impl fmt::Display for Cell<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let days = match self {
            Self::Empty => return Ok(()),
            Self::Text(text) => return out.write_str(text),
            Self::Number(number) => return write!(out, "{number}"),
            Self::Date(days) => *days,
        };
        let microseconds = (days * 86_400e6).round() as i64;
        // The day that spreadsheets count too many, 29 February 1900, lies before everything that is recorded.
        let epoch = NaiveDate::from_ymd_opt(1899, 12, 30).and_then(|date| date.and_hms_opt(0, 0, 0));
        match epoch.and_then(|epoch| epoch.checked_add_signed(Duration::microseconds(microseconds))) {
            Some(moment) if days >= 1.0 => write!(out, "{}", moment.format("%Y-%m-%d %H:%M:%S%.6f")),
            Some(moment) => write!(out, "{}", moment.format("%H:%M:%S%.6f")),
            None => write!(out, "{days}"),
        }
    }
}

/// A column's cells in one allocation for all texts: a million short cells cost little more than their characters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    text: String,
    ends: Vec<usize>,
    /// Numbers of cells that are numbers in their container; not finite for all others, or not there.
    numbers: Vec<f64>,
}

impl Cells {
    /// Appends a text.
    pub fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push(self.text.len());
    }

    /// Appends a cell; bytes that its text has.
    pub(crate) fn push_cell(&mut self, cell: &Cell) -> usize {
        let before = self.text.len();
        match cell {
            Cell::Number(number) => {
                self.numbers.resize(self.len(), f64::INFINITY);
                self.numbers.push(*number);
                self.push(&number.to_string());
            }
            Cell::Text(text) => self.push(text),
            cell => self.push(&cell.to_string()),
        }
        self.text.len() - before
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// True if there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The text of a cell; empty beyond the last one.
    #[must_use]
    pub fn get(&self, row: usize) -> &str {
        let Some(&end) = self.ends.get(row) else { return "" };
        let start = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.text[start..end]
    }

    /// Returns some of the cells, in this order.
    pub(crate) fn some(&self, rows: impl Iterator<Item = usize>) -> Self {
        let mut out = Self::default();
        for row in rows {
            match self.numbers.get(row).copied().filter(|number| number.is_finite()) {
                Some(number) => out.push_cell(&Cell::Number(number)),
                None => out.push_cell(&Cell::Text(self.get(row).into())),
            };
        }
        out
    }

    /// The texts of all cells.
    pub fn iter(&self) -> impl Iterator<Item = &str> + Clone {
        (0..self.len()).map(|row| self.get(row))
    }

    /// All cells: numbers of their container as numbers.
    pub(crate) fn cells(&self) -> impl Iterator<Item = Cell<'_>> {
        let number = |row: usize| self.numbers.get(row).copied().filter(|number| number.is_finite());
        (0..self.len()).map(move |row| number(row).map_or_else(|| Cell::Text(self.get(row).into()), Cell::Number))
    }
}
