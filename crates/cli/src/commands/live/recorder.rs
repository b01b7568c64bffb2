//! Recording while the view runs: a trace with a column of marks.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use ohmstrain_bench_data::{LineParser, ReadingKind, ReferenceQuantity, Row, RowWriter};

use ohmstrain::MADE_BY;

/// Largest number of file names that are tried.
const MOST_FILES: u32 = 10_000;

/// A recording that is being written.
pub struct Recorder {
    rows: RowWriter<BufWriter<File>>,
    /// Path of the file.
    pub path: PathBuf,
    /// Number of rows so far.
    pub count: u64,
    has_codes: bool,
    has_reference: bool,
}

impl Recorder {
    /// Begins the first file `PREFIX-N.csv` that does not exist yet, with the header and metadata of `lines`.
    ///
    /// # Errors
    /// If no file can be created.
    pub fn begin(prefix: &Path, lines: &LineParser) -> io::Result<Self> {
        let (path, mut file) = new_file(prefix)?;
        // The maker of a recording that is played back did not make this one.
        let mut metadata = lines.metadata();
        metadata.other.retain(|(key, _)| key != "made_by");
        write!(file, "# made_by = {MADE_BY} live\n{metadata}")?;
        let mut rows = RowWriter::new(BufWriter::new(file));
        let reading = match (lines.has_codes(), lines.reading_kind()) {
            (true, _) => "adc",
            (_, Some(ReadingKind::Ratio)) => "resistance_ratio",
            _ => "resistance_ohm",
        };
        let reference = lines.reference_quantity().map(|quantity| match quantity {
            ReferenceQuantity::Strain => "strain",
            ReferenceQuantity::AngleDeg => "angle_deg",
        });
        ["time_s", reading].into_iter().chain(reference).chain(["mark"]).for_each(|name| rows.text(name));
        rows.end()?;
        rows.flush()?;
        Ok(Self { rows, path, count: 0, has_codes: lines.has_codes(), has_reference: reference.is_some() })
    }

    /// Writes a row, and the number of its mark, if it has one.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&mut self, row: &Row, mark: Option<u32>) -> io::Result<()> {
        self.rows.number(row.time_s);
        match row.reading.code {
            Some(code) if self.has_codes => self.rows.number(f64::from(code)),
            _ if self.has_codes => self.rows.number(f64::NAN),
            _ => self.rows.number(row.reading.value),
        }
        if self.has_reference {
            self.rows.number(row.reference);
        }
        self.rows.number(mark.map_or(f64::NAN, f64::from));
        self.count += 1;
        self.rows.end()?;
        // Flushed, so that the file has whole rows however the program ends.
        self.rows.flush()
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
