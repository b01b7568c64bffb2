use std::fmt;

use ohmstrain_sensor::LARGEST_SD_SCALE;

use crate::number::{plain, significant};

/// A doubt about the recordings of a calibration, or about its result; see [`calibration_doubts`](crate::calibration_doubts) and
/// [`Calibrated::doubts`](crate::Calibrated::doubts).
///
/// Its text names no recording: `recordings()` does, by place.
///
/// ```
/// let doubt = ohmstrain::CalibrationDoubt::Copy { recordings: [1, 0] };
/// assert!(!doubt.is_refusal());
/// assert_eq!(doubt.to_string(), "the same rows: they count twice");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CalibrationDoubt {
    /// Readings and reference stand in each other's column.
    Exchanged {
        /// The recording.
        recording: usize,
        /// Column of the readings.
        readings: &'static str,
        /// Column of the reference.
        reference: &'static str,
    },
    /// The reference is in percent.
    Percent {
        /// The recording.
        recording: usize,
        /// Largest magnitude of the reference.
        largest: f64,
        /// Range of the readings over their median, per strain.
        gauge: f64,
    },
    /// The readings are in kΩ.
    KiloOhm {
        /// The recording.
        recording: usize,
        /// Their median.
        median: f64,
    },
    /// Readings of two recordings in two units.
    ReadingsApart {
        /// The recordings, the one with the smaller readings first.
        recordings: [usize; 2],
        /// Their medians.
        medians: [f64; 2],
    },
    /// References of two recordings in two units.
    ReferencesApart {
        /// The recordings, the one with the larger reference first.
        recordings: [usize; 2],
        /// Range of the readings over their median, per unit of the reference.
        gauges: [f64; 2],
    },
    /// Recordings that are hardly of one sensor.
    GaugesApart {
        /// The recordings, as in [`Self::ReferencesApart`].
        recordings: [usize; 2],
        /// Range of the readings over their median, per unit of the reference.
        gauges: [f64; 2],
    },
    /// One recording given twice.
    Copy {
        /// The second and the first of them.
        recordings: [usize; 2],
    },
    /// Recordings at rest at resistances that one sensor hardly has.
    RestsApart {
        /// The recordings, the one with the smaller R₀ first.
        recordings: [usize; 2],
        /// Their R₀.
        rests: [f64; 2],
    },
    /// A reference that stands still while the readings go up and down.
    Frozen {
        /// The recording.
        recording: usize,
        /// When it begins, s.
        from_s: f64,
        /// When it ends, s.
        to_s: f64,
        /// What the reference says all that time.
        reference: f64,
        /// How far the readings go up and down meanwhile.
        swing: f64,
    },
    /// Strains that are negative, of a sensor that stretches.
    Turned {
        /// The recording.
        recording: usize,
        /// 1st percentile of the reference.
        lower: f64,
        /// 99th percentile of the reference.
        upper: f64,
    },
    /// Readings that follow the reference in one recording, and go against it in another.
    TurnedApart {
        /// The recordings, the one whose readings go against it first.
        recordings: [usize; 2],
    },
    /// A clock in milliseconds.
    Milliseconds {
        /// The recording.
        recording: usize,
        /// Median step of the clock.
        step: f64,
        /// How long a stroke takes by it, s.
        stroke_s: f64,
    },
    /// Intervals that the law is too wrong for.
    Widened {
        /// Whose they are.
        of: &'static str,
    },
}

impl CalibrationDoubt {
    /// Whether nothing is to be calibrated until it is answered; if not, it is a warning.
    ///
    /// ```
    /// assert!(ohmstrain::CalibrationDoubt::KiloOhm { recording: 0, median: 1.6 }.is_refusal());
    /// ```
    #[must_use]
    pub const fn is_refusal(&self) -> bool {
        match self {
            Self::Exchanged { .. }
            | Self::Percent { .. }
            | Self::KiloOhm { .. }
            | Self::ReadingsApart { .. }
            | Self::ReferencesApart { .. }
            | Self::Frozen { .. }
            | Self::Turned { .. }
            | Self::TurnedApart { .. }
            | Self::Milliseconds { .. } => true,
            Self::GaugesApart { .. } | Self::Copy { .. } | Self::RestsApart { .. } | Self::Widened { .. } => false,
        }
    }

