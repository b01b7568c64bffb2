use crate::Metadata;
use crate::import::number::DecimalMark;

/// Texts, one after the other in one allocation: a million short cells cost little more than their characters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    text: String,
    ends: Vec<usize>,
}

impl Cells {
    /// Appends a cell.
    pub fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push(self.text.len());
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there is no cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// A cell; empty beyond the last one.
    #[must_use]
    pub fn get(&self, row: usize) -> &str {
        let Some(&end) = self.ends.get(row) else { return "" };
        let start = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.text[start..end]
    }

    /// All cells.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).map(|row| self.get(row))
    }
}

/// A column as the file has it.
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

/// How a file is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// What kind of file, in words: `text`, `XLSX, sheet `…``, `Parquet`, after `gzip, ` if it was compressed.
    pub format: String,
    /// Encoding of text.
    pub encoding: Option<&'static str>,
    /// What separates the cells of text, in words.
    pub separator: Option<&'static str>,
    /// The decimal mark.
    pub decimal: DecimalMark,
    /// The file decides between point and comma by thousands only: `1,234`.
    pub decimal_is_open: bool,
    /// Marks group thousands somewhere.
    pub has_groups: bool,
    /// Lines passed over above header and data.
    pub skip: usize,
    /// Header lines.
    pub header_lines: usize,
    /// Whether a line of units follows the header.
    pub unit_line: bool,
    /// Lines of text among or behind the data, and a last one that was cut, which are passed over.
    pub text_lines: usize,
    /// The first of them, counted from 1.
    pub first_text_line: Option<u64>,
    /// Rows with fewer cells than there are columns.
    pub short_lines: usize,
}

/// A file's cells by column, and how they were written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// What messages call the file.
    pub file: String,
    /// How it is written.
    pub layout: Layout,
    /// What `# key = value` lines above the header say.
    pub metadata: Metadata,
    /// The columns.
    pub columns: Vec<Column>,
    /// The physical line (or row) of each row, counted from 1.
    pub lines: Vec<u64>,
}

impl Table {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Whether any column has a name.
    #[must_use]
    pub fn has_names(&self) -> bool {
        self.columns.iter().any(|column| !column.heading.is_empty())
    }
}
