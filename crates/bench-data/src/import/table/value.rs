//! Cells of any container as numbers.

use crate::import::bytes::Cell;
use crate::import::words::{DecimalMark, SCPI_OVERLOAD, Value, is_stamp, number, value};

/// Returns the value of a cell of any container. Binary numbers have no decimal mark, whatever that of the file's
/// texts.
pub(crate) fn value_of(cell: &Cell, mark: DecimalMark, shift: i32, own: &[String]) -> Value {
    match cell {
        Cell::Number(number) if shift == 0 && own.is_empty() && number.abs() < SCPI_OVERLOAD => Value::Number(*number),
        Cell::Text(text) => value(text, mark, shift, own),
        cell => value(&cell.to_string(), DecimalMark::Point, shift, own),
    }
}

/// Returns the number in a cell.
pub(crate) fn number_of(cell: &Cell, mark: DecimalMark) -> Option<f64> {
    match cell {
        Cell::Number(number) => Some(*number).filter(|number| number.is_finite()),
        Cell::Text(text) => number(text, mark, 0),
        Cell::Date(_) | Cell::Empty => None,
    }
}

/// True if a cell is a number, a date or a time of day.
pub(crate) fn is_number(cell: &Cell, mark: DecimalMark) -> bool {
    matches!(cell, Cell::Date(_))
        || matches!(cell, Cell::Text(text) if is_stamp(text))
        || matches!(value_of(cell, mark, 0, &[]), Value::Number(_))
}
