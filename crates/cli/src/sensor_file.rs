use std::fs;
use std::path::Path;

use ohmstrain_calib::{EstimatorKind, FORMAT, RangeParams, SensorParams, Start, build_filter};
use ohmstrain_model::Joint;
use serde::Deserialize;

use crate::error::CliError;
use crate::output::write_file;

/// Program and version, as written into files.
pub const MADE_BY: &str = concat!("ohmstrain ", env!("CARGO_PKG_VERSION"));

/// The one field that every version of the format has.
#[derive(Deserialize)]
struct Version {
    format: u32,
}

/// Reads a sensor's parameters and checks that the estimator (or the file's choice) can be made of them.
pub fn read(path: &Path, estimator: Option<EstimatorKind>) -> Result<SensorParams, CliError> {
    let name = path.display();
    let bytes = fs::read(path).map_err(|error| CliError::file("read", path, &error))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| CliError::Input(format!("{name}:1: expected a text file in UTF-8, found other bytes")))?;
    let located = |error: &toml::de::Error| CliError::Input(locate(&name.to_string(), &text, error));
    let version: Version = toml::from_str(&text).map_err(|error| located(&error))?;
    if version.format != FORMAT {
        let line = text.lines().position(|line| line.trim_start().starts_with("format")).map_or(1, |line| line + 1);
        return Err(CliError::Input(format!(
            "{name}:{line}: field `format`: expected version {FORMAT}, found {}",
            version.format
        )));
    }
    let params: SensorParams = toml::from_str(&text).map_err(|error| located(&error))?;
    let wrong = |what: String| CliError::Input(format!("{name}: {what}"));
    if !(params.rest_reading > 0.0 && params.rest_reading.is_finite()) {
        return Err(wrong(format!("field `rest_reading`: expected a positive number, found {}", params.rest_reading)));
    }
    let RangeParams { lower, upper } = params.limits;
    if !(lower < upper) {
        return Err(wrong(format!(
            "field `limits`: expected a lower end below the upper one, found {lower} and {upper}"
        )));
    }
    if let Some(joint) = params.joint {
        Joint::new(joint.prestrain, joint.moment_arm_mm, joint.gauge_length_mm)
            .map_err(|error| wrong(format!("field `joint`: {error}")))?;
    }
    build_filter(&params, estimator, Start::Unknown).map_err(|error| wrong(error.to_string()))?;
    Ok(params)
}

/// `file:line: column c: message` of a TOML error, on one line.
fn locate(name: &str, text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', ", ");
    match error.span() {
        Some(span) => {
            let before = text.get(..span.start).unwrap_or("");
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
            format!("{name}:{line}: column {column}: {message}")
        }
        None => format!("{name}: {message}"),
    }
}

/// Writes a sensor's parameters.
pub fn write(path: &Path, params: &SensorParams) -> Result<(), CliError> {
    let text = toml::to_string(params).map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))?;
    write_file(path, |out| Ok(out.write_all(text.as_bytes())?))
}
