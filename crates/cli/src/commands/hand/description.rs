use std::path::{Path, PathBuf};
use std::str::FromStr;

use ohmstrain_bench_data::{FrontEndSpec, JointSpec};
use serde::{Deserialize, Deserializer};

use crate::error::CliError;
use crate::sensor_file;
use crate::whole_file;

/// The version of the file that is read.
const FORMAT: u32 = 1;

/// `hand.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    format: u32,
    /// The joints, in the order of the output.
    pub joints: Vec<Joint>,
}

/// A joint and its sensor.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name of its columns in the output.
    pub name: String,
    /// Name of its readings' column in the recording.
    pub column: String,
    /// The sensor's file, from the description's folder.
    pub sensor: PathBuf,
    /// The joint that the sensor spans, unless the sensor knows.
    #[serde(default, deserialize_with = "spec")]
    pub joint: Option<JointSpec>,
    /// Reading of the rested sensor today.
    pub rest_resistance: Option<f64>,
    /// Electronics, if the column has converter codes.
    #[serde(default, deserialize_with = "spec")]
    pub front_end: Option<FrontEndSpec>,
}

fn spec<'de, D: Deserializer<'de>, T: FromStr<Err: std::fmt::Display>>(source: D) -> Result<Option<T>, D::Error> {
    let text = String::deserialize(source)?;
    text.parse().map(Some).map_err(serde::de::Error::custom)
}

impl Description {
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
        let found: Self = toml::from_str(&text).map_err(wrong)?;
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
        Ok(found)
    }

    /// Columns of the output.
    pub fn columns(&self) -> Vec<String> {
        let of_joint = |joint: &Joint| [format!("{}_deg", joint.name), format!("{}_sd_deg", joint.name)];
        let angles = self.joints.iter().flat_map(of_joint);
        std::iter::once("time_s".to_owned()).chain(angles).chain(["flags".to_owned()]).collect()
    }
}
