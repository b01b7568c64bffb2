//! `sensor.toml` and `prior.toml` as text: in, with the place of what is wrong.

#[cfg(feature = "calibrate")]
use ohmstrain_calib::{CorrectionOfFormat8, PRIOR_FORMAT, Prior};
use ohmstrain_sensor::{FORMAT, FieldError, SensorParams};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::de::{DeArray, DeTable};

use crate::error::{Place, TextCause, TextError};

/// The one field that every version of the format has.
#[derive(Deserialize)]
struct Version {
    format: u32,
}

/// Content of a text with a version.
pub(crate) trait Document: DeserializeOwned {
    /// The version that is read.
    const FORMAT: u32;

    /// Names the first number that is out of its range.
    fn check(&self) -> Result<(), FieldError>;

    /// Converts a text of an older version; `None` if it cannot be converted.
    fn converted(_text: &str, _format: u32) -> Option<Result<Self, toml::de::Error>> {
        None
    }
}

impl Document for SensorParams {
    const FORMAT: u32 = FORMAT;

    fn check(&self) -> Result<(), FieldError> {
        self.validate()
    }

    #[cfg(feature = "calibrate")]
    fn converted(text: &str, format: u32) -> Option<Result<Self, toml::de::Error>> {
        (format == 8).then(|| of_format_8(text))
    }
}

/// Converts a text of format 8, which has no weights of the correction: they are learned now.
#[cfg(feature = "calibrate")]
fn of_format_8(text: &str) -> Result<SensorParams, toml::de::Error> {
    let mut table: toml::Table = toml::from_str(text)?;
    let correction: Option<CorrectionOfFormat8> = table.remove("correction").map(toml::Value::try_into).transpose()?;
    table.insert("format".into(), FORMAT.into());
    let mut params: SensorParams = table.try_into()?;
    if let Some(correction) = correction {
        let nothing = || serde::de::Error::custom("`correction`: nothing can be learned from its rows");
        params.correction = Some(correction.learned(params.limits).ok_or_else(nothing)?);
    }
    Ok(params)
}

#[cfg(feature = "calibrate")]
impl Document for Prior {
    const FORMAT: u32 = PRIOR_FORMAT;

    fn check(&self) -> Result<(), FieldError> {
        self.validate()
    }
}

/// Parameters of which every number is in its range.
pub(crate) fn parse<D: Document>(text: &str) -> Result<D, TextError> {
    let no_toml = |error: toml::de::Error| TextError {
        place: error.span().map(|span| position(text, span.start)),
        cause: TextCause::Toml(error),
    };
    let Version { format } = toml::from_str(text).map_err(no_toml)?;
    let converted = if format == D::FORMAT { None } else { D::converted(text, format) };
    if format != D::FORMAT && converted.is_none() {
        let line = text.lines().position(|line| line.trim_start().starts_with("format")).map_or(1, |line| line + 1);
        let place = Some(Place { line, column: None });
        return Err(TextError { place, cause: TextCause::Format { expected: D::FORMAT, found: format } });
    }
    let params: D = converted.unwrap_or_else(|| toml::from_str(text)).map_err(no_toml)?;
    match params.check() {
        Ok(()) => Ok(params),
        Err(error) => Err(TextError { place: place_of(text, &error.field), cause: TextCause::Field(error) }),
    }
}

/// Returns the place of a field such as `law.branches[0].tau_s`, or of the nearest table above it that the text has.
fn place_of(text: &str, field: &str) -> Option<Place> {
    let document = DeTable::parse(text).ok()?;
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
    start.map(|start| position(text, start))
}

/// Line and column of a byte.
fn position(text: &str, start: usize) -> Place {
    let before = text.get(..start).unwrap_or("");
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    Place { line, column: Some(column) }
}
