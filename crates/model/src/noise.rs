use crate::Scalar;
use crate::error::{ParameterError, Problem};

/// Part of the reading that the law does not explain, in units of ρ = R/R₀ - 1.
///
/// Sensor noise is a small part of it; model error, which varies slowly, is ten to a hundred times larger. Model error
/// belongs in the baseline and the branches. As white noise in `reading_sd` it makes a filter overconfident.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ModelNoise<T> {
    /// White noise of one reading.
    pub reading_sd: T,
    /// Long-run standard deviation of each branch around its law.
    pub branch_sd: T,
    /// Long-run standard deviation of the baseline.
    pub baseline_sd: T,
    /// Correlation time of the baseline, s.
    pub baseline_time_s: T,
}

impl<T: Scalar> ModelNoise<T> {
    /// Checks every parameter.
    ///
    /// # Errors
    /// Names a deviation that is negative or not finite, or a time that is not positive.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for (name, value) in
            [("reading_sd", self.reading_sd), ("branch_sd", self.branch_sd), ("baseline_sd", self.baseline_sd)]
        {
            if !value.is_finite() {
                return Err(ParameterError::new(name, Problem::NotFinite));
            }
            if value < T::zero() {
                return Err(ParameterError::new(name, Problem::Negative));
            }
        }
        if !(self.baseline_time_s > T::zero()) {
            return Err(ParameterError::new("baseline_time_s", Problem::NotPositive));
        }
        Ok(())
    }
}
