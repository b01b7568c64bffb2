use std::fmt;
use std::io;

/// Reason why a trace could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TraceError {
    /// The contents are not a trace.
    #[error(transparent)]
    Content(#[from] BadContent),
    /// The source itself failed; its contents are not at fault.
    #[error("{file}:{line}: cannot be read: {source}")]
    Io {
        /// Name of the source.
        file: String,
        /// The line that was being read, counted from 1.
        line: u64,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// Contents that are not a trace, with their place, the expected and the found content.
///
/// Displayed as one line, `file:line: column `x`: expected …, found …`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub struct BadContent {
    /// Name of the source; `stdin` for `-`.
    pub file: String,
    /// Physical line, counted from 1.
    pub line: u64,
    /// The faulty column, if there is one.
    pub column: Option<String>,
    /// Expected content.
    pub expected: String,
    /// Content that was found, shortened, with control characters escaped.
    pub found: String,
    /// True if the file has an entirely different format: no header of a trace, or no UTF-8 text.
    pub is_foreign: bool,
    /// True if only the time is wrong: it is not after that of the previous row.
    pub is_late: bool,
}

impl BadContent {
    /// Names a column as it is called in the file, `to`, where the parser calls it `from`.
    #[must_use]
    pub fn renamed(mut self, from: &str, to: &str) -> Self {
        if self.column.as_deref() == Some(from) {
            self.column = Some(to.to_owned());
        }
        self
    }
}

impl fmt::Display for BadContent {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}: ", self.file, self.line)?;
        if let Some(column) = &self.column {
            write!(out, "column `{column}`: ")?;
        }
        write!(out, "expected {}, found {}", self.expected, self.found)
    }
}

/// Invalid description of a front end or a joint; its place in a file is known elsewhere.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found {found}")]
#[non_exhaustive]
pub struct SpecError {
    /// Expected content.
    pub expected: String,
    /// Content that was found, shortened, with control characters escaped.
    pub found: String,
}

impl SpecError {
    pub(crate) fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into() }
    }
}

/// Error within a line, before file and line number are known.
#[derive(Debug)]
pub(crate) struct Fault {
    pub column: Option<&'static str>,
    pub expected: String,
    pub found: String,
    pub is_foreign: bool,
    pub is_late: bool,
}

impl Fault {
    pub(crate) fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        let (expected, found) = (expected.into(), found.into());
        Self { column: None, expected, found, is_foreign: false, is_late: false }
    }

    /// Marks the content as something other than a faulty trace.
    pub(crate) fn foreign(self) -> Self {
        Self { is_foreign: true, ..self }
    }

    /// Marks a time that is not after the previous one.
    pub(crate) fn late(self) -> Self {
        Self { is_late: true, ..self }
    }

    pub(crate) fn in_column(column: &'static str, expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { column: Some(column), ..Self::new(expected, found) }
    }

    pub(crate) fn at(self, file: &str, line: u64) -> BadContent {
        BadContent {
            file: file.to_owned(),
            line,
            column: self.column.map(str::to_owned),
            expected: self.expected,
            found: self.found,
            is_foreign: self.is_foreign,
            is_late: self.is_late,
        }
    }
}

impl From<SpecError> for Fault {
    fn from(error: SpecError) -> Self {
        Self::new(error.expected, error.found)
    }
}

const LONGEST_QUOTE: usize = 40;

/// Formats foreign text for a message: in backticks, on one line, at most 40 characters.
pub(crate) fn quote(text: &str) -> String {
    let text = text.trim();
    if text.is_empty() {
        return "nothing".to_owned();
    }
    let mut out = String::from("`");
    for (i, c) in text.chars().enumerate() {
        if i == LONGEST_QUOTE {
            out.push('…');
            break;
        }
        // The replacement character and controls would garble a terminal; everything else is readable as it is.
        if c.is_control() { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out.push('`');
    out
}

#[cfg(test)]
mod tests {
    use super::quote;

    #[test]
    fn foreign_text_is_short_and_on_one_line() {
        assert_eq!(quote("abc"), "`abc`");
        assert_eq!(quote("  "), "nothing");
        assert_eq!(quote("a\u{1b}[2Jb\tc"), "`a\\u{1b}[2Jb\\tc`");
        assert_eq!(quote(&"x".repeat(100)), format!("`{}…`", "x".repeat(40)));
    }
}
