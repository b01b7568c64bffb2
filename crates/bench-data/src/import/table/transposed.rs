//! Tables whose lines are columns: a name, followed by all its numbers.

use crate::import::bytes::{Cell, Rows};
use crate::import::table::grid::Grid;
use crate::import::table::value::is_number;
use crate::import::words::{DecimalMark, units};

/// Largest number of lines in such a table.
const MOST_LINES: usize = 24;
/// Least number of cells in each line, absolutely and per line of the table.
const FEWEST_CELLS: usize = 20;
const CELLS_PER_LINE: usize = 4;
/// Largest number of cells before the numbers: a name and a unit.
const MOST_LABELS: usize = 2;

/// Returns the rows of a table whose rows and columns are exchanged, below a line of names if there are any; `None` if it is not such a
/// table. The number of a row is that of its cells in the lines.
pub(crate) fn exchanged(grid: &Grid, decimal: DecimalMark) -> Option<Rows<'static>> {
    let lines: Vec<usize> = (0..grid.len()).filter(|row| grid.comment(*row).is_none()).take(MOST_LINES + 1).collect();
    if !(2..=MOST_LINES).contains(&lines.len()) {
        return None;
    }
    let lines: Vec<Vec<Cell>> = lines.into_iter().map(|row| filled(grid, row)).collect();
    let width = lines[0].len();
    let labels = labels(&lines, decimal)?;
    let is_wide = width >= FEWEST_CELLS.max(CELLS_PER_LINE * lines.len());
    let are_numbers = |line: &Vec<Cell>| {
        let numbers = line[labels..].iter().filter(|cell| is_number(cell, decimal)).count();
        line.len() == width && numbers * 10 >= (width - labels) * 8
    };
    let is_clock = |line: &Vec<Cell>| {
        let numbers: Vec<f64> = line.iter().filter_map(|cell| cell.to_string().parse().ok()).collect();
        numbers.len() == width && numbers.windows(2).all(|pair| pair[1] > pair[0])
    };
    if !is_wide
        || !lines.iter().all(are_numbers)
        || (labels == 0 && lines.iter().filter(|line| is_clock(line)).count() != 1)
    {
        return None;
    }
    let names = (labels > 0).then(|| (1, lines.iter().map(|line| name(&line[..labels])).collect()));
    let row = |place: usize| (place as u64 + 1, lines.iter().map(|line| owned(&line[place])).collect());
    Some(names.into_iter().chain((labels..width).map(row)).collect())
}

/// Returns the cells of a line up to the last that is not empty.
fn filled<'a>(grid: &'a Grid, row: usize) -> Vec<Cell<'a>> {
    let mut cells = grid.cells(row).into_owned();
    while cells.last().is_some_and(Cell::is_empty) {
        cells.pop();
    }
    cells
}

/// Returns the number of words before the numbers of each line; `None` if only some lines have one.
fn labels(lines: &[Vec<Cell>], decimal: DecimalMark) -> Option<usize> {
    let of = |line: &Vec<Cell>| line.iter().take_while(|cell| !is_number(cell, decimal)).count();
    let most = lines.iter().map(of).max()?;
    let has_name =
        |line: &Vec<Cell>| line.first().is_some_and(|cell| cell.to_string().starts_with(char::is_alphabetic));
    (most == 0 || (most <= MOST_LABELS && lines.iter().all(has_name))).then_some(most)
}

/// Joins a name with the unit after it.
fn name(labels: &[Cell]) -> Cell<'static> {
    let texts: Vec<String> = labels.iter().map(Cell::to_string).collect();
    Cell::Text(match &texts[..] {
        [name, unit] if units::is_unit(unit) => format!("{name} ({})", unit.trim_matches(['(', ')', '[', ']'])).into(),
        texts => texts.join(" ").trim().to_owned().into(),
    })
}

fn owned(cell: &Cell) -> Cell<'static> {
    match cell {
        Cell::Empty => Cell::Empty,
        Cell::Text(text) => Cell::Text(text.clone().into_owned().into()),
        Cell::Number(number) => Cell::Number(*number),
        Cell::Date(days) => Cell::Date(*days),
    }
}
