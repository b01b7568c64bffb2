use core::fmt;

use crate::ReadingVerdict;

/// Flags of an estimate: everything reported about it besides its numbers.
///
/// ```
/// use ohmstrain_ekf::live::{Flag, Flags};
///
/// let flags = Flags::NONE.with(Flag::AtLimit, true).with(Flag::Missing, true);
/// assert!(flags.has(Flag::Missing) && !flags.has(Flag::Stuck));
/// assert_eq!(flags.to_string(), "missing|at_limit");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u16);

/// One of the [`Flags`], in the order in which they are written.
///
/// ```
/// assert_eq!(ohmstrain_ekf::live::Flag::RampBorder.name(), "ramp_border");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Flag {
    /// Missing reading.
    Missing,
    /// The converter's code was at an end of its scale.
    Saturated,
    /// The reading was rejected by a gate, or because of the limits of floating-point numbers.
    Rejected,
    /// The reading was off by three standard deviations or more, and taken with reduced weight.
    Downweighted,
    /// Not a possible reading of this sensor; it was not taken.
    Implausible,
    /// The same number for longer than in calibration; it was not taken.
    Stuck,
    /// Taken although beyond the gate, because too many in a row were rejected.
    Readmitted,
    /// Ramp border nearby: at the present speed the reading hardly depends on the strain.
    RampBorder,
    /// The strain is at a limit.
    AtLimit,
    /// The filter has just started, at an unknown strain.
    StartUp,
    /// Readings have jumped, or have returned after a time without plausible ones: the estimate is recovering.
    Recovering,
    /// Readings are, or recently were, outside the calibrated range, or the strain changes much faster than in
    /// calibration.
    Extrapolated,
    /// The run is longer than any recording of the calibration.
    LongRun,
    /// The reading at rest is not that of the calibration: R₀ has changed.
    RestMoved,
}

impl Flag {
    /// All flags.
    ///
    /// ```
    /// assert_eq!(ohmstrain_ekf::live::Flag::ALL.len(), 14);
    /// ```
    pub const ALL: [Self; 14] = [
        Self::Missing,
        Self::Saturated,
        Self::Rejected,
        Self::Downweighted,
        Self::Implausible,
        Self::Stuck,
        Self::Readmitted,
        Self::RampBorder,
        Self::AtLimit,
        Self::StartUp,
        Self::Recovering,
        Self::Extrapolated,
        Self::LongRun,
        Self::RestMoved,
    ];

    /// Name in `estimates.csv`.
    ///
    /// ```
    /// assert_eq!(ohmstrain_ekf::live::Flag::AtLimit.name(), "at_limit");
    /// ```
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Saturated => "saturated",
            Self::Rejected => "rejected",
            Self::Downweighted => "downweighted",
            Self::Implausible => "implausible",
            Self::Stuck => "stuck",
            Self::Readmitted => "readmitted",
            Self::RampBorder => "ramp_border",
            Self::AtLimit => "at_limit",
            Self::StartUp => "start_up",
            Self::Recovering => "recovering",
            Self::Extrapolated => "extrapolated",
            Self::LongRun => "long_run",
            Self::RestMoved => "rest_moved",
        }
    }
}

impl Flags {
    /// No flags.
    ///
    /// ```
    /// assert_eq!(ohmstrain_ekf::live::Flags::NONE.to_string(), "");
    /// ```
    pub const NONE: Self = Self(0);

    /// Returns the flags of a verdict on a reading.
    ///
    /// ```
    /// use ohmstrain_ekf::{ReadingVerdict, live::Flags};
    ///
    /// assert_eq!(Flags::of(ReadingVerdict::Stuck).to_string(), "stuck");
    /// assert_eq!(Flags::of(ReadingVerdict::Accepted), Flags::NONE);
    /// ```
    #[must_use]
    pub const fn of(verdict: ReadingVerdict) -> Self {
        match verdict {
            ReadingVerdict::Accepted => Self::NONE,
            ReadingVerdict::Missing => Self::NONE.with(Flag::Missing, true),
            ReadingVerdict::Downweighted => Self::NONE.with(Flag::Downweighted, true),
            ReadingVerdict::Rejected => Self::NONE.with(Flag::Rejected, true),
            ReadingVerdict::Readmitted => Self::NONE.with(Flag::Readmitted, true),
            ReadingVerdict::Implausible => Self::NONE.with(Flag::Implausible, true),
            ReadingVerdict::Stuck => Self::NONE.with(Flag::Stuck, true),
        }
    }

    /// Adds a flag if `raised`.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{Flag, Flags};
    ///
    /// assert_eq!(Flags::NONE.with(Flag::Stuck, false), Flags::NONE);
    /// ```
    #[must_use]
    pub const fn with(self, flag: Flag, raised: bool) -> Self {
        Self(self.0 | (raised as u16) << flag as u16)
    }

    /// Returns the flags raised in either set.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{Flag, Flags};
    ///
    /// let either = Flags::NONE.with(Flag::Stuck, true).and(Flags::NONE.with(Flag::AtLimit, true));
    /// assert_eq!(either.to_string(), "stuck|at_limit");
    /// ```
    #[must_use]
    pub const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// True if the flag is raised.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{Flag, Flags};
    ///
    /// assert!(Flags::NONE.with(Flag::Stuck, true).has(Flag::Stuck));
    /// ```
    #[must_use]
    pub const fn has(self, flag: Flag) -> bool {
        self.0 >> flag as u16 & 1 == 1
    }

    /// Returns the names of the raised flags, in order.
    ///
    /// ```
    /// use ohmstrain_ekf::live::{Flag, Flags};
    ///
    /// assert!(Flags::NONE.with(Flag::Stuck, true).names().eq(["stuck"]));
    /// ```
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Flag::ALL.into_iter().filter(move |flag| self.has(*flag)).map(Flag::name)
    }
}

/// Names joined by `|`, as in `estimates.csv`.
impl fmt::Display for Flags {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        for (k, name) in self.names().enumerate() {
            out.write_str(if k == 0 { "" } else { "|" })?;
            out.write_str(name)?;
        }
        Ok(())
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Flags {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Flags {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Names;
        impl serde::de::Visitor<'_> for Names {
            type Value = Flags;

            fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
                out.write_str("names of flags with | between them")
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Flags, E> {
                text.split('|').filter(|name| !name.is_empty()).try_fold(Flags::NONE, |flags, name| {
                    let flag = Flag::ALL.into_iter().find(|flag| flag.name() == name);
                    let unknown = || E::invalid_value(serde::de::Unexpected::Str(name), &self);
                    Ok(flags.with(flag.ok_or_else(unknown)?, true))
                })
            }
        }
        deserializer.deserialize_str(Names)
    }
}
