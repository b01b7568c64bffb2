use core::fmt;

/// Reason for rejecting a Kalman filter's step. The distribution passed in is still the best available.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum KalmanError {
    /// An entry of the reading is NaN or infinite; a missing entry is `None`.
    NonFiniteReading,
    /// The initial P is not finite, symmetric and positive semi-definite.
    InitialCovariance,
    /// Q, or the transition of the state, is not finite, or Q is not symmetric and positive semi-definite.
    ProcessNoise,
    /// R, or the expected reading, is not finite, or R is not symmetric and positive semi-definite.
    ReadingNoise,
    /// S has no inverse: neither the state nor the reading has any uncertainty.
    SingularInnovation,
    /// The reading is so much more exact than the prior that rounding would change the posterior variance by more than
    /// a thousandth. The limit is a standard deviation 5e5 times smaller in one step in `f32`, and 3e14 times in `f64`.
    LostPrecision,
    /// The new state is not finite.
    NonFiniteState,
    /// The reading's time is not finite, or earlier than the oldest time stored in a [`Rewind`](super::Rewind).
    TimeOutOfReach,
    /// Input and output differ in length.
    Length,
}

impl fmt::Display for KalmanError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::NonFiniteReading => "the reading has an entry that is not a finite number",
            Self::InitialCovariance => "the initial covariance P is not a covariance",
            Self::ProcessNoise => "the process noise Q is not a covariance, or the transition is not finite",
            Self::ReadingNoise => "the reading noise R is not a covariance, or the expected reading is not finite",
            Self::SingularInnovation => "the innovation covariance S has no inverse",
            Self::LostPrecision => "the reading is too exact beside the prior for numbers of this precision",
            Self::NonFiniteState => "the new state is not finite",
            Self::TimeOutOfReach => "the reading's time is not among those remembered",
            Self::Length => "input and output differ in length",
        })
    }
}

impl core::error::Error for KalmanError {}
