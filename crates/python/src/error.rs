use ohmstrain::{Error, Interface, TextError};
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    ohmstrain,
    OhmstrainError,
    PyValueError,
    "What is wrong with a table, a sensor file or an option: `file`, `row` (from zero) and `column` say where, if it is known."
);

/// Place of an error.
#[derive(Debug, Default)]
pub struct Place<'a> {
    /// File, or name of a recording.
    pub file: Option<&'a str>,
    /// Row of a table, from zero.
    pub row: Option<usize>,
    /// Column of a table.
    pub column: Option<&'a str>,
}

/// Creates the exception for a message about a place, which the message names first.
pub fn raise(place: &Place, message: &str) -> PyErr {
    let Place { file, row, column } = place;
    let parts = [
        file.map(str::to_owned),
        row.map(|row| format!("row {row}")),
        // Some messages begin with it.
        column.map(|column| format!("column `{column}`")).filter(|named| !message.starts_with(named)),
        Some(message.to_owned()),
    ];
    let text = parts.into_iter().flatten().collect::<Vec<_>>().join(": ");
    let error = OhmstrainError::new_err(text);
    Python::attach(|py| {
        let value = error.value(py);
        let set = value
            .setattr("file", file)
            .and_then(|()| value.setattr("row", row))
            .and_then(|()| value.setattr("column", column));
        set.map_or_else(|failed| failed, |()| error.clone_ref(py))
    })
}

/// Reason why rows were not processed to the end.
#[derive(Debug)]
pub enum Stopped {
    /// The library refuses a row.
    Refused(Error),
    /// An interrupt or another signal, or an exception that it raised.
    Interrupted(PyErr),
}

impl From<Error> for Stopped {
    fn from(error: Error) -> Self {
        Self::Refused(error)
    }
}

/// Returns the exception of a signal that has arrived.
pub fn check_signals() -> PyResult<()> {
    Python::attach(|py| py.check_signals())
}

/// Converts an error of the library on a recording or file of this name.
pub fn of_library(error: &Error, file: Option<&str>) -> PyErr {
    let place = Place { file, ..Place::default() };
    match error {
        Error::Row { row, source } => raise(&Place { row: Some(*row), ..place }, &source.to_string()),
        Error::Text(TextError { .. }) => match file {
            Some(file) => raise(&Place { file: None, ..place }, &error.in_file(file)),
            None => raise(&place, &error.to_string()),
        },
        Error::Unit(doubt) => raise(&Place { column: Some(doubt.column), ..place }, &doubt.text(Interface::Python)),
        Error::Reference(doubt) => raise(&Place { column: Some("strain"), ..place }, &doubt.text(Interface::Python)),
        Error::FarRest { .. } => raise(&place, &format!("rest_resistance: {error}")),
        _ => raise(&place, &error.to_string()),
    }
}
