use std::io::Read;

use csv::StringRecord;
use ohmstrain_model::{AdcCode, FrontEnd, Joint};

use crate::cell;
use crate::clock::Clock;
use crate::columns::{Column, Columns, Place};
use crate::error::{Fault, TraceError};
use crate::lines::{LineFault, LineFeed, Lines, is_plain};
use crate::metadata::{Metadata, ResistanceUnit, StrainUnit};
use crate::trace::{Quantity, ReadingKind};

/// One reading. NaN is a missing one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Ω or R/R₀, as [`TraceReader::reading_kind`] says; NaN if missing or saturated.
    pub value: f64,
    /// Standard deviation that the front end gives the reading, Ω; known for converter codes only.
    pub sd_ohm: Option<f64>,
    /// The converter's code, if the file has codes and this one is not missing.
    pub code: Option<u32>,
    /// The converter stood at an end of its scale.
    pub saturated: bool,
}

/// One row of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Physical line in the file, counted from 1.
    pub line: u64,
    /// Time on the file's clock, s.
    pub time_s: f64,
    /// The sensor.
    pub reading: Reading,
    /// The reference, as [`TraceReader::reference_quantity`] says; NaN if missing.
    pub reference: f64,
    /// Temperature, °C; NaN if missing.
    pub temperature_c: f64,
}

/// Reads a trace row by row, in constant memory.
///
/// Metadata and header are read at construction; each row is delivered as soon as its line is complete. After an error
/// the iterator ends.
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
    columns: Columns,
    conversion: Conversion,
    clock: Clock,
    records: csv::Reader<LineFeed<R>>,
    record: StringRecord,
    /// Every line up to now was plain; after the first that was not, the csv crate reads them all.
    plain: bool,
    done: bool,
}

/// What turns cells into readings and references.
struct Conversion {
    front_end: Option<FrontEnd<f64>>,
    joint: Option<Joint<f64>>,
    gauge_length_mm: f64,
    /// What a strain and a resistance in the file are multiplied with.
    strain_factor: f64,
    ohm_factor: f64,
}

impl<R: Read> TraceReader<R> {
    /// Reads metadata and header. `name` is what messages call the source; `-` becomes `stdin`.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails or does not start like a trace.
    pub fn new(source: R, name: &str) -> Result<Self, TraceError> {
        Self::with_overrides(source, name, &Metadata::default())
    }

    /// As [`new`](Self::new), where what `overrides` knows takes the place of what the file says.
    ///
    /// # Errors
    /// [`TraceError`] if the source fails or does not start like a trace.
    pub fn with_overrides(source: R, name: &str, overrides: &Metadata) -> Result<Self, TraceError> {
        let file = if name == "-" { "stdin" } else { name }.to_owned();
        let mut lines = Lines::new(source);
        let (mut metadata, header) = read_prelude(&mut lines).map_err(|fault| placed(fault, &file, lines.number()))?;
        metadata.override_with(overrides);
        let plain = is_plain(&header);
        let mut records =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(LineFeed::new(lines, &header));
        let mut record = StringRecord::new();
        records.read_record(&mut record).map_err(|error| feed_error(error, &mut records, &file))?;
        let at_header = |fault: Fault| TraceError::from(fault.at(&file, records.get_ref().line()));
        let columns = Columns::of_header(&record).map_err(at_header)?;
        let conversion = Conversion::new(&columns, &metadata).map_err(at_header)?;
        let clock = Clock::new(columns.time.column);
        let metadata = metadata.in_own_units();
        Ok(Self { file, metadata, columns, conversion, clock, records, record, plain, done: false })
    }

    /// Name of the source, as messages call it.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// What the file, or who overrode it, says about the recording.
    #[must_use]
    pub const fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// What the readings are.
    #[must_use]
    pub fn reading_kind(&self) -> ReadingKind {
        if self.columns.reading.column == Column::ResistanceRatio { ReadingKind::Ratio } else { ReadingKind::Ohm }
    }

    /// Whether the readings are converter codes, so that each carries its own standard deviation.
    #[must_use]
    pub fn has_codes(&self) -> bool {
        self.columns.reading.column == Column::Adc
    }

    /// What the reference is, if there is one. A displacement becomes strain, and so does an angle with a joint.
    #[must_use]
    pub fn reference_quantity(&self) -> Option<Quantity> {
        let is_angle = self.columns.reference?.column == Column::AngleDeg && self.conversion.joint.is_none();
        Some(if is_angle { Quantity::AngleDeg } else { Quantity::Strain })
    }

    /// Whether the file has temperatures.
    #[must_use]
    pub const fn has_temperature(&self) -> bool {
        self.columns.temperature.is_some()
    }

