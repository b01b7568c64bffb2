use std::fmt;

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
    /// As late as lags are looked for, or later: it cannot be moved.
    OutOfReach {
        /// How far lags are looked for, s; negative if the reference is early.
        lag_s: f64,
    },
    /// Not on time, but two lags fit alike, since the motion repeats: it cannot be moved.
    Repeats {
        /// The two lags, s, the better one first.
        lags_s: [f64; 2],
    },
    /// Late, too little to matter.
    Little(Lag),
    /// Late, but the readings do not tell for certain.
    Uncertain(Lag),
    /// Certainly too late to calibrate on.
    Certain(Lag),
}

impl LagDoubt {
    /// How late the reference is, where that is known.
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
    /// Asks whether the reference is on the clock of the readings; `None` if it is, as far as the readings tell.
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

/// A time by which the reference is late, s.
struct Late(f64);

impl fmt::Display for Late {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "{:.2} s {}", self.0.abs(), if self.0 < 0.0 { "early" } else { "late" })
    }
}

impl fmt::Display for LagDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::OutOfReach { lag_s } => write!(
                out,
                "the reference seems to be {} or more, as far as lags are looked for; it was not moved: are both on one clock?",
                Late(*lag_s)
            ),
            Self::Repeats { lags_s: [best_s, other_s] } => write!(
                out,
                "the reference seems to be {} or {}, which fit alike since the motion repeats; it was not moved: are both on one \
                 clock?",
                Late(*best_s),
                Late(*other_s)
            ),
            Self::Little(lag) => {
                write!(out, "the reference seems to be {lag}, little of the {:.1} s of a movement", lag.movement_s)
            }
            Self::Uncertain(lag) => write!(
                out,
                "the reference seems to be {lag}, where a movement takes {:.1} s; the readings do not tell for certain, and it was \
                 not moved: are both on one clock?",
                lag.movement_s
            ),
            Self::Certain(lag) => write!(
                out,
                "expected a reference on the clock of the readings, found one that seems to be {lag}, where a movement takes {:.1} s",
                lag.movement_s
            ),
        }
    }
}
