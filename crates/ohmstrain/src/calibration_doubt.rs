use std::fmt;

use ohmstrain_calib::{LARGEST_SD_SCALE, Quantity, ReadingUnit, SensorParams};

use crate::number::{plain, significant};
use crate::{Calibrated, Recording};

/// Strains beyond this are taken for percent until somebody says that they are none: four times its own length.
const LARGEST_STRAIN: f64 = 3.0;
/// Above a strain of one, readings that change by less than this per strain are taken for it, too.
const LEAST_GAUGE: f64 = 0.05;
/// Median readings below this, Ω, are taken for kΩ until somebody says that they are none.
pub(crate) const LEAST_OHM: f64 = 20.0;
/// A resistance never falls below this share of its largest value; a strain does at rest.
const LEAST_OF_LARGEST: f64 = 0.2;
/// Joints turn by less than this, degrees.
const FULL_TURN_DEG: f64 = 360.0;
/// Ratios between recordings that no sensor explains, so that it must be the unit.
const UNIT_RATIO: f64 = 20.0;
/// Ratios between recordings of one sensor that are worth a word: R₀ drifts by a tenth or two from day to day, and the
/// readings' change per strain depends on how it is led.
const REST_RATIO: f64 = 1.3;
const GAUGE_RATIO: f64 = 3.0;

/// A doubt about the recordings of a calibration, or about its result; see [`calibration_doubts`] and [`Calibrated::doubts`].
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

/// What the recordings of one calibration say about their units, and about being of one sensor: what is to be answered first,
/// then what is to be known. Units that [are known](Recording::strain_unit_is_known) are not asked about.
///
/// ```
/// use ohmstrain::{CalibrationDoubt, Recording, calibration_doubts};
///
/// let time_s = [0.0, 0.1, 0.2];
/// let percent = Recording::new(&time_s, &[1600.0, 1650.0, 1700.0], &[0.0, 5.0, 10.0])?;
/// let [doubt] = calibration_doubts(&[percent])[..] else { panic!() };
/// assert!(matches!(doubt, CalibrationDoubt::Percent { recording: 0, .. }));
/// assert!(calibration_doubts(&[percent.strain_unit_is_known()]).is_empty());
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[must_use]
pub fn calibration_doubts(recordings: &[Recording]) -> Vec<CalibrationDoubt> {
    let known: Vec<(usize, Figures)> = recordings
        .iter()
        .enumerate()
        .filter_map(|(place, recording)| Some((place, Figures::new(recording)?)))
        .collect();
    let single = known.iter().filter_map(|(place, figures)| figures.doubt(&recordings[*place], *place));
    let mut doubts: Vec<_> = single.chain(apart(&known)).chain(copies(recordings)).collect();
    // What stops a calibration comes first.
    doubts.sort_by_key(|doubt| !doubt.is_refusal());
    doubts
}

/// Two recordings that differ most in something, and by how much, if that is more than a factor.
fn farthest(values: &[(usize, f64)], factor: f64) -> Option<([usize; 2], [f64; 2])> {
    let least = values.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let most = values.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (most.1 > factor * least.1).then_some(([least.0, most.0], [least.1, most.1]))
}

fn apart(known: &[(usize, Figures)]) -> Vec<CalibrationDoubt> {
    let of = |value: fn(&Figures) -> f64| known.iter().map(|(place, of)| (*place, value(of))).collect::<Vec<_>>();
    let medians = farthest(&of(|figures| figures.median), UNIT_RATIO)
        .map(|(recordings, medians)| CalibrationDoubt::ReadingsApart { recordings, medians });
    let gauges = of(|figures| figures.gauge);
    let references = farthest(&gauges, UNIT_RATIO)
        .map(|(recordings, gauges)| CalibrationDoubt::ReferencesApart { recordings, gauges });
    let unlike =
        farthest(&gauges, GAUGE_RATIO).map(|(recordings, gauges)| CalibrationDoubt::GaugesApart { recordings, gauges });
    medians.into_iter().chain(references.or(unlike)).collect()
}

