use std::fmt;

#[cfg(feature = "calibrate")]
use ohmstrain_calib::{CalibrationError, SamplesError};
use ohmstrain_ekf::StepError;
use ohmstrain_ekf::live::FARTHEST_REST;
use ohmstrain_model::ParameterError;
use ohmstrain_sensor::{FieldError, Quantity, SensorError};
use thiserror::Error;

use crate::number::{plain, significant};
use crate::{ReferenceDoubt, StoredError, UnitDoubt};

/// Reason why there is no sensor, no filter or no estimate.
///
/// ```
/// let error = ohmstrain::Sensor::from_toml("format = 3").unwrap_err();
/// assert_eq!(error.to_string(), "line 1: field `format`: expected version 9, found 3");
/// ```
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The text is not a valid sensor.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The sensor has no parameters for the estimator, or no filter can be built from them.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The calibration failed.
    #[cfg(feature = "calibrate")]
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The sensor cannot be written as TOML.
    #[error("cannot write parameters: {0}")]
    Write(#[from] toml::ser::Error),
    /// An invalid gate or influence.
    #[error(transparent)]
    Guard(ParameterError),
    /// An invalid joint.
    #[error("the sensor's joint: {0}")]
    Joint(#[source] ParameterError),
    /// An initial or known strain that the sensor never reports.
    #[error("{name}: expected {} to {}, the limits of the sensor's {}, found {found}", plain(*lower), plain(*upper), quantity.name())]
    KnownStrain {
        /// Name of the number.
        name: &'static str,
        /// Estimated quantity.
        quantity: Quantity,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
        /// Value that was given.
        found: f64,
    },
    /// A resistance at rest, or a lag, that is not a positive number.
    #[error("{name}: expected a positive number, found {found}")]
    NotPositive {
        /// Name of the number.
        name: &'static str,
        /// Value that was given.
        found: f64,
    },
    /// A resistance at rest that cannot be the sensor's: in another unit, or of another sensor.
    #[error(
        "resistance at rest: expected {} to {}, as the rested sensor read {} in calibration, found {}; give it in the unit of the \
         calibration's readings, and for a sensor of another size calibrate again",
        significant(*rested / FARTHEST_REST, 5),
        significant(*rested * FARTHEST_REST, 5),
        significant(*rested, 5),
        significant(*found, 5)
    )]
    FarRest {
        /// Reading of the rested sensor in calibration.
        rested: f64,
        /// Value that was given.
        found: f64,
    },
    /// Recordings of different quantities (strain and angle) or units (ohms and ratios), or of others than the calibration's.
    #[error("expected recordings of one quantity and one unit, those of the calibration")]
    OtherQuantity,
    /// A prior for another quantity (strain or angle) than that of the recordings.
    #[error("the prior is of {}, the recordings are of {}", of_make.name(), found.name())]
    OtherMake {
        /// Quantity of the prior's sensors.
        of_make: Quantity,
        /// Quantity of the recordings' reference.
        found: Quantity,
    },
    /// A fusion that does not know the errors of smoothers.
    #[error("expected a fusion of smoothers; calibrate again, with an estimator that has a smoother")]
    NoFusedSmoother,
    /// A number of channels that differs from that of the fusion.
    #[error("expected {expected} channels, those of the fusion, found {found}")]
    OtherChannels {
        /// Number of channels of the fusion.
        expected: usize,
        /// Number of sensors, filters or readings.
        found: usize,
    },
    /// Slices of different lengths.
    #[error("{times} times and {readings} readings; expected as many of each")]
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of readings.
        readings: usize,
    },
    /// Temperatures that do not belong to the rows.
    #[cfg(feature = "calibrate")]
    #[error("{rows} rows and {temperatures} temperatures; expected as many of each")]
    Temperatures {
        /// Number of rows.
        rows: usize,
        /// Number of temperatures.
        temperatures: usize,
    },
    /// Coefficients of temperature for recordings without temperatures.
    #[cfg(feature = "calibrate")]
    #[error("coefficients of temperature: expected recordings that all have temperatures, a column `temperature_c`")]
    NoTemperatures,
    /// Slices that do not form a valid recording.
    #[cfg(feature = "calibrate")]
    #[error(transparent)]
    Samples(#[from] SamplesError),
    /// Readings that seem to be in another unit than the calibration's.
    #[error(transparent)]
    Unit(#[from] UnitDoubt),
    /// A reference that seems to be in percent.
    #[error(transparent)]
    Reference(#[from] ReferenceDoubt),
    /// A stored filter that cannot resume here.
    #[error(transparent)]
    Stored(#[from] StoredError),
    /// The filter refused a row. It stays as it was: the next good row continues from the last good one.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The filter refused a row of a recording.
    #[error("row {row}: {source}")]
    Row {
        /// Index of the row, from zero.
        row: usize,
        /// Error of the step.
        source: StepError,
    },
}

impl Error {
    /// Returns the error with the name of the file that the text was read from: `file:line: column c: message`.
    ///
    /// ```
    /// let error = ohmstrain::Sensor::from_toml("format = 3").unwrap_err();
    /// assert_eq!(error.in_file("s.toml"), "s.toml:1: field `format`: expected version 9, found 3");
    /// ```
    #[must_use]
    pub fn in_file(&self, name: &str) -> String {
        match self {
            Self::Text(TextError { place: Some(Place { line, column }), cause }) => match column {
                Some(column) => format!("{name}:{line}: column {column}: {cause}"),
                None => format!("{name}:{line}: {cause}"),
            },
            other => format!("{name}: {other}"),
        }
    }
}

/// Error in the text of a sensor, with its place.
///
/// ```
/// use ohmstrain::{Error, Sensor, TextCause};
///
/// let Err(Error::Text(error)) = Sensor::from_toml("format = 4") else { panic!() };
/// assert!(matches!(error.cause, TextCause::Format { expected: 9, found: 4 }));
/// assert_eq!(error.place.unwrap().line, 1);
/// ```
#[derive(Debug)]
pub struct TextError {
    /// Place in the text; `None` if something is missing as a whole.
    pub place: Option<Place>,
    /// Cause of the error.
    pub cause: TextCause,
}

impl fmt::Display for TextError {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        match self.place {
            Some(place) => write!(out, "{place}: {}", self.cause),
            None => self.cause.fmt(out),
        }
    }
}

impl std::error::Error for TextError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

/// Cause of an error in the text of a sensor; see [`TextError`].
///
/// ```
/// use std::error::Error;
///
/// let error = ohmstrain::Sensor::from_toml("format = 9\nrange").unwrap_err();
/// let text = error.source().and_then(|text| text.source()).unwrap_or(&error);
/// assert!(!text.to_string().is_empty());
/// ```
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TextCause {
    /// Invalid TOML, or a field that is unknown, missing or of the wrong type.
    #[error("{}", .0.message().replace('\n', ", "))]
    Toml(#[source] toml::de::Error),
    /// Text in another version of the format.
    #[error("field `format`: expected version {expected}, found {found}")]
    Format {
        /// The version that is read.
        expected: u32,
        /// Version of the text.
        found: u32,
    },
    /// A number out of its range.
    #[error(transparent)]
    Field(FieldError),
}

/// A place in a text, both counted from one.
///
/// ```
/// assert_eq!(ohmstrain::Place { line: 3, column: Some(7) }.to_string(), "line 3, column 7");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column, in characters, where it is known.
    pub column: Option<usize>,
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        write!(out, "line {}", self.line)?;
        self.column.map_or(Ok(()), |column| write!(out, ", column {column}"))
    }
}
