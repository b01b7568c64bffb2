use std::path::Path;

use ohmstrain::{EstimatorKind, Sensor, SensorParams};

use crate::error::CliError;
use crate::whole_file;

/// Description of a file that describes joints, for messages.
pub const A_HAND: &str = "is the description of a hand, not of a sensor: give it to `ohmstrain hand`";

/// Reads a sensor and checks that the estimator (or the file's choice) can be made of it.
pub fn read(path: &Path, estimator: Option<EstimatorKind>) -> Result<Sensor, CliError> {
    let name = path.display().to_string();
    let text = whole_file::text(path)?;
    if is_recording(&text) {
        return Err(CliError::Input(format!(
            "{name} is a recording, not a sensor file: give --sensor what `ohmstrain calibrate` wrote, and the recording by itself"
        )));
    }
    if is_hand(&text) {
        return Err(CliError::Input(format!("{name} {A_HAND}")));
    }
    let sensor = match estimator {
        Some(kind) => Sensor::from_toml_for(&text, kind),
        None => Sensor::from_toml(&text),
    };
    sensor.map_err(|error| CliError::Input(error.in_file(&name)))
}

/// True if these are the first bytes of a sensor's parameters, or of a hand's description.
pub fn is_one(bytes: &[u8]) -> bool {
    bytes.starts_with(b"format = ")
}

/// True if this is the description of a hand.
pub fn is_hand(text: &str) -> bool {
    is_one(text.as_bytes()) && text.lines().any(|line| line.trim() == "[[joints]]")
}

/// True if a file is the description of a hand.
pub fn is_of_a_hand(path: &Path) -> bool {
    path.is_file() && whole_file::text(path).is_ok_and(|text| is_hand(&text))
}

/// True if this is a recording: its first line that is no comment has names of columns.
pub fn is_recording(text: &str) -> bool {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or("");
    first.contains(',') && first.split(',').any(|cell| matches!(cell.trim(), "time_s" | "time_us"))
}

/// A sensor with these parameters, or why it cannot be written.
pub fn checked(params: SensorParams) -> Result<Sensor, CliError> {
    Sensor::from_params(params).map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}

/// A sensor as it is written.
pub fn text(sensor: &Sensor) -> Result<String, CliError> {
    sensor.to_toml().map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}
