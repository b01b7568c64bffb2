//! Rows as they arrive: of a recording, or with `--skip-bad` of a device that also prints other lines and may restart.

use std::io::Read;

use ohmstrain_bench_data::{DeviceReader, DeviceRow, LastTime, Metadata, ReadingKind, TraceError, TraceReader};

use crate::args::FilterArgs;
use crate::error::CliError;
use crate::input;

type Source = Box<dyn Read>;

/// Rows of a recording or of a device.
pub enum RowSource {
    Recording(Box<TraceReader<Source>>),
    Device(Box<DeviceReader<Source>>),
}

/// Opens the input of `filter`.
pub fn open(args: &FilterArgs) -> Result<RowSource, CliError> {
    let (text, metadata) = input::text_of(&args.trace_file, &args.setup.metadata(&args.estimate.units))?;
    let name = args.trace_file.display().to_string();
    let recording = |reader| RowSource::Recording(Box::new(reader));
    let device = |reader| RowSource::Device(Box::new(reader));
    match (&args.header, args.skip_bad) {
        (None, false) => Ok(recording(TraceReader::with_overrides(text, &name, &metadata)?)),
        (None, true) => DeviceReader::new(text, &name, &metadata).map(device).map_err(without_header),
        (Some(header), false) => {
            TraceReader::headless(text, &name, header, &metadata).map(recording).map_err(of_header_flag)
        }
        (Some(header), true) => {
            DeviceReader::headless(text, &name, header, &metadata).map(device).map_err(of_header_flag)
        }
    }
}

/// Creates the error of a stream whose header did not arrive.
fn without_header(error: TraceError) -> CliError {
    match error {
        TraceError::Content(content) => {
            let hint = "a stream without a header, or joined after it, needs --header time_s,resistance_ohm";
            CliError::Input(format!("{content}; {hint}"))
        }
        error => error.into(),
    }
}

/// Creates the error of a `--header` that names none of the columns.
fn of_header_flag(error: TraceError) -> CliError {
    match error {
        TraceError::Content(content) => {
            CliError::Arguments(format!("--header: expected {}, found {}", content.expected, content.found))
        }
        error => error.into(),
    }
}

impl RowSource {
    /// Returns the name of the source in messages.
    pub fn file(&self) -> &str {
        match self {
            Self::Recording(rows) => rows.file(),
            Self::Device(rows) => rows.file(),
        }
    }

    /// Returns the number of the physical line read last, counted from 1.
    pub fn line(&self) -> u64 {
        match self {
            Self::Recording(rows) => rows.line(),
            Self::Device(rows) => rows.line(),
        }
    }

    /// Returns the time of the last row, as it was written.
    pub fn last_time(&self) -> Option<LastTime> {
        match self {
            Self::Recording(rows) => rows.last_time(),
            Self::Device(rows) => rows.last_time(),
        }
    }

    /// Continues from the last time of the previous stream; returns `false` if that used another unit.
    pub fn go_on(&mut self, from: LastTime) -> bool {
        match self {
            Self::Recording(rows) => rows.go_on(from),
            Self::Device(rows) => rows.go_on(from),
        }
    }

    /// Returns the kind of the readings.
    pub fn reading_kind(&self) -> ReadingKind {
        match self {
            Self::Recording(rows) => rows.reading_kind(),
            Self::Device(rows) => rows.reading_kind(),
        }
    }

    /// Returns the metadata of the source.
    pub fn metadata(&self) -> Metadata {
        match self {
            Self::Recording(rows) => rows.metadata().clone(),
            Self::Device(rows) => rows.metadata(),
        }
    }
}

impl Iterator for RowSource {
    type Item = Result<DeviceRow, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Recording(rows) => Some(rows.next()?.map(|row| DeviceRow { row, restarted: false })),
            Self::Device(rows) => rows.next(),
        }
    }
}
