use crate::error::{BadContent, Fault};

/// Reason why files cannot be imported as a trace. Each is one line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// Faulty contents of a file.
    #[error(transparent)]
    Content(#[from] BadContent),
    /// A container that cannot be read.
    #[error("{file}: {what}")]
    Unreadable {
        /// Name of the file.
        file: String,
        /// Problem with it.
        what: String,
    },
    /// A question that the files leave open.
    #[error("{file}: {what}; say {}", answers.join(" or "))]
    Question {
        /// Name of the file.
        file: String,
        /// The open question.
        what: String,
        /// Flags that answer it, quoted for a shell.
        answers: Vec<String>,
    },
}

impl ImportError {
    pub(crate) fn content(file: &str, line: u64, fault: Fault) -> Self {
        Self::Content(fault.at(file, line))
    }

    pub(crate) fn unreadable(file: &str, what: impl Into<String>) -> Self {
        Self::Unreadable { file: file.to_owned(), what: what.into() }
    }

    pub(crate) fn question(file: &str, what: impl Into<String>, answers: impl IntoIterator<Item = String>) -> Self {
        Self::Question { file: file.to_owned(), what: what.into(), answers: answers.into_iter().collect() }
    }
}

/// Quotes a word for a POSIX shell.
pub(crate) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-+=./:,@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}
