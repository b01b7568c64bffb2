//! Recordings as traces: the rows of a trace CSV, with the name, the header and the hash of its file.

mod calibrate;
mod hand;
mod marks;
mod watched;

use std::borrow::Cow;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use ohmstrain_bench_data::{
    Metadata, Reading as TraceReading, ReadingKind, ReferenceQuantity, Trace, TraceError, TraceReader,
};
use ohmstrain_calib::{Samples, SamplesError, aligned};
use ohmstrain_sensor::{JointParams, Quantity, ReadingUnit};
use thiserror::Error;

pub use crate::column::reading_column;
use crate::number::significant;
use crate::{Error, Reading, Recording, Sensor};
pub use calibrate::{Refusal, calibrate, distrusted_rows, tested_on};
pub use hand::{HAND_FORMAT, HandChannel, HandDescription, HandError, HandJoint};
pub use marks::{Marked, take_marks};
pub use watched::{FIRST_LIVE_READINGS, LEAST_AT_REST, REST_S, WatchedFilter, restarted};

/// A recording in memory.
#[derive(Clone, Debug)]
pub struct TraceFile {
    /// Name in messages.
    pub name: String,
    /// Name of its header in messages: file and line.
    pub header: String,
    /// Name of the header of its reference: its own, or that of a file of marks.
    pub reference_header: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Number of rows of the file before the first one here.
    pub first_row: usize,
    /// Its contents.
    pub trace: Trace,
}

/// Reason why a trace does not suit a calibration or a sensor.
#[derive(Debug, Error)]
pub enum TraceFileError {
    /// It has no reference.
    #[error("{header}: column `strain`: expected a reference (strain, displacement_mm or angle_deg), found none")]
    NoReference {
        /// Name of its header.
        header: String,
    },
    /// A row is invalid.
    #[error("{name}: data {error}")]
    Samples {
        /// Its name.
        name: String,
        /// The row and what is wrong with it.
        error: SamplesError,
    },
    /// No row lies between the requested times.
    #[error("{name}: no row is left by {flags}; the recording goes from {first_s} to {last_s} s")]
    NoRows {
        /// Its name.
        name: String,
        /// Flags of the command line with these times.
        flags: String,
        /// Time of its first row, s, in six digits.
        first_s: String,
        /// Time of its last row, s, in six digits.
        last_s: String,
    },
    /// Readings are in another unit than the sensor's.
    #[error("{header}: column `{found}`: expected `{expected}` as in the sensor's calibration, found `{found}`")]
    Unit {
        /// Name of its header.
        header: String,
        /// Column of the sensor's readings.
        expected: &'static str,
        /// Its own.
        found: &'static str,
    },
    /// The reference is of another quantity.
    #[error(
        "{header}: column `{found}`: expected a reference in `{expected}`, as the calibration has it, found `{found}`"
    )]
    Quantity {
        /// Name of its header.
        header: String,
        /// The sensor's quantity.
        expected: &'static str,
        /// Its own.
        found: &'static str,
    },
}

impl TraceFile {
    /// Collects the rows of a reader.
    ///
    /// # Errors
    /// The first row that cannot be read.
    pub fn collect<R: Read>(rows: TraceReader<R>, sha256: String) -> Result<Self, TraceError> {
        let (name, header) = (rows.file().to_owned(), header(rows.file(), rows.line()));
        let reference_header = header.clone();
        Ok(Self { name, header, reference_header, sha256, first_row: 0, trace: Trace::collect(rows)? })
    }

    /// Returns some of its rows, under the same name.
    #[must_use]
    pub fn rows(&self, rows: Range<usize>) -> Self {
        Self {
            name: self.name.clone(),
            header: self.header.clone(),
            reference_header: self.reference_header.clone(),
            sha256: self.sha256.clone(),
            first_row: self.first_row + rows.start,
            trace: self.trace.rows(rows),
        }
    }

    /// Returns the rows with `from_s <= time_s < until_s`, as far as these are given.
    #[must_use]
    pub fn between(&self, from_s: Option<f64>, until_s: Option<f64>) -> Range<usize> {
        let row_at = |time_s: f64| self.trace.time_s.partition_point(|earlier_s| *earlier_s < time_s);
        let end = until_s.map_or(self.trace.len(), row_at);
        from_s.map_or(0, row_at).min(end)..end
    }

    /// Returns the error that no row lies between these times.
    #[must_use]
    pub fn no_rows(&self, from_s: Option<f64>, until_s: Option<f64>) -> TraceFileError {
        let from = from_s.map(|from_s| format!("--from {from_s}"));
        let until = until_s.map(|until_s| format!("--until {until_s}"));
        let time = |time_s: Option<&f64>| significant(time_s.copied().unwrap_or(f64::NAN), 6);
        TraceFileError::NoRows {
            name: self.name.clone(),
            flags: from.into_iter().chain(until).collect::<Vec<_>>().join(" "),
            first_s: time(self.trace.time_s.first()),
            last_s: time(self.trace.time_s.last()),
        }
    }

