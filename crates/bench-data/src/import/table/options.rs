//! Properties of a file that are given in advance, and filters of its rows.

use std::fmt;
use std::str::FromStr;

use crate::import::words::DecimalMark;

/// Properties of a file that are given in advance; others are inferred.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// The decimal mark.
    pub decimal: Option<DecimalMark>,
    /// Number of lines above header and data.
    pub skip: Option<usize>,
    /// The sheet of a workbook.
    pub sheet: Option<String>,
    /// Filters of rows; a row must pass all of them.
    pub rows: Vec<RowFilter>,
}

/// Filter for rows with a given value in a column: `trial=2`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RowFilter {
    /// Heading, name or number (from 1) of the column.
    pub column: String,
    /// Value of the column in those rows.
    pub value: String,
}

impl fmt::Display for RowFilter {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}={}", self.column, self.value)
    }
}

impl FromStr for RowFilter {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (column, value) = text.split_once('=').ok_or("expected COLUMN=VALUE")?;
        Ok(Self { column: column.trim().to_owned(), value: value.trim().to_owned() })
    }
}
