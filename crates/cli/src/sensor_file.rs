use std::path::Path;

use ohmstrain::{EstimatorKind, Sensor, SensorParams};

use crate::error::CliError;
use crate::output::Kind;
use crate::whole_file;

/// Message for a file that describes a hand where a sensor is expected.
pub const A_HAND: &str = "is the description of a hand, not of a sensor: give it to `ohmstrain hand`, or to `smooth`, `live`, `evaluate`, `export` or `batch`";

/// Reads a sensor and checks that the estimator, or the file's default one, can be built from it.
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
    if let Some(what) = other_kind(&text) {
        return Err(CliError::Input(format!("{name} {what}")));
    }
    let sensor = match estimator {
        Some(kind) => Sensor::from_toml_for(&text, kind),
        None => Sensor::from_toml(&text),
    };
    sensor.map_err(|error| CliError::Input(error.in_file(&name)))
}

/// Returns what to do with a file of this program that is neither a sensor nor a hand.
pub fn other_kind(head: &str) -> Option<&'static str> {
    let kinds = [
        (Kind::Prior, "is a prior: give it to `calibrate --prior`"),
        (Kind::State, "is a filter's state: give it to `filter --resume`"),
        (Kind::Fusion, "is a fusion of channels: give the hand.toml beside it to `hand`, `smooth` or `live`"),
        (Kind::Protocol, "is a protocol: give it to `record`"),
    ];
    kinds.into_iter().find(|(kind, _)| kind.wrote(head, &[])).map(|(_, what)| what)
}

/// True if these are the first bytes of a sensor's parameters or of a hand's description.
pub fn is_one(bytes: &[u8]) -> bool {
    bytes.starts_with(b"format = ")
}

/// True if this is the description of a hand.
pub fn is_hand(text: &str) -> bool {
    text.lines().any(|line| line.split('#').next().unwrap_or_default().trim() == "[[joints]]")
}

/// True if a file is the description of a hand.
pub fn is_of_a_hand(path: &Path) -> bool {
    path.is_file() && whole_file::text(path).is_ok_and(|text| is_hand(&text))
}

/// True if this is a recording: its first line that is not a comment contains names of columns.
pub fn is_recording(text: &str) -> bool {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or("");
    first.contains(',') && first.split(',').any(|cell| matches!(cell.trim(), "time_s" | "time_us"))
}

/// Creates a sensor with these parameters, or the error of parameters that cannot be written.
pub fn checked(params: SensorParams) -> Result<Sensor, CliError> {
    Sensor::from_params(params).map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}

/// Formats a sensor as the text of its file.
pub fn text(sensor: &Sensor) -> Result<String, CliError> {
    sensor.to_toml().map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}
