//! Ranges of numbers in parameter files, and errors that name a number outside its range.

use thiserror::Error;

/// A number in a sensor's parameters outside its valid range.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("field `{field}`: expected {expected}, found {found}")]
pub struct FieldError {
    /// Path of the field: names of tables and index in an array, `law.branches[0].tau_s`.
    pub field: String,
    /// Expected values.
    pub expected: String,
    /// The value.
    pub found: String,
}

/// Range of a number, ends included.
#[derive(Clone, Copy)]
pub struct Allowed {
    /// Smallest value.
    pub least: f64,
    /// Largest value.
    pub most: f64,
}

impl Allowed {
    fn contains(self, value: f64) -> bool {
        (self.least..=self.most).contains(&value)
    }
}

/// Strains, degrees, coefficients: far beyond those of real sensors, yet small enough that squares and products stay
/// finite.
pub const SIGNED: Allowed = Allowed { least: -1e9, most: 1e9 };
/// Range of a branch's gain per strain, relative to R₀.
pub const GAIN: Allowed = Allowed { least: -LARGEST_CHANGE, most: LARGEST_CHANGE };
/// Resistances, times, rates, lengths. The search for noise and motion ends between `e^-25` and `e^15`.
pub const POSITIVE: Allowed = Allowed { least: 1e-12, most: 1e12 };
/// Rates, 1/s: squares of faster rates leave no digits in a belief, and the search ends far below.
pub const RATE: Allowed = Allowed { least: 1e-12, most: 1e8 };
/// Standard deviations of the strain, limited for the same reason.
pub const SPREAD: Allowed = Allowed { least: 1e-12, most: 1e6 };
/// Standard deviations that may be zero.
pub const AMOUNT: Allowed = Allowed { least: 0.0, most: 1e6 };
/// Times, rates and steps that may be zero.
pub const ZERO_OR_POSITIVE: Allowed = Allowed { least: 0.0, most: POSITIVE.most };
/// Probabilities and powers.
pub const SHARE: Allowed = Allowed { least: 0.0, most: 1.0 };
/// Factors on standard deviations; calibration yields 1 to 5.
pub const FACTOR: Allowed = Allowed { least: 1e-3, most: 1e3 };
/// Weights of training rows, and entries of matrices made of them.
pub const WEIGHT: Allowed = Allowed { least: -1e15, most: 1e15 };
/// Number for information only: a score, or a variance of undetermined parameters.
pub const ANY_NUMBER: Allowed = Allowed { least: -f64::INFINITY, most: f64::INFINITY };
/// Number for information only, zero or more.
pub const NON_NEGATIVE: Allowed = Allowed { least: 0.0, most: f64::INFINITY };

/// Largest change of resistance, relative to R₀, of a gauge curve within the law's range.
pub const LARGEST_CHANGE: f64 = 1e6;

/// Checks that fields of a structure are allowed, in this order; the error names the first that is not.
macro_rules! check {
    ($table:expr, $of:expr; $($field:ident: $allowed:expr),+ $(,)?) => {
        [$((stringify!($field), $of.$field, $allowed)),+]
            .into_iter()
            .try_for_each(|(name, value, allowed)| $table.number(name, value, allowed))
    };
}
pub(crate) use check;

/// A table of the file, identified by its path.
pub struct Table(String);

impl Table {
    /// The whole file.
    #[must_use]
    pub const fn root() -> Self {
        Self(String::new())
    }

    /// A table in it.
    #[must_use]
    pub fn table(&self, name: &str) -> Self {
        Self(self.path(name))
    }

    /// A table in an array of tables.
    #[must_use]
    pub fn entry(&self, name: &str, index: usize) -> Self {
        Self(format!("{}[{index}]", self.path(name)))
    }

    /// The path of a field.
    #[must_use]
    pub fn path(&self, name: &str) -> String {
        if self.0.is_empty() { name.to_string() } else { format!("{}.{name}", self.0) }
    }

    /// The error of a field.
    #[must_use]
    pub fn wrong(&self, name: &str, expected: impl Into<String>, found: impl ToString) -> FieldError {
        FieldError { field: self.path(name), expected: expected.into(), found: found.to_string() }
    }

    /// The error of several numbers of the table together.
    pub fn wrong_itself(&self, expected: String, found: String) -> FieldError {
        FieldError { field: self.0.clone(), expected, found }
    }

    /// Checks that a number is allowed.
    ///
    /// # Errors
    /// Names the field if not.
    pub fn number(&self, name: &str, value: f64, allowed: Allowed) -> Result<(), FieldError> {
        if allowed.contains(value) {
            return Ok(());
        }
        let Allowed { least, most } = allowed;
        Err(self.wrong(name, format!("{} to {}", short(least), short(most)), short(value)))
    }

    /// Checks that a number is allowed, if it is there.
    ///
    /// # Errors
    /// Names the field if not.
    pub fn some(&self, name: &str, value: Option<f64>, allowed: Allowed) -> Result<(), FieldError> {
        value.map_or(Ok(()), |value| self.number(name, value, allowed))
    }

    /// Checks that all numbers are allowed.
    ///
    /// # Errors
    /// Names the field, if not.
    pub fn numbers(&self, name: &str, values: &[f64], allowed: Allowed) -> Result<(), FieldError> {
        // Thousands of numbers are checked whenever a filter is built; names are formatted only for a wrong one.
        let wrong = values.iter().enumerate().find(|(_, value)| !allowed.contains(**value));
        wrong.map_or(Ok(()), |(index, value)| self.number(&format!("{name}[{index}]"), *value, allowed))
    }

    /// Checks that an array has the expected length.
    ///
    /// # Errors
    /// Names the field, if not.
    pub fn length(&self, name: &str, expected: usize, found: usize) -> Result<(), FieldError> {
        if found == expected { Ok(()) } else { Err(self.wrong(name, format!("{expected} entries"), found)) }
    }
}

/// Formats a number in few characters.
pub fn short(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-4..1e6).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::{Allowed, Table};

    #[test]
    fn the_first_wrong_number_of_several_is_named() {
        let share = Allowed { least: 0.0, most: 1.0 };
        let rows = Table::root().entry("rows", 3);
        assert_eq!(rows.numbers("past", &[0.0, 0.5, 1.0], share), Ok(()));
        let refused = rows.numbers("past", &[0.5, f64::NAN, 2.0], share).unwrap_err();
        assert_eq!(refused.to_string(), "field `rows[3].past[1]`: expected 0 to 1, found NaN");
    }
}
