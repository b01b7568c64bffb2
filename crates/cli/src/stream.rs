//! Rows as they arrive: of a recording, or with `--skip-bad` of a device that also prints other lines and may restart.

use std::io::Read;

use ohmstrain::{Sensor, Thermometer};
use ohmstrain_bench_data::{DeviceReader, DeviceRow, LastTime, Metadata, ReadingKind, TraceError, TraceReader};

use crate::args::FilterArgs;
use crate::error::CliError;
use crate::input;

type Source = Box<dyn Read>;

/// Rows of a recording or of a device.
pub struct RowSource {
    rows: Rows,
    /// Conversion of readings, once the sensor is known.
    thermometer: Option<Thermometer>,
}

enum Rows {
    Recording(Box<TraceReader<Source>>),
    Device(Box<DeviceReader<Source>>),
}

/// Opens the input of `filter`.
pub fn open(args: &FilterArgs) -> Result<RowSource, CliError> {
    let (text, metadata) = input::text_of(&args.trace_file, &args.setup.metadata(&args.estimate.units))?;
    let name = args.trace_file.display().to_string();
    let recording = |reader| Rows::Recording(Box::new(reader));
    let device = |reader| Rows::Device(Box::new(reader));
    let rows = match (&args.header, args.skip_bad) {
        (None, false) => recording(TraceReader::with_overrides(text, &name, &metadata)?),
        (None, true) => DeviceReader::new(text, &name, &metadata).map(device).map_err(without_header)?,
        (Some(header), false) => {
            TraceReader::headless(text, &name, header, &metadata).map(recording).map_err(of_header_flag)?
        }
        (Some(header), true) => {
            DeviceReader::headless(text, &name, header, &metadata).map(device).map_err(of_header_flag)?
        }
    };
    Ok(RowSource { rows, thermometer: None })
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
    /// Converts all further readings to the reference temperature of a sensor; `last_c` is the last temperature of the stream that this one
    /// continues.
    pub fn convert_for(&mut self, sensor: &Sensor, last_c: Option<f64>) {
        self.thermometer = Some(Thermometer::new(sensor).after(last_c));
    }

    /// Returns the last temperature, °C.
    pub fn last_temperature_c(&self) -> Option<f64> {
        self.thermometer.and_then(|thermometer| thermometer.last_c())
    }

    /// Returns the number of implausible temperatures so far.
    pub fn implausible_temperatures(&self) -> usize {
        self.thermometer.map_or(0, |thermometer| thermometer.implausible())
    }

    /// True if the rows have temperatures.
    pub fn has_temperature(&self) -> bool {
        match &self.rows {
            Rows::Recording(rows) => rows.has_temperature(),
            Rows::Device(rows) => rows.has_temperature(),
        }
    }

    /// Returns the name of the source in messages.
    pub fn file(&self) -> &str {
        match &self.rows {
            Rows::Recording(rows) => rows.file(),
            Rows::Device(rows) => rows.file(),
        }
    }

    /// Returns the number of the physical line read last, counted from 1.
    pub fn line(&self) -> u64 {
        match &self.rows {
            Rows::Recording(rows) => rows.line(),
            Rows::Device(rows) => rows.line(),
        }
    }

    /// Returns the time of the last row, as it was written.
    pub fn last_time(&self) -> Option<LastTime> {
        match &self.rows {
            Rows::Recording(rows) => rows.last_time(),
            Rows::Device(rows) => rows.last_time(),
        }
    }

    /// Continues from the last time of the previous stream; returns `false` if that used another unit.
    pub fn go_on(&mut self, from: LastTime) -> bool {
        match &mut self.rows {
            Rows::Recording(rows) => rows.go_on(from),
            Rows::Device(rows) => rows.go_on(from),
        }
    }

    /// Returns the kind of the readings.
    pub fn reading_kind(&self) -> ReadingKind {
        match &self.rows {
            Rows::Recording(rows) => rows.reading_kind(),
            Rows::Device(rows) => rows.reading_kind(),
        }
    }

    /// Returns the metadata of the source.
    pub fn metadata(&self) -> Metadata {
        match &self.rows {
            Rows::Recording(rows) => rows.metadata().clone(),
            Rows::Device(rows) => rows.metadata(),
        }
    }
}

impl Iterator for RowSource {
    type Item = Result<DeviceRow, TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut row = match &mut self.rows {
            Rows::Recording(rows) => rows.next()?.map(|row| DeviceRow { row, restarted: false }),
            Rows::Device(rows) => rows.next()?,
        };
        if let (Ok(DeviceRow { row, .. }), Some(thermometer)) = (&mut row, &mut self.thermometer) {
            row.reading.value = thermometer.at_reference(row.reading.value, row.temperature_c);
        }
        Some(row)
    }
}
