use std::path::{Path, PathBuf};
use std::str::FromStr;

use ohmstrain_bench_data::{FrontEndSpec, JointSpec};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::CliError;
use crate::sensor_file;
use crate::whole_file;

/// Version of the file format.
pub const FORMAT: u32 = 1;

/// `hand.toml`.
#[derive(Debug)]
pub struct Description {
    /// The joints, in the order of the output.
    pub joints: Vec<Joint>,
}

/// A joint and its sensors.
#[derive(Debug)]
pub struct Joint {
    /// Name of its columns in the output.
    pub name: String,
    /// Columns of its readings in the recording, each with its sensor; at least one.
    pub channels: Vec<Channel>,
    /// File of the fusion, relative to the description's folder; `None` for a joint with one channel.
    pub fusion: Option<PathBuf>,
    /// The joint that the sensors span, unless their files contain it.
    pub joint: Option<JointSpec>,
}

/// A column of readings and its sensor.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Channel {
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
    channels: Vec<Channel>,
    fusion: Option<PathBuf>,
    #[serde(default, deserialize_with = "spec")]
    joint: Option<JointSpec>,
}

impl Entry {
    /// Returns the joint, or names the missing part.
    fn joint(self) -> Result<Joint, &'static str> {
        let Self { name, column, sensor, rest_resistance, front_end, channels, fusion, joint } = self;
        let channels = match (column, sensor) {
            (Some(column), Some(sensor)) if channels.is_empty() && fusion.is_none() => {
                vec![Channel { column, sensor, rest_resistance, front_end }]
            }
            (None, None) if channels.len() > 1 && rest_resistance.is_none() && front_end.is_none() => channels,
            _ => return Err("expected `column` and `sensor`, or two or more `[[joints.channels]]` that have them"),
        };
        if channels.len() > 1 && fusion.is_none() {
            return Err("expected `fusion`, the file that `ohmstrain calibrate` wrote for these channels");
        }
        Ok(Joint { name, channels, fusion, joint })
    }
}

fn as_text<S: Serializer>(spec: &Option<FrontEndSpec>, out: S) -> Result<S::Ok, S::Error> {
    out.collect_str(&spec.as_ref().map(ToString::to_string).unwrap_or_default())
}

fn spec<'de, D: Deserializer<'de>, T: FromStr<Err: std::fmt::Display>>(source: D) -> Result<Option<T>, D::Error> {
    let text = String::deserialize(source)?;
    text.parse().map(Some).map_err(serde::de::Error::custom)
}

impl Description {
    /// Returns the files of the hand: its own, the sensors and the fusions.
    pub fn files(&self, hand: &Path) -> Vec<PathBuf> {
        let folder = hand.parent().unwrap_or(Path::new(""));
        let of_joint = |joint: &Joint| {
            joint.channels.iter().map(|channel| channel.sensor.clone()).chain(joint.fusion.clone()).collect::<Vec<_>>()
        };
        let named = self.joints.iter().flat_map(of_joint).map(|path| folder.join(path));
        std::iter::once(hand.to_path_buf()).chain(named).collect()
    }

    /// Reads the file.
    ///
    /// # Errors
    /// If it cannot be read, or has an unknown field.
    pub fn read(path: &Path) -> Result<Self, CliError> {
        let name = path.display();
        let text = whole_file::text(path)?;
        if sensor_file::is_recording(&text) {
            return Err(CliError::Input(format!(
                "{name} is a recording, not the description of a hand: give hand.toml first, and the recording after it"
            )));
        }
        if text.contains("\ndefault_estimator = ") {
            let what = "is a sensor file: hand.toml names it as the `sensor` of a joint";
            return Err(CliError::Input(format!("{name} {what}")));
        }
        let wrong = |error: toml::de::Error| {
            let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
            CliError::Input(format!("{name}:{line}: {}", error.message().replace('\n', " ")))
        };
        let found: File = toml::from_str(&text).map_err(wrong)?;
        if found.format != FORMAT {
            return Err(CliError::Input(format!("{name}: expected `format = {FORMAT}`, found {}", found.format)));
        }
        let plain =
            |name: &str| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
        for (place, joint) in found.joints.iter().enumerate() {
            let is_double = found.joints[..place].iter().any(|other| other.name == joint.name);
            if is_double || !plain(&joint.name) {
                let what = if is_double { "a name of its own" } else { "a name of letters, digits, `_`, `-` and `.`" };
                return Err(CliError::Input(format!("{name}: expected {what} for each joint, found `{}`", joint.name)));
            }
        }
        if found.joints.is_empty() {
            return Err(CliError::Input(format!("{name}: expected at least one `[[joints]]`, found none")));
        }
        let joint = |entry: Entry| {
            let joint = entry.name.clone();
            entry.joint().map_err(|what| CliError::Input(format!("{name}: joint `{joint}`: {what}")))
        };
        Ok(Self { joints: found.joints.into_iter().map(joint).collect::<Result<_, _>>()? })
    }
}
