//! How much is said on stderr: chosen once, before anything is said.

use std::sync::OnceLock;

/// How much is said on stderr besides errors.
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

static CHOSEN: OnceLock<Verbosity> = OnceLock::new();

impl Verbosity {
    /// Chooses, unless that has been done.
    pub fn choose(self) {
        // A second choice cannot come: `main` makes the only one.
        let _ = CHOSEN.set(self);
    }

    /// What was chosen.
    pub fn chosen() -> Self {
        CHOSEN.get().copied().unwrap_or_default()
    }
}
