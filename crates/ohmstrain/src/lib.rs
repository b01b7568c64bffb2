//! Estimation of strain, with an honest error bar, from the resistance of a soft, stretchable strain sensor.
//!
//! A [`Sensor`] holds the result of a calibration: it is read from a `sensor.toml`, or made by [`calibrate`] from recordings
//! with known strain. It builds a [`Filter`] for live readings, and smooths whole recordings; both return rows of plain
//! numbers, [`Estimate`].
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let sensor = ohmstrain::Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml")?)?;
//! let mut filter = sensor.filter().gate(10.8).build()?;
//! for (time_s, ohm) in [(0.00, 1600.0), (0.05, 1632.0), (0.10, 1680.0)] {
//!     let e = filter.step(time_s, ohm)?;
//!     println!("{:.3} ± {:.3}", e.strain, e.strain_sd);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # Policy
//! - The library works on slices and rows, not files. Readings are in the unit of the calibration, Ω or a ratio; strains are fractions.
//! - All input is checked: version, fields and the range of every number of a sensor, the unit of a recording.
//! - An error leaves a filter as it was. A missing reading is NaN or `None`.
//! - Results are deterministic: every random number has a fixed seed, and no clock is read.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod builder;
#[cfg(feature = "calibrate")]
mod calibrate;
#[cfg(feature = "calibrate")]
mod calibration_doubt;
mod column;
mod error;
mod estimate;
#[cfg(feature = "calibrate")]
mod explain;
mod filter;
mod fused;
mod influence;
mod known;
mod known_doubt;
#[cfg(feature = "calibrate")]
mod lag_doubt;
#[cfg(feature = "calibrate")]
mod marks;
#[cfg(feature = "calibrate")]
mod motion_doubt;
mod pauses;
#[cfg(feature = "calibrate")]
mod plausible;
#[cfg(feature = "calibrate")]
mod prior;
mod quiet;
mod reading;
#[cfg(feature = "calibrate")]
mod recording;
mod reference_doubt;
mod sensor;
mod sentences;
mod smoothing;
mod stored;
mod temperature;
#[cfg(feature = "calibrate")]
mod tested;
mod text;
#[cfg(feature = "trace")]
pub mod trace;
mod unit_doubt;
mod use_doubt;
mod validity;

pub use builder::FilterBuilder;
#[cfg(feature = "calibrate")]
pub use calibrate::{Calibrated, Calibration, calibrate};
#[cfg(feature = "calibrate")]
pub use calibration_doubt::CalibrationDoubt;
pub use column::Column;
pub use error::{Error, Place, TextCause, TextError};
pub use estimate::Estimate;
#[cfg(feature = "calibrate")]
pub use explain::explain;
pub use filter::{Filter, LaggedFilter};
#[cfg(feature = "calibrate")]
pub use fused::{Fused, fuse};
pub use fused::{FusedEstimate, FusedFilter, FusedSensor};
pub use influence::influence;
pub use known::Known;
pub use known_doubt::{StartDoubt, UnusedKnown, unused_known};
#[cfg(feature = "calibrate")]
pub use lag_doubt::LagDoubt;
#[cfg(feature = "calibrate")]
pub use marks::marked_references;
#[cfg(feature = "calibrate")]
pub use motion_doubt::motion_doubts;
#[cfg(feature = "calibrate")]
pub use plausible::calibration_doubts;
#[cfg(feature = "calibrate")]
pub use prior::Prior;
pub use quiet::{Quiet, QuietSeen, QuietWatch};
pub use reading::Reading;
#[cfg(feature = "calibrate")]
pub use recording::{Evaluation, Recording};
pub use reference_doubt::ReferenceDoubt;
pub use sensor::Sensor;
#[cfg(feature = "calibrate")]
pub use sentences::LagAnswer;
pub use sentences::{Closing, Interface, Tested, number, verdict};
pub use stored::{Stored, StoredClock, StoredError};
pub use temperature::Thermometer;
#[cfg(feature = "calibrate")]
pub use tested::Kept;
pub use unit_doubt::{UnitDoubt, UnitGuess};
pub use use_doubt::UseDoubt;
pub use validity::{Beyond, Extrapolation, ValiditySeen, ValidityWatch};

#[cfg(feature = "calibrate")]
#[doc(no_inline)]
pub use ohmstrain_calib::{
    CalibrationError, Confounded, Distrusted, Doubt, GaugeFamily, Identifiability, Lag, LagError, LeftOutRow, Mark,
    MarkedReference, MarksError, SamplesError, ScoredRow, Stage, TemperatureCoefficients, score,
};
pub use ohmstrain_ekf::live::{FARTHEST_REST, Flag, Flags, KNOWN_BEYOND};
#[doc(no_inline)]
pub use ohmstrain_ekf::{Influence, StepError};
#[doc(no_inline)]
pub use ohmstrain_model::ParameterError;
#[doc(no_inline)]
pub use ohmstrain_sensor::fusion::{FusionParams, FusionRow, RegressionParams};
#[doc(no_inline)]
pub use ohmstrain_sensor::{
    EstimatorKind, FieldError, Findings, JointParams, Quantity, ReadingUnit, Scores, SensorError, SensorParams,
    TemperatureParams,
};

/// Name and version of the program, as written into files.
///
/// ```
/// assert!(ohmstrain::MADE_BY.starts_with("ohmstrain "));
/// ```
pub const MADE_BY: &str = concat!("ohmstrain ", env!("CARGO_PKG_VERSION"));
