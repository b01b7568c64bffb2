use std::fs;
use std::path::Path;

use ohmstrain_calib::{EstimatorKind, FORMAT, SensorParams, Start, build_filter};
use serde::Deserialize;
use toml::de::{DeArray, DeTable};

use crate::error::CliError;

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
    params
        .validate()
        .map_err(|error| CliError::Input(format!("{}: {error}", place(&name.to_string(), &text, &error.field))))?;
    build_filter(&params, estimator, Start::Unknown).map_err(|error| CliError::Input(format!("{name}: {error}")))?;
    Ok(params)
}

/// `file:line: column c: message` of a TOML error, on one line.
fn locate(name: &str, text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', ", ");
    match error.span() {
        Some(span) => format!("{}: {message}", position(name, text, span.start)),
        None => format!("{name}: {message}"),
    }
}

/// `file:line: column c` of a field, `law.branches[0].tau_s`, or of the nearest table above it that the text has.
fn place(name: &str, text: &str, field: &str) -> String {
    let Ok(document) = DeTable::parse(text) else { return name.to_string() };
    let mut start = None;
    let mut table = Some(document.get_ref());
    let mut array: Option<&DeArray> = None;
    for step in field.split(['.', '[']) {
        let found = match step.strip_suffix(']') {
            Some(index) => array.and_then(|array| array.get(index.parse::<usize>().ok()?)),
            None => table.and_then(|table| table.get(step)),
        };
        let Some(found) = found else { break };
        start = Some(found.span().start);
        (table, array) = (found.get_ref().as_table(), found.get_ref().as_array());
    }
    start.map_or_else(|| name.to_string(), |start| position(name, text, start))
}

/// `file:line: column c` of a byte.
fn position(name: &str, text: &str, start: usize) -> String {
    let before = text.get(..start).unwrap_or("");
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    format!("{name}:{line}: column {column}")
}

/// A sensor's parameters as they are written.
pub fn text(params: &SensorParams) -> Result<String, CliError> {
    params.validate().map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))?;
    toml::to_string(params).map_err(|error| CliError::Other(format!("cannot write parameters: {error}")))
}