    /// Places of the recordings that it is about; none if it is about the result.
    ///
    /// ```
    /// assert_eq!(ohmstrain::CalibrationDoubt::Copy { recordings: [1, 0] }.recordings(), [1, 0]);
    /// ```
    #[must_use]
    pub fn recordings(&self) -> Vec<usize> {
        match self {
            Self::Exchanged { recording, .. }
            | Self::Percent { recording, .. }
            | Self::KiloOhm { recording, .. }
            | Self::Frozen { recording, .. }
            | Self::Turned { recording, .. }
            | Self::Milliseconds { recording, .. } => vec![*recording],
            Self::ReadingsApart { recordings, .. }
            | Self::ReferencesApart { recordings, .. }
            | Self::GaugesApart { recordings, .. }
            | Self::TurnedApart { recordings }
            | Self::Copy { recordings }
            | Self::RestsApart { recordings, .. } => recordings.to_vec(),
            Self::Widened { .. } => vec![],
        }
    }
}

impl fmt::Display for CalibrationDoubt {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Exchanged { readings, reference, .. } => write!(
                out,
                "the columns `{readings}` and `{reference}` seem to be exchanged: expected readings that stay well above zero \
                 and a reference that does not, found the reverse"
            ),
            Self::Percent { largest, gauge, .. } => write!(
                out,
                "expected the reference as a fraction of the length, found strains of up to {}, over which the readings \
                 change by {gauge:.3} of their median per strain",
                plain(*largest)
            ),
            Self::KiloOhm { median, .. } => {
                write!(out, "column `resistance_ohm`: expected ohms, found readings of about {}", plain(*median))
            }
            Self::ReadingsApart { medians: [least, most], .. } => write!(
                out,
                "readings of about {} and {}, {:.0} times as much; expected one sensor in one unit; is one of them in kilo-ohms?",
                plain(*least),
                plain(*most),
                most / least
            ),
            Self::ReferencesApart { gauges: [least, most], .. } => write!(
                out,
                "the readings change by {least:.3} and {most:.3} of their median per unit of the reference, {:.0} times as \
                 much; expected one sensor and one unit; is the reference of the first in percent?",
                most / least
            ),
            Self::GaugesApart { gauges: [least, most], .. } => write!(
                out,
                "the readings change by {least:.3} and {most:.3} of their median per unit of the reference: one sensor?"
            ),
            Self::Frozen { from_s, to_s, reference, swing, .. } => write!(
                out,
                "expected a reference that moves with the readings, found {} from {} to {} s, while they go up and down by {}: is it \
                 frozen?",
                plain(*reference),
                plain(*from_s),
                plain(*to_s),
                significant(*swing, 2)
            ),
            Self::Turned { lower, upper, .. } => write!(
                out,
                "expected strains of a sensor that stretches, above zero, found {} to {}: has the reference the other sign?",
                significant(*lower, 2),
                significant(*upper, 2)
            ),
            Self::TurnedApart { .. } => out.write_str(
                "the readings of the first go against its reference, those of the second with it; expected one sensor: has one of \
                 the references the other sign?",
            ),
            Self::Milliseconds { step, stroke_s, .. } => write!(
                out,
                "column `time_s`: expected seconds, found whole numbers {} apart, by which a stroke takes {} s: are they milliseconds?",
                plain(*step),
                significant(*stroke_s, 2)
            ),
            Self::Copy { .. } => out.write_str("the same rows: they count twice"),
            Self::RestsApart { rests: [least, most], .. } => write!(
                out,
                "R0 comes out as {} and {}, {:.0} % more: one sensor?",
                significant(*least, 5),
                significant(*most, 5),
                100.0 * (most / least - 1.0)
            ),
            Self::Widened { of } => write!(
                out,
                "the {of}'s intervals are widened by {LARGEST_SD_SCALE}, the most there is: on parts of the recordings that \
                 it has not seen, the law is more wrong than they say; another recording, or other branches, may help"
            ),
        }
    }
}
