use std::path::{Path, PathBuf};
use std::str::FromStr;

use ohmstrain_bench_data::{FrontEndSpec, JointSpec};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

/// Version of the file format.
pub const HAND_FORMAT: u32 = 1;

/// `hand.toml`: the joints of a recording of several channels, and their sensors.
#[derive(Clone, Debug)]
pub struct HandDescription {
    /// The joints, in the order of the output.
    pub joints: Vec<HandJoint>,
}

/// A joint and its sensors.
#[derive(Clone, Debug)]
pub struct HandJoint {
    /// Name of its columns in the output.
    pub name: String,
    /// Columns of its readings in the recording, each with its sensor; at least one.
    pub channels: Vec<HandChannel>,
    /// File of the fusion, relative to the description's folder; `None` for a joint with one channel.
    pub fusion: Option<PathBuf>,
    /// The joint that the sensors span, unless their files contain it.
    pub joint: Option<JointSpec>,
}

/// A column of readings and its sensor.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct HandChannel {
    /// Name of the column.
    pub column: String,
    /// The sensor's file, relative to the description's folder.
    pub sensor: PathBuf,
    /// Today's reading of the rested sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest_resistance: Option<f64>,
    /// Electronics, if the column has converter codes.
    #[serde(default, deserialize_with = "spec", serialize_with = "as_text", skip_serializing_if = "Option::is_none")]
    pub front_end: Option<FrontEndSpec>,
}

/// Content of the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    /// Program that wrote it; a description written by hand has none.
    #[serde(rename = "made_by")]
    _made_by: Option<String>,
    joints: Vec<Entry>,
}

/// A joint in the file: one channel in its own table, or several in tables of their own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    column: Option<String>,
    sensor: Option<PathBuf>,
    rest_resistance: Option<f64>,
    #[serde(default, deserialize_with = "spec")]
    front_end: Option<FrontEndSpec>,
    #[serde(default)]
    channels: Vec<HandChannel>,
    fusion: Option<PathBuf>,
    #[serde(default, deserialize_with = "spec")]
    joint: Option<JointSpec>,
}

impl Entry {
    /// Returns the joint, or names the missing part.
    fn joint(self) -> Result<HandJoint, &'static str> {
        let Self { name, column, sensor, rest_resistance, front_end, channels, fusion, joint } = self;
        let channels = match (column, sensor) {
            (Some(column), Some(sensor)) if channels.is_empty() && fusion.is_none() => {
                vec![HandChannel { column, sensor, rest_resistance, front_end }]
            }
            (None, None) if channels.len() > 1 && rest_resistance.is_none() && front_end.is_none() => channels,
            _ => return Err("expected `column` and `sensor`, or two or more `[[joints.channels]]` that have them"),
        };
        if channels.len() > 1 && fusion.is_none() {
            return Err("expected `fusion`, the file that `ohmstrain calibrate` wrote for these channels");
        }
        Ok(HandJoint { name, channels, fusion, joint })
    }
}

fn as_text<S: Serializer>(spec: &Option<FrontEndSpec>, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(&spec.as_ref().map(ToString::to_string).unwrap_or_default())
}

fn spec<'de, D: Deserializer<'de>, T: FromStr<Err: std::fmt::Display>>(source: D) -> Result<Option<T>, D::Error> {
    let text = String::deserialize(source)?;
    text.parse().map(Some).map_err(serde::de::Error::custom)
}

/// Reason why a text is not the description of a hand.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum HandError {
    /// It is not TOML, or has an unknown field.
    #[error("{message}")]
    Toml {
        /// The line, counted from 1.
        line: usize,
        /// Description of the fault.
        message: String,
    },
    /// It has another format.
    #[error("expected `format = {HAND_FORMAT}`, found {found}")]
    Format {
        /// Its format.
        found: u32,
    },
    /// A joint has no name of its own, or one that cannot be in a column.
    #[error("expected {expected} for each joint, found `{found}`")]
    Name {
        /// Expected content.
        expected: &'static str,
        /// The name.
        found: String,
    },
    /// It has no joint.
    #[error("expected at least one `[[joints]]`, found none")]
    NoJoints,
    /// A joint lacks a part.
    #[error("joint `{joint}`: {expected}")]
    Joint {
        /// Its name.
        joint: String,
        /// Expected content.
        expected: &'static str,
    },
}

impl HandError {
    /// Returns the message with the name of the file, and the line if it is known.
    #[must_use]
    pub fn in_file(&self, name: &str) -> String {
        match self {
            Self::Toml { line, .. } => format!("{name}:{line}: {self}"),
            _ => format!("{name}: {self}"),
        }
    }
}

impl HandDescription {
    /// Parses the text of a `hand.toml`.
    ///
    /// # Errors
    /// If it is not one; names the joint and the missing part.
    pub fn from_toml(text: &str) -> Result<Self, HandError> {
        let wrong = |error: toml::de::Error| {
            let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            HandError::Toml { line, message: error.message().replace('\n', " ") }
        };
        let found: File = toml::from_str(text).map_err(wrong)?;
        if found.format != HAND_FORMAT {
            return Err(HandError::Format { found: found.format });
        }
        let plain =
            |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
        for (place, joint) in found.joints.iter().enumerate() {
            let is_double = found.joints[..place].iter().any(|other| other.name == joint.name);
            if is_double || !plain(&joint.name) {
                let expected =
                    if is_double { "a name of its own" } else { "a name of letters, digits, `_`, `-` and `.`" };
                return Err(HandError::Name { expected, found: joint.name.clone() });
            }
        }
        if found.joints.is_empty() {
            return Err(HandError::NoJoints);
        }
        let joint = |entry: Entry| {
            let joint = entry.name.clone();
            entry.joint().map_err(|expected| HandError::Joint { joint, expected })
        };
        Ok(Self { joints: found.joints.into_iter().map(joint).collect::<Result<_, _>>()? })
    }

    /// Returns the files of the hand: its own, the sensors and the fusions.
    #[must_use]
    pub fn files(&self, hand: &Path) -> Vec<PathBuf> {
        let folder = hand.parent().unwrap_or(Path::new(""));
        let sensors = self.joints.iter().flat_map(|joint| &joint.channels).map(|channel| &channel.sensor);
        let fusions = self.joints.iter().filter_map(|joint| joint.fusion.as_ref());
        let named = sensors.chain(fusions).map(|path| folder.join(path));
        std::iter::once(hand.to_path_buf()).chain(named).collect()
    }
}