    /// Physical line read last, counted from 1.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.records.get_ref().line()
    }

    fn next_row(&mut self) -> Result<Option<Row>, TraceError> {
        if !self.next_record()? {
            return Ok(None);
        }
        self.parse_row().map(Some).map_err(|fault| fault.at(&self.file, self.line()).into())
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

    fn parse_row(&mut self) -> Result<Row, Fault> {
        let record = &self.record;
        if record.len() != self.columns.width {
            let expected = format!("{} cells, as in the header", self.columns.width);
            return Err(Fault::new(expected, format!("{}", record.len())));
        }
        let temperature = self.columns.temperature.as_ref();
        Ok(Row {
            line: self.records.get_ref().line(),
            time_s: self.clock.read(self.columns.time.cell(record))?,
            reading: self.conversion.reading(&self.columns.reading, record)?,
            reference: match &self.columns.reference {
                Some(place) => self.conversion.reference(place, record)?,
                None => f64::NAN,
            },
            temperature_c: match temperature {
                Some(place) => cell::number(place.column.name(), place.cell(record))?,
                None => f64::NAN,
            },
        })
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

impl Conversion {
    fn new(columns: &Columns, metadata: &Metadata) -> Result<Self, Fault> {
        let impossible = |error: ohmstrain_model::ParameterError| Fault::new("possible metadata", error.to_string());
        let needs = |column: Column, key: &str| {
            Fault::in_column(column.name(), format!("a line `# {key} = …` above the header"), "none")
        };
        if columns.reading.column == Column::Adc && metadata.front_end.is_none() {
            return Err(needs(Column::Adc, "front_end"));
        }
        let is_displacement = columns.reference.is_some_and(|place| place.column == Column::DisplacementMm);
        if is_displacement && metadata.gauge_length_mm.is_none() {
            return Err(needs(Column::DisplacementMm, "gauge_length_mm"));
        }
        Ok(Self {
            front_end: metadata.front_end.map(|spec| spec.build()).transpose().map_err(impossible)?,
            joint: metadata.joint.map(|spec| spec.build()).transpose().map_err(impossible)?,
            gauge_length_mm: metadata.gauge_length_mm.unwrap_or(f64::NAN),
            strain_factor: metadata.strain_unit.map_or(1.0, StrainUnit::factor),
            ohm_factor: metadata.resistance_unit.map_or(1.0, ResistanceUnit::factor),
        })
    }

    fn reading(&self, place: &Place, record: &StringRecord) -> Result<Reading, Fault> {
        let cell = place.cell(record);
        let missing = Reading { value: f64::NAN, sd_ohm: None, code: None, saturated: false };
        let (Column::Adc, Some(front_end)) = (place.column, &self.front_end) else {
            let factor = if place.column == Column::ResistanceOhm { self.ohm_factor } else { 1.0 };
            return Ok(Reading { value: factor * cell::positive(place.column.name(), cell)?, ..missing });
        };
        let code = cell::code(place.column.name(), cell)?;
        Ok(match code.map(|code| front_end.read(code)) {
            None => missing,
            Some(AdcCode::Saturated) => Reading { code, saturated: true, ..missing },
            Some(AdcCode::Reading(ohms)) => {
                Reading { value: ohms.resistance_ohm, sd_ohm: Some(ohms.sd_ohm), code, saturated: false }
            }
        })
    }

    fn reference(&self, place: &Place, record: &StringRecord) -> Result<f64, Fault> {
        let value = cell::number(place.column.name(), place.cell(record))?;
        Ok(match (place.column, &self.joint) {
            (Column::DisplacementMm, _) => value / self.gauge_length_mm,
            (Column::Strain, _) => self.strain_factor * value,
            (Column::AngleDeg, Some(joint)) => joint.strain(value.to_radians()),
            _ => value,
        })
    }
}

/// Metadata lines, and the header line.
fn read_prelude<R: Read>(lines: &mut Lines<R>) -> Result<(Metadata, String), LineFault> {
    let mut metadata = Metadata::default();
    while let Some(line) = lines.next()? {
        if !line.starts_with('#') {
            return Ok((metadata, line.to_owned()));
        }
        metadata.take_line(line).map_err(LineFault::Content)?;
    }
    let found = if lines.number() == 0 { "an empty file" } else { "the end of the file" };
    Err(LineFault::Content(Fault::new("a header such as `time_s,resistance_ohm,strain`", found)))
}

/// An error of the csv crate is one of the lines that it was fed with.
fn feed_error<R: Read>(error: csv::Error, records: &mut csv::Reader<LineFeed<R>>, file: &str) -> TraceError {
    let fault = records.get_mut().take_fault().unwrap_or_else(|| LineFault::Io(error.into()));
    placed(fault, file, records.get_ref().line())
}

/// `line` was delivered last.
fn placed(fault: LineFault, file: &str, line: u64) -> TraceError {
    match fault {
        // An empty file has no line at all; what is missing, is missing on its first.
        LineFault::Content(fault) => fault.at(file, line.max(1)).into(),
        // The failure stands behind the last line that was delivered.
        LineFault::Io(source) => TraceError::Io { file: file.to_owned(), line: line + 1, source },
    }
}
