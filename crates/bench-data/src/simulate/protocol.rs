use std::fmt;
use std::str::FromStr;

/// Rest before the first movement, s: enough to see the resistance at rest.
pub(super) const LEAD_IN_S: f64 = 2.0;

/// Movements of the bench.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Protocol {
    /// Repeated stretch and release.
    ExtendRetract {
        /// Number of cycles, at least one.
        cycles: u32,
        /// Rest after the last one, s.
        rest_s: f64,
    },
    /// Stretch, hold, release, rest.
    ExtendHold {
        /// Number of repetitions, at least one.
        cycles: u32,
        /// Time at full stretch, s.
        hold_s: f64,
        /// Time at rest after each release, s.
        rest_s: f64,
    },
    /// Load in steps up to 75 g; the elongation follows from the load.
    LoadSteps {
        /// Load added per step, g.
        step_g: f64,
        /// Time at each load, s.
        hold_s: f64,
    },
    /// Stretch, long hold, release, rest: first to full stretch, then to random strains at random speeds.
    LongHolds {
        /// Number of repetitions, at least one.
        cycles: u32,
        /// Time at each stretch, s.
        hold_s: f64,
        /// Longest time at rest after a release, s; the shortest is a fifth of it.
        rest_s: f64,
    },
    /// Triangles at several speeds, holds at several strains and a random walk, in turn: the contents of a good
    /// calibration.
    Mixed {
        /// Duration, s.
        duration_s: f64,
    },
}

impl Protocol {
    /// Six cycles and half a minute of rest.
    pub const EXTEND_RETRACT: Self = Self::ExtendRetract { cycles: 6, rest_s: 30.0 };
    /// Two holds of 90 s with a minute of rest after each.
    pub const EXTEND_HOLD: Self = Self::ExtendHold { cycles: 2, hold_s: 90.0, rest_s: 60.0 };
    /// 5 g every 15 s.
    pub const LOAD_STEPS: Self = Self::LoadSteps { step_g: 5.0, hold_s: 15.0 };
    /// Six holds of 300 s with up to 300 s of rest after each.
    pub const LONG_HOLDS: Self = Self::LongHolds { cycles: 6, hold_s: 300.0, rest_s: 300.0 };
    /// 400 s.
    pub const MIXED: Self = Self::Mixed { duration_s: 400.0 };

    /// The heaviest load of the load steps, g.
    pub const HEAVIEST_LOAD_G: f64 = 75.0;

    /// Returns its name in files and flags.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::ExtendRetract { .. } => "extend-retract",
            Self::ExtendHold { .. } => "extend-hold",
            Self::LoadSteps { .. } => "load-steps",
            Self::LongHolds { .. } => "long-holds",
            Self::Mixed { .. } => "mixed",
        }
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

/// Error for a name that is not a protocol's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no protocol `{0}`: expected extend-retract, extend-hold, load-steps, long-holds or mixed")]
pub struct UnknownProtocol(String);

/// Returns the protocol of that name with its usual counts and times.
impl FromStr for Protocol {
    type Err = UnknownProtocol;

    fn from_str(name: &str) -> Result<Self, UnknownProtocol> {
        [Self::EXTEND_RETRACT, Self::EXTEND_HOLD, Self::LOAD_STEPS, Self::LONG_HOLDS, Self::MIXED]
            .into_iter()
            .find(|protocol| protocol.name() == name)
            .ok_or_else(|| UnknownProtocol(name.to_owned()))
    }
}
