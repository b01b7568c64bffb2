//! The filled cells of a sheet, and the rows that they form.

use crate::import::bytes::bounds::{LARGEST_WORKBOOK, MOST_SHEET_CELLS, MOST_SHEET_COLUMNS, mib};
use crate::import::bytes::cell::{Cell, Rows};

/// Sheets of a workbook by their names.
pub(crate) type NamedSheets = Vec<(String, Rows<'static>)>;

/// Remaining number of cells and bytes for the sheets of a workbook.
pub(crate) struct Budget {
    cells: usize,
    bytes: u64,
}

impl Default for Budget {
    fn default() -> Self {
        Self { cells: MOST_SHEET_CELLS, bytes: LARGEST_WORKBOOK }
    }
}

/// Reason for refusing a workbook that is too large.
pub(crate) type TooMuch = String;

impl Budget {
    /// Takes cells, with this many bytes in all, from the budget.
    pub(crate) fn take(&mut self, cells: usize, bytes: u64) -> Result<(), TooMuch> {
        let too_many = || {
            format!(
                "expected at most {MOST_SHEET_CELLS} cells in a workbook, those counted that are empty or repeated, found \
                 more: save the sheet with the recording as CSV"
            )
        };
        self.cells = self.cells.checked_sub(cells).ok_or_else(too_many)?;
        let too_long = || {
            let most = mib(LARGEST_WORKBOOK);
            format!(
                "expected at most {most} MiB of text in a workbook, found more: save the sheet with the recording as CSV"
            )
        };
        self.bytes = self.bytes.checked_sub(bytes).ok_or_else(too_long)?;
        Ok(())
    }
}

/// Cells of a sheet by row and column, counted from 0, in any order.
#[derive(Default)]
pub(crate) struct Sheet {
    cells: Vec<(u32, u32, Cell<'static>)>,
}

impl Sheet {
    /// Adds a cell that is not empty; it replaces one in the same place.
    pub(crate) fn push(&mut self, place: (u32, u32), cell: Cell<'static>, budget: &mut Budget) -> Result<(), TooMuch> {
        match &cell {
            Cell::Empty => return Ok(()),
            Cell::Text(text) => budget.take(1, text.len() as u64)?,
            Cell::Number(_) | Cell::Date(_) => budget.take(1, 0)?,
        }
        self.cells.push((place.0, place.1, cell));
        Ok(())
    }

    /// Returns rows that are not empty, with their numbers, from the first column that is not empty to the last.
    pub(crate) fn rows(mut self, budget: &mut Budget) -> Result<Rows<'static>, TooMuch> {
        self.cells.sort_by_key(|(row, column, _)| (*row, *column));
        let columns = || self.cells.iter().map(|(_, column, _)| *column);
        let (Some(first), Some(last)) = (columns().min(), columns().max()) else { return Ok(Vec::new()) };
        let width = (last - first) as usize + 1;
        let filled: Vec<u32> = self.cells.iter().map(|(row, ..)| *row).collect();
        let height = filled.chunk_by(|a, b| a == b).count();
        let row = self.cells.iter().find(|(_, column, _)| *column == last).map_or(0, |(row, ..)| *row);
        check_size((row, last), height, width)?;
        budget.take(width * height - self.cells.len().min(width * height), 0)?;
        let mut rows: Rows = Vec::with_capacity(height);
        for (row, column, cell) in self.cells {
            let number = u64::from(row) + 1;
            if rows.last().is_none_or(|(last, _)| *last != number) {
                rows.push((number, vec![Cell::Empty; width]));
            }
            if let Some((_, cells)) = rows.last_mut() {
                cells[(column - first) as usize] = cell;
            }
        }
        rows.retain(|(_, cells)| cells.iter().any(|cell| !cell.is_empty()));
        Ok(rows)
    }
}

/// Refuses a sheet that is too large; the message names a cell in its last column, which may be a stray one.
pub(crate) fn check_size((row, column): (u32, u32), height: usize, width: usize) -> Result<(), TooMuch> {
    if width <= MOST_SHEET_COLUMNS && width.saturating_mul(height) <= MOST_SHEET_CELLS {
        return Ok(());
    }
    let cell = format!("{}{}", letters(column), u64::from(row) + 1);
    Err(format!(
        "expected a sheet of at most {MOST_SHEET_COLUMNS} columns and {MOST_SHEET_CELLS} cells, found {height} rows of \
         {width} columns: cell {cell} stands in the last of them; if it has strayed there, empty it, and otherwise save the \
         recording as CSV"
    ))
}

/// Returns the name of a column, counted from 0: A, B, … Z, AA.
fn letters(column: u32) -> String {
    let (mut left, mut name) = (u64::from(column) + 1, Vec::new());
    while left > 0 {
        left -= 1;
        name.push(char::from(b'A' + (left % 26) as u8));
        left /= 26;
    }
    name.into_iter().rev().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(cells: &[(u32, u32)]) -> Result<Rows<'static>, TooMuch> {
        let (mut sheet, mut budget) = (Sheet::default(), Budget::default());
        for place in cells {
            sheet.push(*place, Cell::Number(1.0), &mut budget)?;
        }
        sheet.rows(&mut budget)
    }

    #[test]
    fn columns_have_the_names_that_programs_show() {
        assert_eq!([0, 25, 26, 701, 702, 16_383].map(letters), ["A", "Z", "AA", "ZZ", "AAA", "XFD"]);
    }

    #[test]
    fn a_sheet_goes_from_its_first_cell_to_its_last_and_is_as_high_as_rows_are_filled() {
        let found = rows(&[(1_048_575, 2), (3, 1)]).unwrap();
        assert_eq!(
            found,
            [(4, vec![Cell::Number(1.0), Cell::Empty]), (1_048_576, vec![Cell::Empty, Cell::Number(1.0)])]
        );
        assert!(rows(&[]).unwrap().is_empty());
    }

    #[test]
    fn a_cell_far_to_the_right_is_named() {
        let error = rows(&[(0, 0), (1_048_575, 16_383)]).unwrap_err();
        assert!(error.contains("cell XFD1048576") && error.contains("2 rows of 16384 columns"), "{error}");
        // Cells that are alone in their rows and columns, each near the others.
        let diagonal: Vec<(u32, u32)> = (0..20_000).map(|place| (place, place % 4096)).collect();
        assert!(rows(&diagonal).unwrap_err().contains("20000 rows of 4096 columns"));
    }
}
