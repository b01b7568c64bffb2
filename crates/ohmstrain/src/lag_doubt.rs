use ohmstrain_calib::{Lag, LagError};

use crate::Recording;

/// A doubt about the clock of a reference; see [`Recording::lag_doubt`].
///
/// ```
/// let doubt = ohmstrain::LagDoubt::OutOfReach { lag_s: -12.0 };
/// assert!(doubt.to_string().starts_with("the reference seems to be 12.00 s early or more"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LagDoubt {
    /// Lag at the end of the searched range, or beyond: the reference cannot be moved.
    OutOfReach {
        /// Largest lag searched for, s; negative if the reference is early.
        lag_s: f64,
    },
    /// Two lags that fit equally well, neither of them zero, since the motion repeats: the reference cannot be moved.
    Repeats {
        /// The two lags, s, the better one first.
        lags_s: [f64; 2],
    },
    /// Late, but too little to matter.
    Little(Lag),
    /// Late, but the readings do not determine it with certainty.
    Uncertain(Lag),
    /// Certainly too late to calibrate on.
    Certain(Lag),
}

impl LagDoubt {
    /// Returns the reference's lag, if it is known.
    ///
    /// ```
    /// assert_eq!(ohmstrain::LagDoubt::OutOfReach { lag_s: 12.0 }.lag(), None);
    /// ```
    #[must_use]
    pub const fn lag(&self) -> Option<&Lag> {
        match self {
            Self::OutOfReach { .. } | Self::Repeats { .. } => None,
            Self::Little(lag) | Self::Uncertain(lag) | Self::Certain(lag) => Some(lag),
        }
    }
}

impl Recording<'_> {
    /// Checks that the reference has the clock of the readings; returns `None` if it does, as far as the readings show.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// assert_eq!(recording.lag_doubt(), None);
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub fn lag_doubt(&self) -> Option<LagDoubt> {
        match self.reference_lag() {
            Err(LagError::AtEnd(lag_s)) => Some(LagDoubt::OutOfReach { lag_s }),
            Err(LagError::Repeats(best_s, other_s)) => Some(LagDoubt::Repeats { lags_s: [best_s, other_s] }),
            Err(_) => None,
            Ok(lag) if !lag.is_sure() => None,
            Ok(lag) if !lag.is_too_late() => Some(LagDoubt::Little(lag)),
            Ok(lag) if !lag.is_certain() => Some(LagDoubt::Uncertain(lag)),
            Ok(lag) => Some(LagDoubt::Certain(lag)),
        }
    }
}
