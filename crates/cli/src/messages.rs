//! What is said on stderr, and how much of it.

use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

use crate::printable::printable;

/// How much is said besides errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verbosity {
    /// Nothing.
    Quiet,
    /// Remarks, warnings and progress.
    #[default]
    Usual,
    /// What is being done, and since when, too.
    Detailed,
}

/// Where a command's messages go: to stderr, or for one recording of many, its warnings into a list of its own.
pub struct Messages {
    verbosity: Verbosity,
    warnings: Option<Mutex<Vec<String>>>,
}

impl Messages {
    /// To stderr.
    pub const fn shown(verbosity: Verbosity) -> Self {
        Self { verbosity, warnings: None }
    }

    /// Warnings into a list; remarks nowhere.
    pub const fn kept(verbosity: Verbosity) -> Self {
        Self { verbosity, warnings: Some(Mutex::new(Vec::new())) }
    }

    /// The warnings that were kept.
    pub fn into_warnings(self) -> Vec<String> {
        self.warnings.map_or_else(Vec::new, |kept| kept.into_inner().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether nothing is said but errors.
    pub fn is_quiet(&self) -> bool {
        self.verbosity == Verbosity::Quiet
    }

    /// Whether there is somebody to look at progress.
    pub fn shows_progress(&self) -> bool {
        !self.is_quiet() && self.warnings.is_none()
    }

    /// Says on stderr what went wrong.
    pub fn error(text: &str) {
        // `eprintln!` would panic if whoever read stderr has left.
        let _ = writeln!(io::stderr(), "ohmstrain: {}", printable(text));
    }

    /// Says what did not stop the command.
    pub fn remark(&self, text: &str) {
        if self.shows_progress() {
            Self::error(text);
        }
    }

    /// Says what is being done, where that is wanted.
    pub fn detail(&self, text: &str) {
        if self.verbosity == Verbosity::Detailed {
            self.remark(text);
        }
    }

    /// Says what casts doubt on a result.
    pub fn warning(&self, text: &str) {
        match &self.warnings {
            Some(_) if self.is_quiet() => {}
            Some(kept) => kept.lock().unwrap_or_else(PoisonError::into_inner).push(printable(text).into_owned()),
            None => self.remark(&format!("warning: {text}")),
        }
    }
}
