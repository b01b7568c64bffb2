use core::fmt;

/// Why a step was not taken. The belief that was passed in is still the best there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StepError {
    /// The reading is NaN or infinite; a missing reading is `None`.
    NonFiniteReading,
    /// The time step is NaN or infinite.
    NonFiniteTimeStep,
    /// Time went backwards.
    NegativeTimeStep,
    /// The innovation's variance is not a positive number: neither the state nor the reading has any uncertainty left,
    /// or the belief passed in is no covariance.
    NonPositiveInnovationVariance,
    /// A late reading is older than everything that is remembered.
    ReadingTooOld,
    /// The new state would not be finite: the belief or the model's parameters are far out of range.
    NonFiniteState,
    /// The model's gauge curve is not of the family that the filter was made for.
    OtherGauge,
}

impl fmt::Display for StepError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::NonFiniteReading => "the reading is not a finite number",
            Self::NonFiniteTimeStep => "the time step is not a finite number",
            Self::NegativeTimeStep => "the time step is negative",
            Self::NonPositiveInnovationVariance => "the innovation's variance is not positive",
            Self::ReadingTooOld => "the reading is older than the remembered steps",
            Self::NonFiniteState => "the new state is not finite",
            Self::OtherGauge => "the gauge curve is of another family than the filter's",
        })
    }
}

impl core::error::Error for StepError {}