fn copies(recordings: &[Recording]) -> Vec<CalibrationDoubt> {
    fn alike(a: &[f64], b: &[f64]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
    }
    let is_copy = |a: &Recording, b: &Recording| {
        let (a, b) = (&a.samples, &b.samples);
        alike(a.time_s(), b.time_s()) && alike(a.reading(), b.reading()) && alike(a.strain(), b.strain())
    };
    let copy = |(place, recording): (usize, &Recording)| {
        let first = recordings[..place].iter().position(|first| is_copy(first, recording))?;
        Some(CalibrationDoubt::Copy { recordings: [place, first] })
    };
    recordings.iter().enumerate().filter_map(copy).collect()
}

/// A recording in figures.
struct Figures {
    /// Least and largest reading.
    readings: (f64, f64),
    /// Median reading.
    median: f64,
    /// Least and largest value of the reference.
    references: (f64, f64),
    /// Range of the readings over their median, per range of the reference.
    gauge: f64,
}

impl Figures {
    /// `None` if nothing is known or moves.
    fn new(recording: &Recording) -> Option<Self> {
        let sorted = |values: &[f64]| {
            let mut known: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            known.sort_by(f64::total_cmp);
            known
        };
        let (reading, reference) = (sorted(recording.samples.reading()), sorted(recording.samples.strain()));
        let ends = |of: &[f64]| Some((*of.first()?, *of.last()?));
        let (readings, references) = (ends(&reading)?, ends(&reference)?);
        let median = *reading.get(reading.len() / 2)?;
        let span = references.1 - references.0;
        let gauge = (readings.1 - readings.0) / median / span;
        (span > 0.0).then_some(Self { readings, median, references, gauge })
    }

    fn doubt(&self, of: &Recording, recording: usize) -> Option<CalibrationDoubt> {
        if self.is_exchanged(of.quantity) {
            let readings = crate::column::reading_column(of.reading);
            return Some(CalibrationDoubt::Exchanged { recording, readings, reference: of.quantity.name() });
        }
        let largest = self.references.0.abs().max(self.references.1.abs());
        let is_percent = largest > LARGEST_STRAIN || (largest > 1.0 && self.gauge < LEAST_GAUGE);
        if of.quantity == Quantity::Strain && !of.knows_strain_unit && is_percent {
            return Some(CalibrationDoubt::Percent { recording, largest, gauge: self.gauge });
        }
        let is_kiloohm = of.reading == ReadingUnit::Ohm && self.median < LEAST_OHM;
        (!of.knows_resistance_unit && is_kiloohm)
            .then_some(CalibrationDoubt::KiloOhm { recording, median: self.median })
    }

    /// Strains where readings are expected, and readings where strains are.
    fn is_exchanged(&self, quantity: Quantity) -> bool {
        let (readings, references) = (self.readings, self.references);
        let least = if quantity == Quantity::AngleDeg { FULL_TURN_DEG.max(readings.1) } else { readings.1 };
        references.0 > least
            && references.0 > LEAST_OF_LARGEST * references.1
            && readings.0 < LEAST_OF_LARGEST * readings.1
    }
}

impl Calibrated {
    /// What is to be known of the result: R₀ that differ between recordings, and intervals that the law is too wrong for.
    ///
    /// ```
    /// fn warn(calibrated: &ohmstrain::Calibrated) {
    ///     calibrated.doubts().iter().for_each(|doubt| eprintln!("{doubt}"));
    /// }
    /// ```
    #[must_use]
    pub fn doubts(&self) -> Vec<CalibrationDoubt> {
        let rests: Vec<(usize, f64)> = self.rest_readings.iter().copied().enumerate().collect();
        let rests =
            farthest(&rests, REST_RATIO).map(|(recordings, rests)| CalibrationDoubt::RestsApart { recordings, rests });
        let params: &SensorParams = self.sensor.params();
        rests.into_iter().chain(params.widened_most().into_iter().map(|of| CalibrationDoubt::Widened { of })).collect()
    }
}
