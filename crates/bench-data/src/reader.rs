use std::io::Read;

use crate::clock::LastTime;
use crate::columns::{Column, Columns};
use crate::error::{Fault, TraceError};
use crate::lines::{LineFault, LineFeed, Lines, is_plain};
use crate::metadata::Metadata;
use crate::row::{ReadingKind, ReferenceQuantity, Row};
use crate::row_parser::RowParser;
use csv::StringRecord;

/// Reads a trace row by row, in constant memory.
///
/// Metadata and header are read at construction; each row is delivered as soon as its line is complete. The iterator ends after an error.
///
/// ```
/// use ohmstrain_bench_data::TraceReader;
/// let file = "# gauge_length_mm = 30\ntime_s,resistance_ohm,displacement_mm\n0.0,1600,0\n0.1,,3\n";
/// let mut rows = TraceReader::new(file.as_bytes(), "-")?;
/// assert_eq!(rows.next().unwrap()?.reading.value, 1600.0);
/// let row = rows.next().unwrap()?;
/// assert!(row.reading.value.is_nan());
/// assert_eq!(row.reference, 0.1);
/// # Ok::<(), ohmstrain_bench_data::TraceError>(())
/// ```
pub struct TraceReader<R> {
    file: String,
    metadata: Metadata,
    parser: RowParser,
    records: csv::Reader<LineFeed<R>>,
    record: StringRecord,
    /// True while every line was plain; from the first other one on, the csv crate reads all lines.
    plain: bool,
    done: bool,
}

impl<R: Read> TraceReader<R> {
    /// Reads metadata and header. `name` is the source's name in messages; `-` becomes `stdin`.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails or does not start like a trace.
    pub fn new(source: R, name: &str) -> Result<Self, TraceError> {
        Self::with_overrides(source, name, &Metadata::default())
    }

    /// Reads metadata and header as [`new`](Self::new) does; values of `overrides` replace the file's.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails or does not start like a trace.
    pub fn with_overrides(source: R, name: &str, overrides: &Metadata) -> Result<Self, TraceError> {
        let (file, mut lines) = (called(name), Lines::new(source));
        let (metadata, header) = read_prelude(&mut lines).map_err(|fault| placed(fault, &file, lines.number()))?;
        Self::begin(file, lines, metadata, overrides, &header)
    }

    /// Reads a source without a header, or one that is joined after its header: `header` names the columns, and the first line is a row.
    ///
    /// # Errors
    /// [`TraceError`] if these are not the columns of a trace.
    pub fn headless(source: R, name: &str, header: &str, overrides: &Metadata) -> Result<Self, TraceError> {
        Self::begin(called(name), Lines::new(source), Metadata::default(), overrides, header)
    }

    fn begin(
        file: String,
        lines: Lines<R>,
        mut metadata: Metadata,
        overrides: &Metadata,
        header: &str,
    ) -> Result<Self, TraceError> {
        metadata.override_with(overrides);
        let plain = is_plain(header);
        let mut records =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(LineFeed::new(lines, header));
        let mut record = StringRecord::new();
        records.read_record(&mut record).map_err(|error| feed_error(error, &mut records, &file))?;
        let at_header = |fault: Fault| TraceError::from(fault.at(&file, records.get_ref().line()));
        let columns = Columns::of_header(&record).map_err(at_header)?;
        let has_strain = columns.reference.is_some_and(|place| place.column == Column::Strain);
        let parser = RowParser::new(columns, &metadata).map_err(at_header)?;
        let metadata = metadata.in_own_units(has_strain);
        Ok(Self { file, metadata, parser, records, record, plain, done: false })
    }

    /// Returns the name of the source in messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the file's metadata with the overrides.
    #[must_use]
    pub const fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Returns the kind of the readings.
    #[must_use]
    pub fn reading_kind(&self) -> ReadingKind {
        self.parser.reading_kind()
    }

    /// True if the readings are converter codes, so that each carries its own standard deviation.
    #[must_use]
    pub fn has_codes(&self) -> bool {
        self.parser.has_codes()
    }

