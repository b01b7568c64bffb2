//! Text form of `sensor.toml` and `prior.toml`, with the place of an error.

#[cfg(feature = "calibrate")]
use ohmstrain_calib::{CorrectionOfFormat8, PRIOR_FORMAT, Prior};
use ohmstrain_sensor::{FORMAT, FieldError, SensorParams};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;
#[cfg(feature = "calibrate")]
use toml::de::ValueDeserializer;
use toml::de::{DeArray, DeTable, Deserializer};

use crate::error::{Place, TextCause, TextError};

/// The only field that every version of the format has.
#[derive(Deserialize)]
struct Version {
    format: u32,
}

/// Content of a text with a format version.
pub(crate) trait Document: DeserializeOwned {
    /// Version that is read.
    const FORMAT: u32;

    /// Checks all numbers; the error names the first that is out of its range.
    fn check(&self) -> Result<(), FieldError>;

    /// Converts a document of an older version; `None` if it cannot be converted.
    fn converted(_document: Spanned<DeTable<'_>>, _format: u32) -> Option<Result<Self, toml::de::Error>> {
        None
    }
}

impl Document for SensorParams {
    const FORMAT: u32 = FORMAT;

    fn check(&self) -> Result<(), FieldError> {
        self.validate()
    }

    #[cfg(feature = "calibrate")]
    fn converted(document: Spanned<DeTable<'_>>, format: u32) -> Option<Result<Self, toml::de::Error>> {
        (format == 8).then(|| of_format_8(document))
    }
}

/// Converts a document of format 8, which has no weights of the correction: they are learned now.
#[cfg(feature = "calibrate")]
fn of_format_8(mut document: Spanned<DeTable<'_>>) -> Result<SensorParams, toml::de::Error> {
    let correction = document.get_mut().remove("correction").map(ValueDeserializer::from);
    let correction = correction.map(CorrectionOfFormat8::deserialize).transpose()?;
    let mut params = SensorParams::deserialize(Deserializer::from(document))?;
    params.format = FORMAT;
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

/// Parses parameters, and checks that every number is in its range.
pub(crate) fn parse<D: Document>(text: &str) -> Result<D, TextError> {
    let no_toml = |error: toml::de::Error| TextError {
        place: error.span().map(|span| position(text, span.start)),
        cause: TextCause::Toml(error),
    };
    let document = DeTable::parse(text).map_err(no_toml)?;
    let format = format_of(&document, text).map_err(no_toml)?;
    let params = if format == D::FORMAT {
        D::deserialize(Deserializer::from(document))
    } else {
        D::converted(document, format).ok_or_else(|| {
            let line = text.lines().position(|line| line.trim_start().starts_with("format")).map_or(1, |line| line + 1);
            let place = Some(Place { line, column: None });
            TextError { place, cause: TextCause::Format { expected: D::FORMAT, found: format } }
        })?
    };
    let params = params.map_err(no_toml)?;
    match params.check() {
        Ok(()) => Ok(params),
        Err(error) => Err(TextError { place: place_of(text, &error.field), cause: TextCause::Field(error) }),
    }
}

/// Returns the version of a document.
fn format_of(document: &Spanned<DeTable<'_>>, text: &str) -> Result<u32, toml::de::Error> {
    let number = document.get_ref().get("format").and_then(|value| value.get_ref().as_integer());
    let known = number.and_then(|number| u32::from_str_radix(number.as_str(), number.radix()).ok());
    // If there is none, the parser states the error.
    known.map_or_else(|| toml::from_str::<Version>(text).map(|version| version.format), Ok)
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

/// Returns line and column of a byte.
fn position(text: &str, start: usize) -> Place {
    let before = text.get(..start).unwrap_or("");
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    Place { line, column: Some(column) }
}
