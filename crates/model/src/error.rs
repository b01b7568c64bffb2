use core::fmt;

/// Name of an invalid parameter, and the problem with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct ParameterError {
    /// The parameter, as it is called in code and in files.
    pub parameter: &'static str,
    /// Problem with it.
    pub problem: Problem,
}

/// Problem with a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Problem {
    /// NaN, or infinite where a finite number is required.
    NotFinite,
    /// Zero or negative where a positive number is required.
    NotPositive,
    /// Below zero.
    Negative,
    /// Outside the interval in which the formula holds.
    OutOfRange,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let must = match self.problem {
            Problem::NotFinite => "must be a finite number",
            Problem::NotPositive => "must be positive",
            Problem::Negative => "must not be negative",
            Problem::OutOfRange => "is outside the range in which the model holds",
        };
        write!(out, "{} {must}", self.parameter)
    }
}

impl core::error::Error for ParameterError {}

impl ParameterError {
    /// Names a parameter and the problem with it.
    #[must_use]
    pub const fn new(parameter: &'static str, problem: Problem) -> Self {
        Self { parameter, problem }
    }
}