    /// Moves a reference that is late by `lag_s`; one that is on time stays as it is.
    ///
    /// # Errors
    /// If there is no reference, or a row is invalid.
    pub fn move_reference(&mut self, lag_s: f64) -> Result<(), TraceFileError> {
        let samples = self.samples()?;
        if lag_s == 0.0 {
            return Ok(());
        }
        let moved = aligned(&samples, lag_s);
        let (time_s, reading, sd) = (samples.time_s(), samples.reading(), self.reference_sd());
        let named = |error| TraceFileError::Samples { name: self.name.clone(), error };
        let of_sd = (!sd.is_empty()).then(|| Samples::new(time_s, reading, sd)).transpose().map_err(named)?;
        let sd = of_sd.map(|of_sd| aligned(&of_sd, lag_s)).unwrap_or_default();
        if let Some(reference) = &mut self.trace.reference {
            (reference.values, reference.sd) = (moved, sd);
        }
        Ok(())
    }

    /// Returns it in the form that calibration takes.
    ///
    /// # Errors
    /// If there is no reference, or a row is invalid.
    pub fn samples(&self) -> Result<Samples<'_>, TraceFileError> {
        let Some(reference) = &self.trace.reference else {
            return Err(TraceFileError::NoReference { header: self.header.clone() });
        };
        let samples = Samples::new(&self.trace.time_s, &self.trace.readings.values, &reference.values);
        let samples = match self.reference_sd() {
            [] => samples,
            sd => samples.and_then(|samples| samples.with_strain_sd(sd)),
        };
        samples.map_err(|error| TraceFileError::Samples { name: self.name.clone(), error })
    }

    /// Returns samples of it, with its file, units, clock and joint, as far as it contains them.
    fn recording<'a>(&'a self, samples: &Samples<'a>) -> Result<Recording<'a>, Error> {
        let metadata = &self.trace.metadata;
        let mut one = Recording::new(samples.time_s(), samples.reading(), samples.strain())?;
        one = if self.reference_sd().is_empty() { one } else { one.with_strain_sd(self.reference_sd())? };
        one = one.of_file(file_name(&self.name), &self.sha256);
        one = match &self.trace.temperature_c {
            Some(temperature_c) => one.at_temperatures_c(temperature_c)?,
            None => one,
        };
        one = if self.unit() == ReadingUnit::Ratio { one.of_ratios() } else { one };
        one = if self.quantity() == Some(Quantity::AngleDeg) { one.of_angles_deg() } else { one };
        let knows_ohm = metadata.resistance_unit.is_some() || self.trace.readings.converter.is_some();
        one = if metadata.strain_unit.is_some() { one.strain_unit_is_known() } else { one };
        one = if knows_ohm { one.resistance_unit_is_known() } else { one };
        let is_clock = |(key, value): &(String, String)| key == Metadata::TIME_UNIT && value == "s";
        one = if metadata.other.iter().any(is_clock) { one.clock_is_known() } else { one };
        Ok(self.joint().map_or(one, |joint| one.on_joint(joint)))
    }

    /// Returns time, s, and reading of a row.
    #[must_use]
    pub fn reading(&self, row: usize) -> (f64, Reading) {
        let (time_s, value) = (self.trace.time_s[row], self.trace.readings.values[row]);
        let converter = self.trace.readings.converter.as_ref();
        let sd = converter.and_then(|converter| converter.sd_ohm.get(row).copied()).unwrap_or(0.0);
        let saturated = converter.is_some_and(|converter| converter.saturated.get(row).copied().unwrap_or(false));
        (time_s, Reading { value, sd, saturated })
    }

    /// Returns it with readings at the reference temperature of a sensor; itself if there is nothing to convert.
    #[must_use]
    pub fn at_reference_temperature(&self, sensor: &Sensor) -> Cow<'_, Self> {
        let Some(temperature_c) = self.trace.temperature_c.as_ref().filter(|_| sensor.params().temperature.is_some())
        else {
            return Cow::Borrowed(self);
        };
        let mut converted = self.clone();
        converted.trace.readings.values = sensor.at_reference_temperature(&self.trace.readings.values, temperature_c);
        Cow::Owned(converted)
    }

    /// Returns the sensor to use for it: one with wider intervals if it has no temperatures.
    #[must_use]
    pub fn sensor_for(&self, sensor: &Sensor) -> Sensor {
        let sensor = sensor.clone();
        if self.trace.temperature_c.is_some() { sensor } else { sensor.without_temperature() }
    }

    /// Returns the reference in a row; NaN if it is missing.
    #[must_use]
    pub fn truth(&self, row: usize) -> f64 {
        let value = self.trace.reference.as_ref().and_then(|reference| reference.values.get(row));
        value.copied().unwrap_or(f64::NAN)
    }

    /// Returns time, s, reading and reference in a row.
    #[must_use]
    pub fn known_row(&self, row: usize) -> (f64, Reading, f64) {
        let (time_s, reading) = self.reading(row);
        (time_s, reading, self.truth(row))
    }

    /// Returns the standard deviations of the reference; empty if it is exact.
    fn reference_sd(&self) -> &[f64] {
        self.trace.reference.as_ref().map_or(&[], |reference| &reference.sd)
    }

    /// Returns the quantity of the reference.
    #[must_use]
    pub fn quantity(&self) -> Option<Quantity> {
        self.trace.reference.as_ref().map(|reference| match reference.quantity {
            ReferenceQuantity::Strain => Quantity::Strain,
            ReferenceQuantity::AngleDeg => Quantity::AngleDeg,
        })
    }

    /// Returns the unit of the readings.
    #[must_use]
    pub const fn unit(&self) -> ReadingUnit {
        unit(self.trace.readings.kind)
    }

    /// Returns the joint that its metadata describe.
    #[must_use]
    pub fn joint(&self) -> Option<JointParams> {
        joint(&self.trace.metadata)
    }

    /// Refuses readings in another unit than the sensor's.
    ///
    /// # Errors
    /// If they are.
    pub fn check_unit(&self, expected: ReadingUnit) -> Result<(), TraceFileError> {
        check_unit(&self.header, self.trace.readings.kind, expected)
    }

    /// Refuses a reference of another quantity than the sensor's.
    ///
    /// # Errors
    /// If it is.
    pub fn check_quantity(&self, expected: Quantity) -> Result<(), TraceFileError> {
        match self.quantity() {
            Some(found) if found != expected => Err(TraceFileError::Quantity {
                header: self.header.clone(),
                expected: expected.name(),
                found: found.name(),
            }),
            _ => Ok(()),
        }
    }
}

