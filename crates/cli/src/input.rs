use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::ops::Range;
use std::path::Path;

use ohmstrain::number::significant;
use ohmstrain::{JointParams, Quantity, Reading, ReadingUnit};
use ohmstrain_bench_data::{Metadata, ParquetText, Reading as TraceReading, ReadingKind, Trace, TraceReader};
use ohmstrain_calib::Samples;
use sha2::{Digest, Sha256};

use crate::error::CliError;
use crate::sensor_file;
use crate::whole_file::is_stdin;

/// Bytes of a file that is not kept in memory as a whole.
const READ_AT_ONCE: usize = 1 << 16;

/// A recording in memory.
pub struct TraceFile {
    /// Name in messages.
    pub name: String,
    /// Name of its header in messages: file and line.
    pub header: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Rows of the file before the first one here.
    pub first_row: usize,
    /// Its contents.
    pub trace: Trace,
    /// Standard deviations of the reference; empty if it is exact.
    pub reference_sd: Vec<f64>,
}

/// Opens a recording for reading row by row; `-` is stdin.
pub fn open(path: &Path, overrides: &Metadata) -> Result<TraceReader<Box<dyn Read>>, CliError> {
    let (text, metadata) = text_of(path, overrides)?;
    Ok(TraceReader::with_overrides(text, &path.display().to_string(), &metadata)?)
}

/// The text of a recording, of a Parquet file the CSV that it stands for, and what is known of it besides.
pub fn text_of(path: &Path, overrides: &Metadata) -> Result<(Box<dyn Read>, Metadata), CliError> {
    if is_stdin(path) {
        let mut stdin = io::stdin().lock();
        // Waits for the first bytes, and leaves them where they are.
        if let Ok(first) = stdin.fill_buf() {
            refuse_parameters(path, first)?;
        }
        return Ok((Box::new(stdin), overrides.clone()));
    }
    let unreadable = |error| CliError::file("read", path, &error);
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let first = file.fill_buf().map_err(unreadable)?;
    if ParquetText::is_one(first) {
        return text_of_parquet(path, overrides);
    }
    refuse_parameters(path, first)?;
    Ok((Box::new(file), overrides.clone()))
}

fn text_of_parquet(path: &Path, overrides: &Metadata) -> Result<(Box<dyn Read>, Metadata), CliError> {
    let unreadable = |error| CliError::Input(format!("{}: {error}", path.display()));
    let file = File::open(path).map_err(|error| CliError::file("read", path, &error))?;
    let text = ParquetText::new(file).map_err(unreadable)?;
    let mut metadata = text.metadata().clone();
    metadata.override_with(overrides);
    Ok((Box::new(text), metadata))
}

/// Reads a whole recording, of as many rows as there may be.
pub fn read(path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    if is_stdin(path) {
        return of_text(&mut io::stdin().lock(), path, overrides);
    }
    let unreadable = |error| CliError::file("read", path, &error);
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    if ParquetText::is_one(file.fill_buf().map_err(unreadable)?) {
        let sha256 = sha256_of(path).map_err(unreadable)?;
        let (text, metadata) = text_of_parquet(path, overrides)?;
        return collect(TraceReader::with_overrides(text, &path.display().to_string(), &metadata)?, sha256);
    }
    of_text(&mut file, path, overrides)
}

/// A whole recording of these bytes.
pub fn parse(mut bytes: &[u8], path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    of_text(&mut bytes, path, overrides)
}

fn of_text<R: BufRead>(source: &mut R, path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    refuse_parameters(path, source.fill_buf().map_err(|error| CliError::file("read", path, &error))?)?;
    let mut digest = Sha256::new();
    let hashed = Hashed { source, digest: &mut digest };
    let rows = TraceReader::with_overrides(hashed, &path.display().to_string(), overrides)?;
    let file = collect(rows, String::new())?;
    Ok(TraceFile { sha256: hexadecimal(&digest.finalize()), ..file })
}

fn collect<R: Read>(rows: TraceReader<R>, sha256: String) -> Result<TraceFile, CliError> {
    let (name, header) = (rows.file().to_string(), header(rows.file(), rows.line()));
    Ok(TraceFile { name, header, sha256, first_row: 0, trace: Trace::collect(rows)?, reference_sd: Vec::new() })
}

/// A source whose bytes are hashed as they are read.
struct Hashed<'a, R> {
    source: &'a mut R,
    digest: &'a mut Sha256,
}

impl<R: Read> Read for Hashed<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(out)?;
        self.digest.update(&out[..count]);
        Ok(count)
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of a file's bytes, hexadecimal. A device may have no end, and a pipe can be read once.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("expected a file, found a device, a pipe or a folder"));
    }
    let (mut file, mut digest, mut bytes) = (File::open(path)?, Sha256::new(), vec![0; READ_AT_ONCE]);
    loop {
        match file.read(&mut bytes)? {
            0 => return Ok(hexadecimal(&digest.finalize())),
            count => digest.update(&bytes[..count]),
        }
    }
}

/// Refuses a sensor's file, or a hand's, by its first bytes.
fn refuse_parameters(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    if !sensor_file::is_one(bytes) {
        return Ok(());
    }
    let what = if sensor_file::is_hand(&String::from_utf8_lossy(bytes)) {
        sensor_file::A_HAND
    } else {
        "is a sensor file, not a recording: give it to --sensor, and the recording here"
    };
    Err(CliError::Input(format!("{} {what}", path.display())))
}

