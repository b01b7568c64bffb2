//! Destination of a table of rows while it is made: stdout, or a file.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{Claim, Kind, Outputs, is_stdout};
use crate::error::CliError;

/// Bytes that are written at once, unless a reader waits for rows.
const WRITTEN_AT_ONCE: usize = 1 << 16;

/// Destination of estimates.
pub struct RowsOut {
    /// The files that are published with the table.
    pub outputs: Outputs,
    claim: Option<Claim>,
}

impl RowsOut {
    /// Claims a file for a table with these columns, or stdout.
    ///
    /// # Errors
    /// As [`Outputs::claim`].
    pub fn claim<'a>(
        output: Option<&Path>,
        columns: &[String],
        force: bool,
        inputs: impl IntoIterator<Item = &'a PathBuf>,
    ) -> Result<Self, CliError> {
        let mut outputs = Outputs::new(force, inputs);
        let output = output.filter(|path| !is_stdout(path));
        let claim = output.map(|path| outputs.claim_table(path, Kind::Estimates, columns)).transpose()?;
        Ok(Self { outputs, claim })
    }

    /// Opens the writer. A file is published in [`Outputs::publish`], unless it `grows`: then each row of a live stream is
    /// visible at once, and stays if the stream breaks.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn open(&mut self, grows: bool) -> Result<Box<dyn Write + Send>, CliError> {
        Ok(match self.claim {
            None => Box::new(BufWriter::with_capacity(WRITTEN_AT_ONCE, io::stdout())),
            Some(claim) => {
                let (file, path) = self.outputs.open(claim, grows)?;
                Box::new(BufWriter::with_capacity(WRITTEN_AT_ONCE, Named { file, path }))
            }
        })
    }
}

/// Appends rows to a file of `end` bytes; if it has no room for them, it keeps its whole rows.
///
/// # Errors
/// If they cannot be written.
pub fn append_whole(file: &mut File, end: &mut u64, rows: &[u8]) -> io::Result<()> {
    let written = file.write_all(rows);
    match written {
        Ok(()) => *end += rows.len() as u64,
        Err(_) => drop(file.set_len(*end)),
    }
    written
}

/// A file that adds its path to errors.
struct Named {
    file: File,
    path: PathBuf,
}

impl Write for Named {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let named = |error: io::Error| match error.kind() {
            // A closed pipe is not an error of the file, and an interrupted call is repeated.
            io::ErrorKind::BrokenPipe | io::ErrorKind::Interrupted => error,
            kind => io::Error::new(kind, format!("{}: {error}", self.path.display())),
        };
        self.file.write(bytes).map_err(named)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
