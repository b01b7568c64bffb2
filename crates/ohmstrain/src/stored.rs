//! A running filter as plain data.

use std::sync::Arc;

use ohmstrain_ekf::live::Protections;
use ohmstrain_ekf::{Gaussian, Influence};
use ohmstrain_sensor::{EstimatorKind, KnownStrain, Output, SensorParams};
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{Error, MADE_BY, QuietSeen, Reading, ValiditySeen};

/// Version of the state file's format.
const FORMAT: u32 = 4;

/// A running filter between two rows: the content of a state file. [`Filter::store`](crate::Filter::store) makes it.
///
/// It contains its sensor, options and version, and resumes only with the same ones.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    format: u32,
    made_by: String,
    /// Fingerprint of the sensor's parameters.
    sensor: String,
    options: StoredOptions,
    lag_s: Option<f64>,
    /// Reading of the rested sensor as the user gave it, for the program around the filter.
    pub rest_resistance: Option<f64>,
    /// Clock of the stream that was read, for the program around the filter.
    pub clock: Option<StoredClock>,
    /// Time of 0 s, ns since 1970, in a table with dates and times.
    pub zero_ns: Option<i64>,
    /// Last temperature of the stream, °C, for the program around the filter.
    #[serde(default)]
    pub temperature_c: Option<f64>,
    /// State of the watch for use outside the calibrated range.
    pub validity: Option<ValiditySeen>,
    /// State of the watch for long holds.
    pub quiet: Option<QuietSeen>,
    /// Time of the last row of a filter with a lag, s.
    pub(crate) last_s: Option<f64>,
    pub(crate) last: Option<Last>,
    #[serde(default)]
    pub(crate) waiting: Vec<WaitingRow>,
    pub(crate) kernel: StoredKernel,
}

/// Last time of a stream: in seconds, or a counter of microseconds, both raw and without wraps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum StoredClock {
    /// Seconds.
    TimeS(f64),
    /// Microseconds.
    TimeUs {
        /// Raw counter.
        counter: u64,
        /// Counter without wraps.
        unwrapped: u64,
    },
}

/// Reason why a stored filter cannot resume here.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoredError {
    /// The text is not a state.
    #[error("expected the state of a filter, as `filter --save-state` or Python's `save` writes it: {}", .0.message())]
    Text(Box<toml::de::Error>),
    /// State of another format or version of the program.
    #[error(
        "expected the state of a filter of {expected}, found one of {found}; begin anew, or go on with that version"
    )]
    Version {
        /// Format or version of this program.
        expected: String,
        /// Format or version that was found.
        found: String,
    },
    /// State of another sensor.
    #[error(
        "the state belongs to another sensor or joint, or to readings with or without temperatures: give the sensor.toml, joint \
         and columns with which it was saved, or begin anew"
    )]
    Sensor,
    /// State of a filter with other options.
    #[error(
        "the state belongs to a filter with {name} {found}, this one has {expected}; give the same options, or begin anew"
    )]
    Options {
        /// Name of the option.
        name: &'static str,
        /// Value of this filter.
        expected: String,
        /// Value in the state.
        found: String,
    },
    /// An initial strain for a filter that has begun.
    #[error("initial strain: the first row is over in a state that is resumed; say `known` strains instead")]
    Begun,
    /// Rows that are due have not been returned.
    #[error("rows that have become due are still to be handed out: take another row first")]
    RowsDue,
    /// The numbers do not belong to such a filter.
    #[error("the state is damaged: {}", .0.message())]
    Content(Box<toml::de::Error>),
}

/// Sensor and options of a filter.
#[derive(Clone, Debug)]
pub(crate) struct MadeOf {
    pub params: Arc<SensorParams>,
    pub options: StoredOptions,
}

