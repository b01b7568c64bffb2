//! Messages on stderr, and their verbosity.

use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

use crate::printable::printable;

/// Verbosity of messages other than errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verbosity {
    /// Nothing.
    Quiet,
    /// Remarks, warnings and progress.
    Usual,
    /// Steps of the work with their times, in addition.
    Detailed,
}

/// Destination of a command's messages: stderr, or a list of warnings for one recording of many.
pub struct Messages {
    verbosity: Verbosity,
    warnings: Option<Mutex<Vec<String>>>,
}

impl Messages {
    /// Sends messages to stderr.
    pub const fn shown(verbosity: Verbosity) -> Self {
        Self { verbosity, warnings: None }
    }

    /// Collects warnings in a list, and drops remarks.
    pub const fn kept(verbosity: Verbosity) -> Self {
        Self { verbosity, warnings: Some(Mutex::new(Vec::new())) }
    }

    /// Returns the warnings that were collected.
    pub fn into_warnings(self) -> Vec<String> {
        self.warnings.map_or_else(Vec::new, |kept| kept.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// True if only errors are printed.
    pub fn is_quiet(&self) -> bool {
        self.verbosity == Verbosity::Quiet
    }

    /// True if progress is shown to a user.
    pub fn shows_progress(&self) -> bool {
        !self.is_quiet() && self.warnings.is_none()
    }

    /// Prints an error on stderr.
    pub fn error(text: &str) {
        // `eprintln!` would panic if the reader of stderr has closed it.
        let _ = writeln!(io::stderr(), "ohmstrain: {}", printable(text));
    }

    /// Prints a remark on something that did not stop the command.
    pub fn remark(&self, text: &str) {
        if self.shows_progress() {
            Self::error(text);
        }
    }

    /// Prints the present step of the work, if details are requested.
    pub fn detail(&self, text: &str) {
        if self.verbosity == Verbosity::Detailed {
            self.remark(text);
        }
    }

    /// Prints or collects a warning that casts doubt on a result.
    pub fn warning(&self, text: &str) {
        match &self.warnings {
            Some(_) if self.is_quiet() => {}
            Some(kept) => kept.lock().unwrap_or_else(PoisonError::into_inner).push(printable(text).into_owned()),
            None => self.remark(&format!("warning: {text}")),
        }
    }
}
