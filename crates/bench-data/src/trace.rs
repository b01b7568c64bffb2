use std::io::Read;
use std::ops::Range;

use crate::columns::Column;
use crate::error::{Fault, TraceError};
use crate::metadata::Metadata;
use crate::reader::TraceReader;
use crate::row::{ReadingKind, ReferenceQuantity, Row};

/// Largest number of rows in a recording in memory, or in an imported file: nine hours at 1 kHz. Reading row by row has no such bound.
pub const MOST_ROWS: usize = 1 << 25;

/// The sensor's readings, one per row.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// Kind of the readings.
    pub kind: ReadingKind,
    /// The values; NaN is a missing one.
    pub values: Vec<f64>,
    /// Further data of readings that came from a converter.
    pub converter: Option<ConverterReadings>,
}

impl Readings {
    /// Returns the column in which they are written.
    pub(crate) const fn column(&self) -> Column {
        match (&self.converter, self.kind) {
            (Some(_), _) => Column::Adc,
            (None, ReadingKind::Ohm) => Column::ResistanceOhm,
            (None, ReadingKind::Ratio) => Column::ResistanceRatio,
        }
    }

    /// Returns a reading as written: the code of a converter, or the value.
    pub(crate) fn written(&self, row: usize) -> f64 {
        match &self.converter {
            Some(converter) => converter.codes[row].map_or(f64::NAN, f64::from),
            None => self.values[row],
        }
    }
}

/// Data of a converter's readings beyond the resistance, one entry per row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConverterReadings {
    /// The codes; `None` is a missing one.
    pub codes: Vec<Option<u32>>,
    /// Standard deviation of the reading, Ω; NaN where the reading is missing.
    pub sd_ohm: Vec<f64>,
    /// True if the code was at an end of the scale; the reading is then missing.
    pub saturated: Vec<bool>,
}

/// Reference for judging the sensor, one value per row.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Quantity of the values.
    pub quantity: ReferenceQuantity,
    /// The values; NaN is a missing one.
    pub values: Vec<f64>,
    /// Standard deviations of the values that are not missing; empty if they are exact.
    pub sd: Vec<f64>,
}

/// A recording: readings over time, with an optional reference. All vectors have the same length.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Metadata of the recording.
    pub metadata: Metadata,
    /// Times on the recording's own clock, s, strictly increasing.
    pub time_s: Vec<f64>,
    /// The sensor.
    pub readings: Readings,
    /// The truth, if it was recorded.
    pub reference: Option<Reference>,
    /// Temperatures, °C, if they were recorded; NaN is a missing one.
    pub temperature_c: Option<Vec<f64>>,
}

impl Trace {
    /// Reads a whole recording. `name` is the source's name in messages.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails, or is not a trace with at least one row.
    pub fn read(source: impl Read, name: &str) -> Result<Self, TraceError> {
        Self::collect(TraceReader::new(source, name)?)
    }

    /// Reads the remaining rows of `rows`.
    ///
    /// # Errors
    /// The first error of `rows`, or [`TraceError::Content`] if there is no row.
    pub fn collect<R: Read>(mut rows: TraceReader<R>) -> Result<Self, TraceError> {
        let mut trace = Self::empty(&rows);
        for row in rows.by_ref() {
            let row = row?;
            if trace.len() == MOST_ROWS {
                let expected = format!("a recording of at most {MOST_ROWS} rows: make several files of it");
                return Err(Fault::new(expected, "more").at(rows.file(), row.line).into());
            }
            trace.push(&row);
        }
        if trace.is_empty() {
            let fault = Fault::new("at least one row of data", "the end of the file");
            return Err(fault.at(rows.file(), rows.line() + 1).into());
        }
        Ok(trace)
    }

    fn empty<R: Read>(rows: &TraceReader<R>) -> Self {
        Self {
            metadata: rows.metadata().clone(),
            time_s: Vec::new(),
            readings: Readings {
                kind: rows.reading_kind(),
                values: Vec::new(),
                converter: rows.has_codes().then(ConverterReadings::default),
            },
            reference: rows.reference_quantity().map(|quantity| Reference {
                quantity,
                values: Vec::new(),
                sd: Vec::new(),
            }),
            temperature_c: rows.has_temperature().then(Vec::new),
        }
    }

    fn push(&mut self, row: &Row) {
        self.time_s.push(row.time_s);
        self.readings.values.push(row.reading.value);
        if let Some(converter) = &mut self.readings.converter {
            converter.codes.push(row.reading.code);
            converter.sd_ohm.push(row.reading.sd_ohm.unwrap_or(f64::NAN));
            converter.saturated.push(row.reading.saturated);
        }
        if let Some(reference) = &mut self.reference {
            reference.values.push(row.reference);
            if row.reference_sd.is_finite() || !reference.sd.is_empty() {
                reference.sd.resize(reference.values.len() - 1, f64::NAN);
                reference.sd.push(row.reference_sd);
            }
        }
        if let Some(temperature) = &mut self.temperature_c {
            temperature.push(row.temperature_c);
        }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// True if there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns some of the rows; rows beyond the last one are ignored.
    #[must_use]
    pub fn rows(&self, range: Range<usize>) -> Self {
        self.picked(range.start..range.end.min(self.len()))
    }

    /// Returns rows in this order.
    pub(crate) fn picked(&self, rows: impl ExactSizeIterator<Item = usize> + Clone) -> Self {
        // Deviations of an exact reference are empty.
        fn some<T: Clone>(values: &[T], rows: impl ExactSizeIterator<Item = usize>) -> Vec<T> {
            if values.is_empty() { Vec::new() } else { rows.map(|row| values[row].clone()).collect() }
        }
        let numbers = |values: &Vec<f64>| some(values, rows.clone());
        Self {
            metadata: self.metadata.clone(),
            time_s: numbers(&self.time_s),
            readings: Readings {
                kind: self.readings.kind,
                values: numbers(&self.readings.values),
                converter: self.readings.converter.as_ref().map(|converter| ConverterReadings {
                    codes: some(&converter.codes, rows.clone()),
                    sd_ohm: numbers(&converter.sd_ohm),
                    saturated: some(&converter.saturated, rows.clone()),
                }),
            },
            reference: self.reference.as_ref().map(|reference| Reference {
                quantity: reference.quantity,
                values: numbers(&reference.values),
                sd: numbers(&reference.sd),
            }),
            temperature_c: self.temperature_c.as_ref().map(numbers),
        }
    }
}