/// Options of a filter, in the form of command-line flags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredOptions {
    estimator: String,
    gate: Option<f64>,
    influence: String,
    without: Vec<String>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Last {
    pub time_s: f64,
    pub reading: Reading,
    pub output: Output,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WaitingRow {
    pub time_s: f64,
    pub reading: Reading,
}

/// A strain known at a later time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Ahead {
    time_s: f64,
    strain: Gaussian<f64>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredKernel {
    pub rest_reading: f64,
    #[serde(default)]
    pub known: Vec<Ahead>,
    #[serde(default)]
    pub strains: Vec<KnownStrain>,
    pub filter: toml::Table,
}

impl From<(f64, Gaussian<f64>)> for Ahead {
    fn from((time_s, strain): (f64, Gaussian<f64>)) -> Self {
        Self { time_s, strain }
    }
}

impl Ahead {
    pub(crate) const fn strain(self) -> (f64, Gaussian<f64>) {
        (self.time_s, self.strain)
    }
}

impl StoredOptions {
    pub(crate) fn new(
        kind: EstimatorKind,
        gate: Option<f64>,
        influence: Influence<f64>,
        protections: Protections,
    ) -> Self {
        let Protections { plausibility, second_look, doubts, .. } = protections;
        let off = [(plausibility, "plausibility"), (second_look, "second-look"), (doubts, "doubts")];
        Self {
            estimator: kind.name().to_owned(),
            gate,
            influence: match influence {
                Influence::Full => "none".to_owned(),
                Influence::Huber { threshold } => format!("huber:{threshold}"),
                Influence::Redescending { threshold } => format!("redescending:{threshold}"),
                Influence::StudentT { degrees_of_freedom } => format!("student-t:{degrees_of_freedom}"),
            },
            without: off.into_iter().filter(|(is_on, _)| !is_on).map(|(_, name)| name.to_owned()).collect(),
        }
    }

    /// Refuses the first option that differs.
    fn compare(&self, found: &Self) -> Result<(), StoredError> {
        let number = |gate: Option<f64>| gate.map_or_else(|| "none".to_owned(), |gate| gate.to_string());
        let list = |names: &[String]| if names.is_empty() { "nothing".to_owned() } else { names.join(",") };
        let all = [
            ("estimator", self.estimator.clone(), found.estimator.clone()),
            ("gate", number(self.gate), number(found.gate)),
            ("influence", self.influence.clone(), found.influence.clone()),
            ("without", list(&self.without), list(&found.without)),
        ];
        let differs = all.into_iter().find(|(_, expected, found)| expected != found);
        differs.map_or(Ok(()), |(name, expected, found)| Err(StoredError::Options { name, expected, found }))
    }
}

impl Stored {
    pub(crate) fn new(
        made_of: &MadeOf,
        lag_s: Option<f64>,
        last: Option<Last>,
        waiting: Vec<WaitingRow>,
        kernel: StoredKernel,
    ) -> Self {
        Self {
            format: FORMAT,
            made_by: MADE_BY.to_owned(),
            sensor: fingerprint(&made_of.params),
            options: made_of.options.clone(),
            lag_s,
            rest_resistance: None,
            clock: None,
            zero_ns: None,
            validity: None,
            temperature_c: None,
            quiet: None,
            last_s: None,
            last,
            waiting,
            kernel,
        }
    }

    /// Reads the text of a state file.
    ///
    /// # Errors
    /// If it is not one, or is of another version.
    ///
    /// ```
    /// let error = ohmstrain::Stored::from_toml("format = 0\nmade_by = 'ohmstrain 0.0.1'\n[kernel]").unwrap_err();
    /// assert!(error.to_string().contains("found one of ohmstrain 0.0.1"));
    /// ```
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        #[derive(Deserialize)]
        struct Version {
            format: u32,
            made_by: String,
            /// Table that distinguishes it from other files with a format and a maker.
            #[serde(rename = "kernel")]
            _kernel: IgnoredAny,
        }
        let refused = |error| StoredError::Text(Box::new(error));
        let Version { format, made_by, .. } = toml::from_str(text).map_err(refused)?;
        if format != FORMAT || made_by != MADE_BY {
            // Between two versions, only the format may differ.
            let named = |maker: &str, of: u32| format!("{maker}, format {of}");
            return Err(
                StoredError::Version { expected: named(MADE_BY, FORMAT), found: named(&made_by, format) }.into()
            );
        }
        Ok(toml::from_str(text).map_err(refused)?)
    }

    /// Returns the text of its state file.
    ///
    /// # Errors
    /// If TOML cannot represent a number.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert!(sensor.filter().build()?.store()?.to_toml()?.starts_with("format = 4"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn to_toml(&self) -> Result<String, Error> {
        Ok(toml::to_string(self)?)
    }

    /// True if the filter has taken a row.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert!(!sensor.filter().build()?.store()?.is_begun());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn is_begun(&self) -> bool {
        self.last.is_some() || self.last_s.is_some()
    }

    /// Checks that a filter of these parts can resume from it.
    pub(crate) fn check(&self, made_of: &MadeOf, lag_s: Option<f64>) -> Result<(), StoredError> {
        if self.sensor != fingerprint(&made_of.params) {
            return Err(StoredError::Sensor);
        }
        made_of.options.compare(&self.options)?;
        let shown = |lag_s: Option<f64>| lag_s.map_or_else(|| "none".to_owned(), |lag_s| format!("{lag_s} s"));
        if self.lag_s == lag_s {
            return Ok(());
        }
        Err(StoredError::Options { name: "lag", expected: shown(lag_s), found: shown(self.lag_s) })
    }
}

/// Returns the FNV-1a hash of the parameters' text: it detects exchanged sensors, not forged ones.
fn fingerprint(params: &SensorParams) -> String {
    let text = toml::to_string(params).unwrap_or_default();
    let step = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, step))
}
