use core::fmt;

/// Reason for rejecting a step. The belief passed in is still the best available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StepError {
    /// The reading is NaN or infinite; a missing reading is `None`.
    NonFiniteReading,
    /// The extra variance of a reading is negative.
    NegativeVariance,
    /// The time step is NaN or infinite.
    NonFiniteTimeStep,
    /// Time went backwards.
    NegativeTimeStep,
    /// The innovation variance is not a positive number: neither the state nor the reading has any uncertainty left, or
    /// the belief's covariance is not positive semi-definite.
    NonPositiveInnovationVariance,
    /// The new state would not be finite: the belief or the model's parameters are far out of range.
    NonFiniteState,
    /// The model's gauge curve is not of the family for which the filter was built.
    OtherGauge,
    /// The estimator has no smoother.
    NoSmoother,
    /// The reading at rest is implausible: it differs from that of the calibration by more than a factor of
    /// [`FARTHEST_REST`](crate::live::FARTHEST_REST).
    ImplausibleRest,
}

impl StepError {
    /// True if the same step without its reading may succeed: the reading is too far away, or too exact, for the
    /// floating-point precision.
    #[must_use]
    pub const fn is_of_the_reading(self) -> bool {
        matches!(self, Self::NonFiniteState | Self::NonPositiveInnovationVariance)
    }
}

impl fmt::Display for StepError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::NonFiniteReading => "the reading is not a finite number",
            Self::NegativeVariance => "the reading's variance is negative",
            Self::NonFiniteTimeStep => "the time step is not a finite number",
            Self::NegativeTimeStep => "the time step is negative",
            Self::NonPositiveInnovationVariance => "the innovation's variance is not positive",
            Self::NonFiniteState => "the new state is not finite",
            Self::OtherGauge => "the gauge curve is of another family than the filter's",
            Self::NoSmoother => "the estimator has no smoother",
            Self::ImplausibleRest => "what the rested sensor reads is more than four times, or less than a quarter of, what it read in calibration",
        })
    }
}

impl core::error::Error for StepError {}
