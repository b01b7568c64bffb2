//! Recording while the view runs: a trace with a column of marks.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use ohmstrain_bench_data::{Metadata, RowWriter, counted};

use crate::output::append_whole;
use ohmstrain::MADE_BY;

/// Largest number of file names that are tried.
const MOST_FILES: u32 = 10_000;

/// A recording that is being written.
pub struct Recorder {
    file: File,
    /// Length of the file.
    end: u64,
    /// Path of the file.
    pub path: PathBuf,
    /// Number of rows so far.
    pub count: u64,
}

impl Recorder {
    /// Begins the first file `PREFIX-N.csv` that does not exist yet, with the metadata of the stream and these columns between the time
    /// and the marks.
    ///
    /// # Errors
    /// If no file can be created.
    pub fn begin<'c>(
        prefix: &Path,
        mut metadata: Metadata,
        columns: impl Iterator<Item = &'c str>,
    ) -> io::Result<Self> {
        let (path, mut file) = new_file(prefix)?;
        // The maker of a recording that is played back did not make this one.
        metadata.other.retain(|(key, _)| key != "made_by");
        let mut rows = RowWriter::new(format!("# made_by = {MADE_BY} live\n{metadata}").into_bytes());
        std::iter::once("time_s").chain(columns).chain(["mark"]).for_each(|name| rows.text(name));
        rows.end()?;
        let mut end = 0;
        append_whole(&mut file, &mut end, &rows.into_inner())?;
        Ok(Self { file, end, path, count: 0 })
    }

    /// Writes a row, and the number of its mark, if it has one.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&mut self, time_s: f64, values: impl Iterator<Item = f64>, mark: Option<u32>) -> io::Result<()> {
        let mut row = RowWriter::new(Vec::new());
        row.number(time_s);
        values.for_each(|value| row.number(value));
        row.number(mark.map_or(f64::NAN, f64::from));
        row.end()?;
        // Without a buffer, so that the file has whole rows however the program ends.
        append_whole(&mut self.file, &mut self.end, &row.into_inner())?;
        self.count += 1;
        Ok(())
    }
}

/// Stops a recording, or begins one; returns it with a message.
pub fn toggled(
    recorder: Option<Recorder>,
    has_rows: bool,
    begin: impl FnOnce() -> io::Result<Recorder>,
) -> (Option<Recorder>, String) {
    match recorder {
        Some(recorder) => (None, format!("recorded {} ({})", recorder.path.display(), counted(recorder.count, "row"))),
        None if !has_rows => (None, "there is nothing to record yet".into()),
        None => match begin() {
            Ok(recorder) => {
                let message = format!("recording to {}", recorder.path.display());
                (Some(recorder), message)
            }
            Err(error) => (None, format!("cannot record: {error}")),
        },
    }
}

fn new_file(prefix: &Path) -> io::Result<(PathBuf, File)> {
    for number in 1..=MOST_FILES {
        let mut name = prefix.as_os_str().to_owned();
        name.push(format!("-{number}.csv"));
        let path = PathBuf::from(name);
        match File::create_new(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => return Ok((path, made?)),
        }
    }
    Err(io::Error::other("there are ten thousand records already"))
}
