use std::borrow::Cow;
use std::io;
use std::path::Path;
use std::process::ExitCode;

use ohmstrain::trace::{Refusal, TraceFileError};
use ohmstrain::{Error as LibraryError, Quantity};
use ohmstrain_bench_data::TraceError;
use ohmstrain_calib::CalibrationError;
use ohmstrain_export::ExportError;
use ohmstrain_report::ReportingError;
use thiserror::Error;

use crate::messages::Messages;
use crate::printable::printable;

/// Reason why a command stopped; each kind has its exit code.
#[derive(Debug, Error)]
pub enum CliError {
    /// The arguments contradict each other or the sensor file.
    #[error("{0}")]
    Arguments(String),
    /// An input has invalid contents.
    #[error("{0}")]
    Input(String),
    /// `evaluate --check` found the estimates wanting.
    #[error("{0}")]
    Check(String),
    /// `batch` could not do some recordings.
    #[error("{0}")]
    Batch(String),
    /// The reader of our output has closed the pipe.
    #[error("the pipe is closed")]
    ClosedPipe,
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

impl CliError {
    /// Returns the program's exit code.
    pub const fn code(&self) -> u8 {
        match self {
            Self::ClosedPipe => 0,
            Self::Other(_) => 1,
            Self::Arguments(_) => 2,
            Self::Check(_) => 3,
            Self::Input(_) => 4,
            Self::Batch(_) => 5,
        }
    }

    /// Reports the error on stderr, except that a reader has closed the pipe.
    pub fn report(&self) -> ExitCode {
        if !matches!(self, Self::ClosedPipe) {
            Messages::error(&self.to_string());
        }
        ExitCode::from(self.code())
    }

    /// Creates the error of a calibration that failed on the contents of `files`.
    pub fn calibration(files: &[&str], error: CalibrationError) -> Self {
        Refusal::calibration(files, error).into()
    }

    /// Adds the input's name to an error about its contents.
    pub fn named(self, name: &str) -> Self {
        match self {
            Self::Input(text) => Self::Input(format!("{name}: {text}")),
            other => other,
        }
    }

    /// Creates the error of a `path` that cannot be read or written.
    pub fn file(doing: &str, path: &Path, error: &io::Error) -> Self {
        Self::Other(format!("cannot {doing} {}: {error}", path.display()))
    }
}

/// Errors of the library in the terms of the command line: options become arguments, rows count from one.
impl CliError {
    /// Converts the reason why the sensor file `name` cannot be exported.
    pub fn export(error: &ExportError, name: &str) -> Self {
        match error {
            ExportError::Unsupported { .. } | ExportError::Parameter(_) => Self::Input(format!("{name}: {error}")),
            ExportError::Interval(_) => Self::Arguments(format!("--dt-s: {error}")),
            ExportError::Budget { .. } => Self::Arguments(format!("--budget: {error}")),
            ExportError::Template(_) => Self::Other(error.to_string()),
        }
    }

    /// Converts the reason why the recording `name` has no estimates or no report.
    pub fn reporting(error: ReportingError, name: &str) -> Self {
        match error {
            ReportingError::Build(error) => error.into(),
            ReportingError::Row { row, source } => Self::from(LibraryError::Row { row, source }).named(name),
            ReportingError::Rows(error) => Self::from(error).named(name),
            other => Self::Other(other.to_string()),
        }
    }
}

impl From<LibraryError> for CliError {
    fn from(error: LibraryError) -> Self {
        match error {
            LibraryError::KnownStrain { quantity, name, .. } => {
                let flag = if name == "known strain" { "--known" } else { "--initial-strain" };
                let refused = error.to_string().replacen(name, flag, 1);
                Self::Arguments(refused + if quantity == Quantity::Strain { "; 10 % is 0.1" } else { "" })
            }
            LibraryError::FarRest { .. } => Self::Arguments(format!("--rest-resistance: {error}")),
            LibraryError::Guard(_) | LibraryError::NotPositive { .. } | LibraryError::NoTemperatures => {
                Self::Arguments(error.to_string())
            }
            LibraryError::Row { row, source } => Self::Input(format!("data row {}: {source}", row + 1)),
            _ => Self::Input(error.to_string()),
        }
    }
}

impl From<Refusal> for CliError {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Library(error) => error.into(),
            Refusal::Calibration(_, error @ CalibrationError::Optimiser(_)) => Self::Other(error.to_string()),
            _ => Self::Input(refusal.to_string()),
        }
    }
}

impl From<TraceFileError> for CliError {
    fn from(error: TraceFileError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<TraceError> for CliError {
    fn from(error: TraceError) -> Self {
        match error {
            TraceError::Content(content) if content.is_foreign && content.file != "stdin" => {
                Self::Input(format!("{content}; see `ohmstrain inspect {}`", shell_word(&content.file)))
            }
            TraceError::Content(_) => Self::Input(error.to_string()),
            // Damaged content of a container.
            TraceError::Io { ref source, .. } if source.kind() == io::ErrorKind::InvalidData => {
                Self::Input(error.to_string())
            }
            _ => Self::Other(error.to_string()),
        }
    }
}

/// Quotes a word for a shell. Unprintable bytes become octal escapes, as in bash, zsh and ksh.
pub fn shell_word(word: &str) -> String {
    match (printable(word), shlex::try_quote(word)) {
        (Cow::Borrowed(_), Ok(quoted)) => quoted.into_owned(),
        _ => format!("$'{}'", word.bytes().map(in_dollar_quotes).collect::<String>()),
    }
}

fn in_dollar_quotes(byte: u8) -> String {
    match byte {
        b'\'' | b'\\' => format!("\\{}", char::from(byte)),
        b' '..=b'~' => char::from(byte).into(),
        _ => format!("\\{byte:03o}"),
    }
}

/// Errors of writing to stdout.
impl From<io::Error> for CliError {
    fn from(error: io::Error) -> Self {
        if error.kind() == io::ErrorKind::BrokenPipe {
            Self::ClosedPipe
        } else {
            Self::Other(format!("cannot write: {error}"))
        }
    }
}
