use crate::error::{Fault, quote};

const POSITIVE: &str = "a positive resistance, or nothing for a missing reading";

/// Reads a number; NaN for an empty or `NaN` cell.
///
/// ±∞ is bad data: no instrument measures it, and in arithmetic it would pass for a value.
pub(crate) fn number(column: &'static str, cell: &str) -> Result<f64, Fault> {
    if cell.is_empty() {
        return Ok(f64::NAN);
    }
    match cell.parse::<f64>() {
        Ok(value) if value.is_infinite() => Err(Fault::in_column(column, "a finite number", quote(cell))),
        Ok(value) => Ok(value),
        Err(_) => Err(Fault::in_column(column, "a number", quote(cell))),
    }
}

/// Reads a positive number, or NaN for a missing one.
pub(crate) fn positive(column: &'static str, cell: &str) -> Result<f64, Fault> {
    let value = number(column, cell)?;
    if value <= 0.0 { Err(Fault::in_column(column, POSITIVE, quote(cell))) } else { Ok(value) }
}

/// Reads a whole number from 0, or `None` for an empty or `NaN` cell.
pub(crate) fn code(column: &'static str, cell: &str) -> Result<Option<u32>, Fault> {
    if cell.is_empty() || cell.eq_ignore_ascii_case("nan") {
        return Ok(None);
    }
    let wrong = |_| Fault::in_column(column, "a converter code, a whole number from 0", quote(cell));
    cell.parse().map(Some).map_err(wrong)
}
