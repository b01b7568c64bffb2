use std::fmt;

use crate::{Recording, ReferenceLag};

/// A doubt about the clock of a reference; see [`Recording::lag_doubt`].
///
/// ```
/// let doubt = ohmstrain::LagDoubt::OutOfReach { lag_s: -20.0 };
/// assert!(doubt.to_string().starts_with("the reference seems to be 20.00 s early or more"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum LagDoubt {
    /// As late as lags are looked for, or later: it cannot be moved.
    OutOfReach {
        /// How far lags are looked for, s; negative if the reference is early.
        lag_s: f64,
    },
    /// Late, too little to matter.
    Little(ReferenceLag),
    /// Late, but the readings do not tell for certain.
    Uncertain(ReferenceLag),
    /// Certainly too late to calibrate on.
    Certain(ReferenceLag),
}

impl LagDoubt {
    /// How late the reference is, where that is known.
    ///
    /// ```
    /// assert_eq!(ohmstrain::LagDoubt::OutOfReach { lag_s: 20.0 }.lag(), None);
    /// ```
    #[must_use]
    pub const fn lag(&self) -> Option<&ReferenceLag> {
        match self {
            Self::OutOfReach { .. } => None,
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
            None => self.lag_out_of_reach().map(|lag_s| LagDoubt::OutOfReach { lag_s }),
            Some(lag) if !lag.is_too_late() => Some(LagDoubt::Little(lag)),
            Some(lag) if !lag.is_certain => Some(LagDoubt::Uncertain(lag)),
            Some(lag) => Some(LagDoubt::Certain(lag)),
        }
    }
}

/// `2.00 s late`, and by how much that may be off.
impl fmt::Display for ReferenceLag {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        late(self.lag_s, out)?;
        if self.own_s > 0.0 {
            write!(out, ", give or take {:.1} s that the sensor may lag itself", self.own_s)?;
        }
        Ok(())
    }
}

fn late(lag_s: f64, out: &mut fmt::Formatter) -> fmt::Result {
    write!(out, "{:.2} s {}", lag_s.abs(), if lag_s < 0.0 { "early" } else { "late" })
}

impl fmt::Display for LagDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::OutOfReach { lag_s } => {
                out.write_str("the reference seems to be ")?;
                late(*lag_s, out)?;
                out.write_str(" or more, as far as lags are looked for; it was not moved: are both on one clock?")
            }
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
