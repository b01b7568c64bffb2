use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::error::CliError;
use crate::output::{Outputs, append_whole};

/// A recording that is being written, with whole rows at any time. Rows of the present step can still lose their strain.
pub struct Writer {
    file: File,
    path: PathBuf,
    /// Rows since the step began, without the protocol's cells, and their offset in the file.
    pending: Vec<String>,
    begun: u64,
    end: u64,
}

impl Writer {
    /// Creates the file of a command that reads `inputs`.
    ///
    /// # Errors
    /// If it exists and is not to be replaced, is an input, or cannot be created.
    pub fn new<'a>(path: &Path, force: bool, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<Self, CliError> {
        Outputs::new(force, inputs).refuse_input(path)?;
        let file = if force {
            OpenOptions::new().write(true).create(true).truncate(true).open(path)
        } else {
            File::create_new(path)
        };
        let file = file.map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => CliError::Arguments(format!(
                "{} is there already, and a recording cannot be made again: choose another name, or --force",
                path.display()
            )),
            _ => CliError::file("write", path, &error),
        })?;
        Ok(Self { file, path: path.to_path_buf(), pending: Vec::new(), begun: 0, end: 0 })
    }

    /// Writes the lines above the rows.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn head(&mut self, text: &str) -> Result<(), CliError> {
        self.append(text)?;
        self.settle();
        Ok(())
    }

    /// Writes a row: its own cells, and those of the protocol.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn row(&mut self, cells: String, known: &str) -> Result<(), CliError> {
        self.append(&format!("{cells},{known}\n"))?;
        self.pending.push(cells);
        Ok(())
    }

    /// Ends a step: its rows are final.
    pub fn settle(&mut self) {
        self.pending.clear();
        self.begun = self.end;
    }

    /// Spoils a step: the strain in its rows becomes unknown.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn spoil(&mut self, unknown: &str) -> Result<(), CliError> {
        let rows: String = self.pending.iter().map(|cells| format!("{cells},{unknown}\n")).collect();
        self.file.seek(SeekFrom::Start(self.begun)).map_err(|error| self.failed(&error))?;
        self.end = self.begun;
        self.append(&rows)?;
        self.file.set_len(self.end).map_err(|error| self.failed(&error))?;
        self.settle();
        Ok(())
    }

    /// Appends text without a buffer, so that the file has whole rows however the program ends, also on a full disk.
    fn append(&mut self, text: &str) -> Result<(), CliError> {
        append_whole(&mut self.file, &mut self.end, text.as_bytes()).map_err(|error| self.failed(&error))
    }

    fn failed(&self, error: &io::Error) -> CliError {
        CliError::file("write", &self.path, error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn a_spoiled_step_keeps_its_readings() {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("trace.csv");
        let mut writer = Writer::new(&path, false, []).unwrap();
        writer.head("t,r,strain,strain_sd\n").unwrap();
        writer.row("0,1".into(), "0,0.01").unwrap();
        writer.settle();
        writer.row("1,2".into(), ",").unwrap();
        writer.row("2,3".into(), "0.2,0.01").unwrap();
        writer.spoil(",").unwrap();
        writer.row("3,4".into(), "0,0.01").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, "t,r,strain,strain_sd\n0,1,0,0.01\n1,2,,\n2,3,,\n3,4,0,0.01\n");
        assert!(Writer::new(&path, false, []).is_err() && Writer::new(&path, true, []).is_ok());
    }
}
