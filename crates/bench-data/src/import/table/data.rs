use std::collections::HashMap;

use crate::import::bytes::Cell;
use crate::import::table::grid::{Grid, SAMPLE};
use crate::import::table::value::{is_number, value_of};
use crate::import::words::{DecimalMark, Value, ohms};

/// Number of cells of each kind in a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Shape {
    /// All cells.
    pub width: usize,
    /// Cells that are numbers, dates or times of day.
    pub numbers: usize,
    /// Cells that are none of these and not missing values.
    pub texts: usize,
}

impl Shape {
    pub(crate) fn of(cells: &[Cell], decimal: DecimalMark) -> Self {
        let mut shape = Self { width: cells.len(), ..Self::default() };
        let mut prefixed = 0;
        for cell in cells {
            if is_number(cell, decimal) {
                shape.numbers += 1;
            } else if value_of(cell, decimal, 0, &[]) == Value::Text {
                shape.texts += 1;
                prefixed += usize::from(matches!(cell, Cell::Text(text) if ohms(text, decimal).is_some()));
            }
        }
        // In `time,10k,22k` they are names of columns.
        if shape.numbers > 0 {
            (shape.numbers, shape.texts) = (shape.numbers + prefixed, shape.texts - prefixed);
        }
        shape
    }

    /// True if words replace some numbers of the data: `Date;13.5.2024`, `Maximum;1600`.
    pub(crate) const fn is_worded(self, data: Self) -> bool {
        self.numbers < data.numbers && self.texts > data.texts
    }
}

/// Common properties of the lines of data.
pub(crate) struct Data {
    pub shape: Shape,
    /// True if their last cells are empty: a separator at the end.
    pub ends_empty: bool,
    /// True if their first cells number them.
    pub is_numbered: bool,
}

impl Data {
    /// Finds the commonest number of cells in lines with a number, and the commonest shape of that width.
    pub(crate) fn find(grid: &Grid, decimal: DecimalMark, first: usize) -> Self {
        let rows =
            || (first..grid.len()).filter(|row| grid.comment(*row).is_none()).take(SAMPLE).map(|row| grid.cells(row));
        let shapes: Vec<Shape> =
            rows().map(|cells| Shape::of(&cells, decimal)).filter(|shape| shape.numbers > 0).collect();
        let commonest = |among: &dyn Fn(&Shape) -> Option<(usize, usize)>| {
            let mut counts = HashMap::<(usize, usize), usize>::new();
            shapes.iter().filter_map(among).for_each(|of| *counts.entry(of).or_default() += 1);
            counts.into_iter().max_by_key(|(of, count)| (*count, *of)).map(|(of, _)| of)
        };
        let width = commonest(&|shape| Some((shape.width, 0))).map_or(1, |(width, _)| width);
        let of_width = |shape: &Shape| (shape.width == width).then_some((shape.numbers, shape.texts));
        let (numbers, texts) = commonest(&of_width).unwrap_or((1, 0));
        let shape = Shape { width, numbers, texts };
        let data = || rows().filter(|cells| Shape::of(cells, decimal) == shape);
        let ends_empty = data().all(|cells| cells.last().is_none_or(Cell::is_empty));
        let counts: Vec<i64> = data().map_while(|cells| cells.first()?.to_string().parse().ok()).collect();
        let is_numbered = counts.len() > 2
            && counts.len() == data().count()
            && counts.windows(2).all(|pair| pair[1] > pair[0])
            && (matches!(counts[0], 0 | 1) || counts.windows(2).all(|pair| pair[1] == pair[0] + 1));
        Self { shape, ends_empty, is_numbered }
    }

    /// Returns the first line of data at or below `first`.
    pub(crate) fn first_row(&self, grid: &Grid, decimal: DecimalMark, first: usize) -> Option<usize> {
        let is_comment = |row: usize| grid.comment(row).is_some();
        let shape = |row: usize| Shape::of(&grid.cells(row), decimal);
        let is_data = |row: &usize| {
            let shape = shape(*row);
            !is_comment(*row) && shape.width == self.shape.width && shape.numbers > 0 && shape.numbers >= shape.texts
        };
        let found = (first..grid.len()).find(is_data)?;
        // `Date;13.5.2024` above the names also has a number.
        let sure = (found..grid.len()).find(|row| is_data(row) && !shape(*row).is_worded(self.shape)).unwrap_or(found);
        let clocks = usize::from(grid.has_monitor_clock());
        let has_names = (found..sure).any(|row| !is_comment(row) && shape(row).numbers <= clocks);
        let found = if has_names || (found < sure && self.numbers_as_names(grid, decimal, sure).is_some()) {
            sure
        } else if self.counted_names(grid, decimal, found + 1).is_some() {
            found + 1
        } else {
            found
        };
        // The first row below the names may lack its last cells.
        let is_short = |row: &usize| {
            let shape = shape(*row);
            !is_comment(*row) && (2..self.shape.width).contains(&shape.width) && shape.texts == 0 && shape.numbers > 1
        };
        let short = (first..found).rev().take_while(is_short).last();
        let is_below_names = |row: &usize| *row > first && self.heading_cells(grid, *row - 1).is_some();
        Some(short.filter(is_below_names).unwrap_or(found))
    }
}
