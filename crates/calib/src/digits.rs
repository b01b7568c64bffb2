/// Significant digits of the rows that a correction keeps. The fit sees the same numbers as the reader of a file.
const DIGITS: usize = 6;

/// A number with so many significant digits, one or more.
pub(crate) fn significant(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// A number as it is kept.
pub(crate) fn digits(value: f64) -> f64 {
    significant(value, DIGITS)
}
