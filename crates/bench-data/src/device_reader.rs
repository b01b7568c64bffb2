use std::io::Read;
use std::vec;

use crate::clock::LastTime;
use crate::error::{BadContent, Fault, TraceError, quote};
use crate::line_parser::{Line, LineParser};
use crate::lines::{LineFault, Lines};
use crate::metadata::Metadata;
use crate::reader::{A_HEADER, called, placed};
use crate::row::{ReadingKind, Row};

/// Largest number of lines that a device may print before its header; a boot loader prints a few dozen.
const LONGEST_PREAMBLE: usize = 100;

/// Reads the output of a device, row by row. It continues after lines that are not part of a trace, and when the device restarts.
/// [`LineParser`] classifies the lines.
///
/// The iterator yields errors of lines, and the rows between them. An error of the source itself ends it.
///
/// ```
/// use ohmstrain_bench_data::{DeviceReader, DeviceRow, Metadata};
/// let said = "boot: 0x13\ntime_s,resistance_ohm\n90.0,1600\n90.1,16\"0\ntime_s,resistance_ohm\n0.0,1601\n0.1,1602\n";
/// let rows: Vec<_> = DeviceReader::new(said.as_bytes(), "-", &Metadata::default())?.collect();
/// assert_eq!(rows.iter().map(Result::is_ok).collect::<Vec<_>>(), [false, true, false, true, true]);
/// assert!(matches!(rows[3], Ok(DeviceRow { row, restarted: true }) if row.time_s == 0.0 && row.line == 6));
/// # Ok::<(), ohmstrain_bench_data::TraceError>(())
/// ```
pub struct DeviceReader<R> {
    file: String,
    lines: Lines<R>,
    parser: LineParser,
    /// Lines above the header that are not part of a trace.
    skipped: vec::IntoIter<BadContent>,
    has_rows: bool,
    /// Last time of the previous stream, from which the first row continues.
    from: Option<LastTime>,
    /// True if a header has followed rows.
    restarted: bool,
    done: bool,
}

/// A row of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceRow {
    /// The row.
    pub row: Row,
    /// True if the device has restarted, so that the row's time is on another clock than that of the row before.
    pub restarted: bool,
}

impl<R: Read> DeviceReader<R> {
    /// Waits for a header, through at most a hundred other lines. `name` is the source's name in messages, `overrides` replaces its
    /// metadata.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails, or no header arrives.
    pub fn new(source: R, name: &str, overrides: &Metadata) -> Result<Self, TraceError> {
        let mut reader = Self::before_header(source, name, overrides);
        let mut skipped = Vec::new();
        while reader.parser.reading_kind().is_none() {
            match reader.next_line() {
                Some(Err(TraceError::Content(fault))) if skipped.len() + 1 < LONGEST_PREAMBLE => skipped.push(fault),
                Some(line) => drop(line?),
                None => {
                    let nothing = || Fault::new(A_HEADER, "the end of the file").at(&reader.file, reader.line().max(1));
                    return Err(skipped.into_iter().next().unwrap_or_else(nothing).into());
                }
            }
        }
        Ok(Self { skipped: skipped.into_iter(), ..reader })
    }

    /// Reads a source without a header, or one that is joined after its header: `header` names the columns, and the first line may be a
    /// row.
    ///
    /// # Errors
    /// [`TraceError`] if these are not the columns of a trace.
    pub fn headless(source: R, name: &str, header: &str, overrides: &Metadata) -> Result<Self, TraceError> {
        let mut reader = Self::before_header(source, name, overrides);
        match reader.parser.take_numbered(header, 0) {
            Ok(Line::Header) => Ok(reader),
            Ok(_) => Err(Fault::new(A_HEADER, quote(header)).at(&reader.file, 0).into()),
            Err(fault) => Err(fault.at(&reader.file, 0).into()),
        }
    }

    fn before_header(source: R, name: &str, overrides: &Metadata) -> Self {
        let (file, lines) = (called(name), Lines::new(source));
        let parser = LineParser::new(&file, overrides.clone());
        let skipped = Vec::new().into_iter();
        Self { file, lines, parser, skipped, has_rows: false, from: None, restarted: false, done: false }
    }

    /// Returns the name of the source in messages.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns the physical line read last, counted from 1; 0 before the first.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.lines.number()
    }

    /// Returns the kind of the readings since the last header.
    #[must_use]
    pub fn reading_kind(&self) -> ReadingKind {
        self.parser.reading_kind().unwrap_or(ReadingKind::Ohm)
    }

    /// True if rows since the last header have temperatures.
    #[must_use]
    pub fn has_temperature(&self) -> bool {
        self.parser.has_temperature()
    }

    /// Returns the source's metadata above the last header, with the overrides.
    #[must_use]
    pub fn metadata(&self) -> Metadata {
        self.parser.metadata()
    }

    /// Returns the time of the last row, as in the source.
    #[must_use]
    pub fn last_time(&self) -> Option<LastTime> {
        self.parser.last_time()
    }

    /// Continues from the last time of a previous stream: the first row must be later, and a counter may have wrapped. Returns `false` if
    /// that stream used another unit of time.
    pub fn go_on(&mut self, from: LastTime) -> bool {
        self.from = Some(from);
        self.parser.go_on(from)
    }

    /// Reads the next line; `None` at the end of the source.
    fn next_line(&mut self) -> Option<Result<Line, TraceError>> {
        let line = match self.lines.next() {
            Ok(line) => Ok(line?.to_owned()),
            Err(fault) => Err(fault),
        };
        let number = self.lines.number();
        let taken = line.and_then(|line| self.parser.take_numbered(&line, number).map_err(LineFault::Content));
        Some(taken.map_err(|fault| placed(fault, &self.file, number)))
    }

    fn next_row(&mut self) -> Option<Result<DeviceRow, TraceError>> {
        loop {
            match self.next_line()? {
                Ok(Line::Row(row)) => {
                    return Some(Ok(DeviceRow { row, restarted: std::mem::take(&mut self.restarted) }));
                }
                Ok(Line::Restarted(row)) => return Some(Ok(DeviceRow { row, restarted: true })),
                // A header that is printed twice before the first row does not restart the clock.
                Ok(Line::Header) => {
                    self.restarted = self.has_rows || self.from.is_some_and(|from| !self.parser.go_on(from));
                }
                Ok(Line::Nothing) => {}
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

impl<R: Read> Iterator for DeviceReader<R> {
    type Item = Result<DeviceRow, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.done {
            return None;
        }
        if let Some(skipped) = self.skipped.next() {
            return Some(Err(skipped.into()));
        }
        let row = self.next_row();
        self.has_rows |= matches!(row, Some(Ok(_)));
        self.done = !matches!(row, Some(Ok(_) | Err(TraceError::Content(_))));
        row
    }
}

impl<R: Read> std::iter::FusedIterator for DeviceReader<R> {}
