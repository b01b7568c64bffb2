/// Significant digits of the rows that a correction stores. The fit uses the rounded numbers, as a reader of the file
/// does.
const DIGITS: usize = 6;

/// Rounds a number to `digits` significant digits, at least one.
pub(crate) fn significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// Rounds a number to the digits that are stored.
pub(crate) fn digits(value: f64) -> f64 {
    significant(value, DIGITS)
}