    /// Returns the quantity of the reference, if there is one. A displacement becomes strain, and so does an angle with a joint.
    #[must_use]
    pub fn reference_quantity(&self) -> Option<ReferenceQuantity> {
        self.parser.reference_quantity()
    }

    /// True if the file has temperatures.
    #[must_use]
    pub const fn has_temperature(&self) -> bool {
        self.parser.has_temperature()
    }

    /// Returns the physical line read last, counted from 1; 0 before the first, if the header is not in the source.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.records.get_ref().line()
    }

    /// Returns the time of the last row, as in the source.
    #[must_use]
    pub fn last_time(&self) -> Option<LastTime> {
        self.parser.last_time()
    }

    /// Continues from the last time of a previous stream: the first row must be later, and a counter may have wrapped. Returns `false` if
    /// that stream used another unit of time.
    pub fn go_on(&mut self, from: LastTime) -> bool {
        self.parser.clock().go_on(from)
    }

    fn next_row(&mut self) -> Result<Option<Row>, TraceError> {
        if !self.next_record()? {
            return Ok(None);
        }
        let line = self.line();
        self.parser.row(&self.record, line).map(Some).map_err(|fault| fault.at(&self.file, line).into())
    }

    /// Reads the cells of the next row; `false` at the end of the source.
    fn next_record(&mut self) -> Result<bool, TraceError> {
        let feed = self.records.get_mut();
        feed.begin_record();
        if self.plain {
            let plain = feed.next_plain(&mut self.record);
            match plain.map_err(|fault| placed(fault, &self.file, self.records.get_ref().line()))? {
                None => return Ok(false),
                Some(true) => return Ok(true),
                Some(false) => self.plain = false,
            }
        }
        let record = self.records.read_record(&mut self.record);
        record.map_err(|error| feed_error(error, &mut self.records, &self.file))
    }
}

impl<R: Read> Iterator for TraceReader<R> {
    type Item = Result<Row, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        let row = self.next_row().transpose();
        self.done = !matches!(row, Some(Ok(_)));
        row
    }
}

impl<R: Read> std::iter::FusedIterator for TraceReader<R> {}

/// Returns the name of a source in messages.
pub(crate) fn called(name: &str) -> String {
    if name == "-" { "stdin" } else { name }.to_owned()
}

/// Largest number of lines of remarks and metadata above a header.
const MOST_REMARKS: usize = 10_000;

pub(crate) const A_HEADER: &str = "a header such as `time_s,resistance_ohm,strain`";

/// Reads the metadata lines and the header line.
fn read_prelude<R: Read>(lines: &mut Lines<R>) -> Result<(Metadata, String), LineFault> {
    let mut metadata = Metadata::default();
    for _ in 0..MOST_REMARKS {
        let Some(line) = lines.next()? else {
            let found = if lines.number() == 0 { "an empty file" } else { "the end of the file" };
            return Err(LineFault::Content(Fault::new(A_HEADER, found)));
        };
        if !line.starts_with('#') {
            return Ok((metadata, line.to_owned()));
        }
        metadata.take_line(line).map_err(LineFault::Content)?;
    }
    Err(LineFault::Content(Fault::new(A_HEADER, format!("none below {MOST_REMARKS} lines that begin with `#`"))))
}

/// Returns the error of the line that made the csv crate fail.
fn feed_error<R: Read>(error: csv::Error, records: &mut csv::Reader<LineFeed<R>>, file: &str) -> TraceError {
    let fault = records.get_mut().take_fault().unwrap_or_else(|| LineFault::Io(error.into()));
    placed(fault, file, records.get_ref().line())
}

/// Adds the place to a fault; `line` was delivered last.
pub(crate) fn placed(fault: LineFault, file: &str, line: u64) -> TraceError {
    match fault {
        // An empty file has no line at all; anything missing is reported on the first line.
        LineFault::Content(fault) => fault.at(file, line.max(1)).into(),
        // The failure is after the last line that was delivered.
        LineFault::Io(source) => TraceError::Io { file: file.to_owned(), line: line + 1, source },
    }
}