/// Returns the name, in messages, of the header of a recording of which no row has been read yet.
pub fn header(file: &str, line: u64) -> String {
    if line == 0 { file.to_owned() } else { format!("{file}:{line}") }
}

impl TraceFile {
    /// Returns some of its rows, under the same name.
    pub fn rows(&self, rows: Range<usize>) -> Self {
        let (name, header, sha256) = (self.name.clone(), self.header.clone(), self.sha256.clone());
        let reference_sd = self.reference_sd.get(rows.clone()).unwrap_or_default().to_vec();
        Self {
            name,
            header,
            sha256,
            first_row: self.first_row + rows.start,
            trace: self.trace.rows(rows),
            reference_sd,
        }
    }

    /// Returns the error that no row lies between these times.
    pub fn no_rows(&self, from_s: Option<f64>, until_s: Option<f64>) -> CliError {
        let times = &self.trace.time_s;
        let (first, last) = (times.first().copied().unwrap_or(f64::NAN), times.last().copied().unwrap_or(f64::NAN));
        let from = from_s.map(|from_s| format!("--from {from_s}"));
        let until = until_s.map(|until_s| format!("--until {until_s}"));
        let flags: Vec<String> = from.into_iter().chain(until).collect();
        CliError::Input(format!(
            "{}: no row is left by {}; the recording goes from {} to {} s",
            self.name,
            flags.join(" "),
            significant(first, 6),
            significant(last, 6)
        ))
    }

    /// Returns it in the form that calibration takes.
    pub fn samples(&self) -> Result<Samples<'_>, CliError> {
        let Some(reference) = &self.trace.reference else {
            return Err(CliError::Input(format!(
                "{}: column `strain`: expected a reference (strain, displacement_mm or angle_deg), found none",
                self.header
            )));
        };
        let samples = Samples::new(&self.trace.time_s, &self.trace.readings.values, &reference.values);
        let samples = match &self.reference_sd[..] {
            [] => samples,
            sd => samples.and_then(|samples| samples.with_strain_sd(sd)),
        };
        samples.map_err(|error| CliError::Input(format!("{}: data {error}", self.name)))
    }

    /// Time, s, and reading of a row.
    pub fn reading(&self, row: usize) -> (f64, Reading) {
        let (time_s, value) = (self.trace.time_s[row], self.trace.readings.values[row]);
        let converter = self.trace.readings.converter.as_ref();
        let sd = converter.and_then(|converter| converter.sd_ohm.get(row).copied()).unwrap_or(0.0);
        let saturated = converter.is_some_and(|converter| converter.saturated.get(row).copied().unwrap_or(false));
        (time_s, Reading { value, sd, saturated })
    }

    /// The reference in a row; NaN where it is missing.
    pub fn truth(&self, row: usize) -> f64 {
        let value = self.trace.reference.as_ref().and_then(|reference| reference.values.get(row));
        value.copied().unwrap_or(f64::NAN)
    }

    /// Returns time, reading and reference in a row.
    pub fn known_row(&self, row: usize) -> (f64, Reading, f64) {
        let (time_s, reading) = self.reading(row);
        (time_s, reading, self.truth(row))
    }

    /// Returns the quantity of its reference.
    pub fn quantity(&self) -> Option<Quantity> {
        self.trace.reference.as_ref().map(|reference| match reference.quantity {
            ohmstrain_bench_data::ReferenceQuantity::Strain => Quantity::Strain,
            ohmstrain_bench_data::ReferenceQuantity::AngleDeg => Quantity::AngleDeg,
        })
    }

    /// Refuses a reference that measures another quantity than the sensor's.
    pub fn check_quantity(&self, expected: Quantity) -> Result<(), CliError> {
        match self.quantity() {
            Some(found) if found != expected => Err(CliError::Input(format!(
                "{}: column `{}`: expected a reference in `{}`, as the calibration has it, found `{}`",
                self.header,
                found.name(),
                expected.name(),
                found.name()
            ))),
            _ => Ok(()),
        }
    }

    /// The joint that its metadata describe.
    pub fn joint(&self) -> Option<JointParams> {
        joint(&self.trace.metadata)
    }
}

/// The joint that metadata describe.
pub fn joint(metadata: &Metadata) -> Option<JointParams> {
    metadata.joint.map(|joint| JointParams {
        prestrain: joint.prestrain,
        moment_arm_mm: joint.moment_arm_mm,
        gauge_length_mm: joint.gauge_length_mm,
    })
}

/// A reading of a trace as the library takes it.
pub fn reading(reading: &TraceReading) -> Reading {
    Reading { value: reading.value, sd: reading.sd_ohm.unwrap_or(0.0), saturated: reading.saturated }
}

/// Unit of the readings.
pub fn unit(kind: ReadingKind) -> ReadingUnit {
    match kind {
        ReadingKind::Ohm => ReadingUnit::Ohm,
        ReadingKind::Ratio => ReadingUnit::Ratio,
    }
}

/// The column that readings of a unit stand in.
pub const fn reading_column(unit: ReadingUnit) -> &'static str {
    match unit {
        ReadingUnit::Ohm => "resistance_ohm",
        ReadingUnit::Ratio => "resistance_ratio",
    }
}

/// Refuses readings in another unit than the sensor's.
pub fn check_unit(header: &str, found: ReadingKind, expected: ReadingUnit) -> Result<(), CliError> {
    let found = unit(found);
    if found == expected {
        return Ok(());
    }
    Err(CliError::Input(format!(
        "{header}: column `{}`: expected `{}` as in the sensor's calibration, found `{}`",
        reading_column(found),
        reading_column(expected),
        reading_column(found)
    )))
}
