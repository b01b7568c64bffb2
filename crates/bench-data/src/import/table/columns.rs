use crate::Metadata;
use crate::error::quote;
use crate::import::bytes::Cells;
use crate::import::table::grid::MONITOR_CLOCK;
use crate::import::table::value::number_of;
use crate::import::words::{DecimalMark, names};

/// A column as in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// Its name without the unit; empty if it has none.
    pub name: String,
    /// Its name as it stands in the header.
    pub heading: String,
    /// Its unit as the file writes it, from the heading or a line of units.
    pub unit: Option<String>,
    /// Its cells.
    pub cells: Cells,
}

impl Column {
    /// Makes a column from its heading and a unit from another source.
    pub(crate) fn new(heading: String, unit: Option<String>, cells: Cells) -> Self {
        let (name, own) = names::take_apart(&heading);
        Self { name, heading, unit: unit.or(own), cells }
    }
}

/// Format of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// Kind of file, in words: `text`, `XLSX, sheet `…``, `Parquet`, after `gzip, ` if it was compressed.
    pub format: String,
    /// Encoding of text.
    pub encoding: Option<&'static str>,
    /// Separator of the cells of text, in words.
    pub separator: Option<&'static str>,
    /// The decimal mark.
    pub decimal: DecimalMark,
    /// True if the decimal mark is ambiguous because commas occur only as in `1,234`.
    pub decimal_is_open: bool,
    /// True if marks group thousands anywhere.
    pub has_groups: bool,
    /// Number of lines skipped above header and data.
    pub skip: usize,
    /// Number of header lines.
    pub header_lines: usize,
    /// True if a line of units follows the header.
    pub unit_line: bool,
    /// Rows per second according to a line above the data, and the number of that line.
    pub rate: Option<(f64, u64)>,
    /// True if rows and columns are exchanged: each line of the file is a column.
    pub is_exchanged: bool,
    /// True if each line is a value, of several quantities in turn.
    pub values_in_turn: bool,
    /// Number of names in the header, if it differs from that of columns; they belong to the first columns.
    pub given_names: Option<usize>,
    /// Number of skipped lines: text among or after the data, and a truncated last line.
    pub text_lines: usize,
    /// The first of them, counted from 1.
    pub first_text_line: Option<u64>,
    /// Number of rows with fewer cells than columns.
    pub short_lines: usize,
}

/// Cells of a file by column, with the file's format.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Name of the file in messages.
    pub file: String,
    /// Format of the file.
    pub layout: Layout,
    /// Metadata of the `# key = value` lines above the header.
    pub metadata: Metadata,
    /// The columns.
    pub columns: Vec<Column>,
    /// The physical line (or row) of each row in the file, counted from 1.
    pub lines: Vec<u64>,
}

impl Table {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// True if there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Returns the name of a column in messages.
    pub(crate) fn name(&self, column: usize) -> String {
        match self.columns.get(column) {
            Some(column) if !column.heading.is_empty() => quote(&column.heading),
            _ => (column + 1).to_string(),
        }
    }

    /// Lists the columns for messages.
    pub(crate) fn list(&self) -> String {
        let names: Vec<String> = (0..self.columns.len()).take(12).map(|column| self.name(column)).collect();
        names.join(", ") + if self.columns.len() > 12 { " …" } else { "" }
    }

    /// True if the numbers of a column increase from row to row, with few exceptions.
    pub(crate) fn increases(&self, column: usize) -> bool {
        let cells = self.columns[column].cells.cells();
        let known: Vec<f64> = cells.filter_map(|cell| number_of(&cell, self.layout.decimal)).collect();
        let steps = known.len().saturating_sub(1);
        let upward = known.windows(2).filter(|pair| pair[1] > pair[0]).count();
        known.len() * 10 > self.len() * 9 && steps > 0 && upward * 100 >= steps * 98
    }

    /// True if any column has a name, apart from the clock of a serial monitor.
    #[must_use]
    pub fn has_names(&self) -> bool {
        self.columns.iter().any(|column| !column.heading.is_empty() && column.heading != MONITOR_CLOCK)
    }
}

/// Lists the names of all files for messages.
pub(crate) fn all_files(tables: &[Table]) -> String {
    tables.iter().map(|table| table.file.as_str()).collect::<Vec<_>>().join(", ")
}