/// Refuses recordings that do not share unit and quantity with the first.
///
/// # Errors
/// The first one that does not.
pub fn check_alike(recordings: &[TraceFile]) -> Result<(), TraceFileError> {
    let Some(first) = recordings.first() else { return Ok(()) };
    let (quantity, reading) = (first.quantity().unwrap_or(Quantity::Strain), first.unit());
    for recording in recordings {
        recording.check_unit(reading)?;
        recording.check_quantity(quantity)?;
    }
    Ok(())
}

/// Returns the recordings of these samples, with their metadata.
///
/// # Errors
/// If a row is invalid.
pub fn known_recordings<'a>(recordings: &'a [TraceFile], samples: &[Samples<'a>]) -> Result<Vec<Recording<'a>>, Error> {
    recordings.iter().zip(samples).map(|(recording, samples)| recording.recording(samples)).collect()
}

/// Returns the name of a file without its path, which is private to the machine.
fn file_name(path: &str) -> &str {
    Path::new(path).file_name().and_then(|name| name.to_str()).unwrap_or(path)
}

/// Returns the name, in messages, of the header of a recording whose rows have not been read yet.
#[must_use]
pub fn header(file: &str, line: u64) -> String {
    if line == 0 { file.to_owned() } else { format!("{file}:{line}") }
}

/// Returns the joint that metadata describe.
#[must_use]
pub fn joint(metadata: &Metadata) -> Option<JointParams> {
    metadata.joint.map(|joint| JointParams {
        prestrain: joint.prestrain,
        moment_arm_mm: joint.moment_arm_mm,
        gauge_length_mm: joint.gauge_length_mm,
    })
}

/// Converts a reading of a trace to one for a filter.
#[must_use]
pub fn reading(reading: &TraceReading) -> Reading {
    Reading { value: reading.value, sd: reading.sd_ohm.unwrap_or(0.0), saturated: reading.saturated }
}

/// Returns the unit of readings.
const fn unit(kind: ReadingKind) -> ReadingUnit {
    match kind {
        ReadingKind::Ohm => ReadingUnit::Ohm,
        ReadingKind::Ratio => ReadingUnit::Ratio,
    }
}

/// Refuses readings in another unit than the sensor's.
///
/// # Errors
/// If they are.
pub fn check_unit(header: &str, found: ReadingKind, expected: ReadingUnit) -> Result<(), TraceFileError> {
    let found = unit(found);
    if found == expected {
        return Ok(());
    }
    let (expected, found) = (reading_column(expected), reading_column(found));
    Err(TraceFileError::Unit { header: header.to_owned(), expected, found })
}
