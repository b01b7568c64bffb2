use std::borrow::Cow;
use std::fmt;

use chrono::{Duration, NaiveDate};

/// A cell as in its container.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Cell<'a> {
    /// No content.
    #[default]
    Empty,
    /// Text without blanks around it.
    Text(Cow<'a, str>),
    /// A number in binary form, without a decimal mark.
    Number(f64),
    /// Days since the end of 1899; less than one is a time of day.
    Date(f64),
}

impl<'a> Cell<'a> {
    /// Makes a text cell without the blanks around it.
    pub(crate) fn text(text: &'a str) -> Self {
        Self::Text(text.trim().into())
    }

    /// Makes a cell of a whole number, as text if a float would round it.
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

/// Writes the cell as text that reads back as the same number or date. A date has microseconds, the resolution of a
/// 64-bit number of days.
impl fmt::Display for Cell<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let days = match self {
            Self::Empty => return Ok(()),
            Self::Text(text) => return out.write_str(text),
            Self::Number(number) => return write!(out, "{number}"),
            Self::Date(days) => *days,
        };
        let microseconds = (days * 86_400e6).round() as i64;
        // The extra day in spreadsheets, 29 February 1900, is earlier than any recording.
        let epoch = NaiveDate::from_ymd_opt(1899, 12, 30).and_then(|date| date.and_hms_opt(0, 0, 0));
        match epoch.and_then(|epoch| epoch.checked_add_signed(Duration::microseconds(microseconds))) {
            Some(moment) if days >= 1.0 => write!(out, "{}", moment.format("%Y-%m-%d %H:%M:%S%.6f")),
            Some(moment) => write!(out, "{}", moment.format("%H:%M:%S%.6f")),
            None => write!(out, "{days}"),
        }
    }
}

/// Cells of a column, with all texts in one allocation: a million short cells cost little more than their characters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    text: String,
    ends: Vec<usize>,
    /// Values of cells that are numbers in their container; not finite, or absent, for all others.
    numbers: Vec<f64>,
}

impl Cells {
    /// Appends a text.
    pub fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push(self.text.len());
    }

    /// Appends a cell and returns the bytes of its text.
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

    /// Returns the text of a cell; empty beyond the last one.
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
            out.push_cell(&self.cell(row));
        }
        out
    }

    /// Returns the texts of all cells.
    pub fn iter(&self) -> impl Iterator<Item = &str> + Clone {
        (0..self.len()).map(|row| self.get(row))
    }

    /// Returns all cells; those that are numbers in their container are numbers.
    pub(crate) fn cells(&self) -> impl Iterator<Item = Cell<'_>> {
        (0..self.len()).map(|row| self.cell(row))
    }

    fn cell(&self, row: usize) -> Cell<'_> {
        let number = self.numbers.get(row).copied().filter(|number| number.is_finite());
        number.map_or_else(|| Cell::Text(self.get(row).into()), Cell::Number)
    }
}
