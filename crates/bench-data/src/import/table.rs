use crate::Metadata;
use crate::import::bounds::check_cells;
use crate::import::error::ImportError;
use crate::import::grid::Grid;
use crate::import::header::{Header, Shape};
use crate::import::names;
use crate::import::number::{DecimalMark, has_groups};

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
    /// A table out of lines of cells.
    ///
    /// # Errors
    /// If it has more cells than may be held.
    pub(crate) fn of_grid(file: &str, grid: &Grid, header: Header, layout: Layout) -> Result<Self, ImportError> {
        check_cells(file, grid.len(), header.shape.width)?;
        let mut layout =
            Layout { skip: header.skip, header_lines: header.header_lines, unit_line: header.unit_line, ..layout };
        let mut cells = vec![Cells::default(); header.shape.width];
        let (mut numbers, mut widths) = (Vec::new(), Vec::new());
        let end = end_of_data(grid, &header, layout.decimal);
        for row in header.first_row..grid.len() {
            let line = grid.cells(row);
            if row >= end || grid.comment(row).is_some() || Shape::of(&line, layout.decimal).numbers == 0 {
                layout.text_lines += 1;
                layout.first_text_line.get_or_insert(grid.line(row));
                continue;
            }
            widths.push(line.len());
            if !layout.has_groups {
                layout.has_groups = line.iter().any(|cell| has_groups(cell, layout.decimal));
            }
            numbers.push(grid.line(row));
            for (column, cells) in cells.iter_mut().enumerate() {
                cells.push(line.get(column).map_or("", |cell| cell));
            }
        }
        let columns = header.headings.iter().zip(&header.units).zip(cells).map(|((heading, unit), cells)| {
            let (name, own) = names::take_apart(heading);
            Column { name, heading: heading.clone(), unit: unit.clone().or(own), cells }
        });
        // A separator at the end of each line makes a column of nothing.
        let mut columns: Vec<Column> = columns.collect();
        while columns.last().is_some_and(|last| last.heading.is_empty() && last.cells.iter().all(str::is_empty)) {
            columns.pop();
        }
        layout.short_lines = widths.into_iter().filter(|width| *width < columns.len()).count();
        Ok(Self { file: file.to_owned(), layout, metadata: header.metadata, columns, lines: numbers })
    }

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

/// Where the lines begin that stand behind the data: text, sums with a word before them, and a line that was cut.
fn end_of_data(grid: &Grid, header: &Header, decimal: DecimalMark) -> usize {
    let is_behind = |row: &usize| {
        let shape = Shape::of(&grid.cells(*row), decimal);
        let is_cut = *row + 1 == grid.len()
            && matches!(grid, Grid::Text { is_open: true, .. })
            && shape.width < header.shape.width
            && shape.numbers < header.shape.numbers;
        grid.comment(*row).is_some() || shape.numbers == 0 || shape.is_worded(header.shape) || is_cut
    };
    (header.first_row..grid.len()).rev().take_while(is_behind).last().unwrap_or(grid.len())
}
