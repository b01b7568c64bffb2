/// A doubt about the recordings of a calibration, or about its result; see [`calibration_doubts`](crate::calibration_doubts) and
/// [`Calibrated::doubts`](crate::Calibrated::doubts).
///
/// Its text names no recording; `recordings()` returns their indices.
///
/// ```
/// let doubt = ohmstrain::CalibrationDoubt::Copy { recordings: [1, 0] };
/// assert!(!doubt.is_refusal());
/// assert_eq!(doubt.to_string(), "the same rows: they count twice");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum CalibrationDoubt {
    /// Readings and reference are in each other's column.
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
    /// Recordings that are probably not of one sensor.
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
    /// Recordings whose resistances at rest are too different for one sensor.
    RestsApart {
        /// The recordings, the one with the smaller R₀ first.
        recordings: [usize; 2],
        /// Their R₀.
        rests: [f64; 2],
    },
    /// A reference that stays constant while the readings go up and down.
    Frozen {
        /// The recording.
        recording: usize,
        /// Start, s.
        from_s: f64,
        /// End, s.
        to_s: f64,
        /// Value of the reference during that time.
        reference: f64,
        /// Range of the readings, up and down, during that time.
        swing: f64,
    },
    /// Negative strains, although the sensor only stretches.
    Turned {
        /// The recording.
        recording: usize,
        /// 1st percentile of the reference.
        lower: f64,
        /// 99th percentile of the reference.
        upper: f64,
    },
    /// Readings that rise with the reference in one recording, and fall with it in another.
    TurnedApart {
        /// The recordings, the one with falling readings first.
        recordings: [usize; 2],
    },
    /// A clock in milliseconds.
    Milliseconds {
        /// The recording.
        recording: usize,
        /// Median step of the clock.
        step: f64,
        /// Duration of a stroke by this clock, s.
        stroke_s: f64,
    },
    /// A temperature whose effect cannot be told from relaxation, drift or strain.
    Temperature {
        /// Range of the temperatures, K.
        range_k: f64,
        /// Fitted relative change of R₀ per kelvin, with its standard deviation.
        rest_per_k: (f64, f64),
    },
    /// Intervals that were widened because the law is too wrong.
    Widened {
        /// Name of the quantity of the intervals.
        of: &'static str,
    },
}

impl CalibrationDoubt {
    /// True if it must be answered before calibration; if false, it is a warning.
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
            Self::GaugesApart { .. }
            | Self::Copy { .. }
            | Self::RestsApart { .. }
            | Self::Temperature { .. }
            | Self::Widened { .. } => false,
        }
    }

    /// Returns the indices of the recordings concerned; empty if the doubt concerns the result.
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
            Self::Temperature { .. } | Self::Widened { .. } => vec![],
        }
    }
}
