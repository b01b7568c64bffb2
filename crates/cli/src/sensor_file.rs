use std::fs;
use std::path::Path;

pub use ohmstrain::MADE_BY;
use ohmstrain::{EstimatorKind, Sensor, SensorParams};

use crate::error::CliError;

/// Reads a sensor and checks that the estimator (or the file's choice) can be made of it.
pub fn read(path: &Path, estimator: Option<EstimatorKind>) -> Result<Sensor, CliError> {
    let name = path.display().to_string();
    let bytes = fs::read(path).map_err(|error| CliError::file("read", path, &error))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| CliError::Input(format!("{name}:1: expected a text file in UTF-8, found other bytes")))?;
    let sensor = match estimator {
        Some(kind) => Sensor::from_toml_for(&text, kind),
        None => Sensor::from_toml(&text),
    };
    sensor.map_err(|error| CliError::Input(error.in_file(&name)))
}

/// A sensor with these parameters, or why it cannot be written.
pub fn checked(params: SensorParams) -> Result<Sensor, CliError> {
    Sensor::from_params(params).map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}

/// A sensor as it is written.
pub fn text(sensor: &Sensor) -> Result<String, CliError> {
    sensor.to_toml().map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}
