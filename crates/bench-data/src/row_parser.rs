use csv::StringRecord;
use ohmstrain_model::{AdcCode, FrontEnd, Joint};

use crate::cell;
use crate::clock::{Clock, LastTime};
use crate::columns::{Column, ColumnPlace, Columns};
use crate::error::{Fault, quote};
use crate::metadata::{Metadata, ResistanceUnit, StrainUnit};
use crate::row::{Reading, ReadingKind, ReferenceQuantity, Row};

/// Converts the cells of a line to a row; keeps the time of the previous row.
#[derive(Clone, Copy)]
pub(crate) struct RowParser {
    columns: Columns,
    conversion: Conversion,
    clock: Clock,
}

/// Conversion of cells to readings and references.
#[derive(Clone, Copy)]
struct Conversion {
    front_end: Option<FrontEnd<f64>>,
    joint: Option<Joint<f64>>,
    gauge_length_mm: f64,
    /// Factors on strain and resistance in the file.
    strain_factor: f64,
    ohm_factor: f64,
}

impl RowParser {
    pub(crate) fn new(columns: Columns, metadata: &Metadata) -> Result<Self, Fault> {
        let conversion = Conversion::new(&columns, metadata)?;
        Ok(Self { columns, conversion, clock: Clock::new(columns.time.column) })
    }

    pub(crate) const fn clock(&mut self) -> &mut Clock {
        &mut self.clock
    }

    pub(crate) fn last_time(&self) -> Option<LastTime> {
        self.clock.last()
    }

    pub(crate) fn reading_kind(&self) -> ReadingKind {
        if self.columns.reading.column == Column::ResistanceRatio { ReadingKind::Ratio } else { ReadingKind::Ohm }
    }

    pub(crate) fn has_codes(&self) -> bool {
        self.columns.reading.column == Column::Adc
    }

    pub(crate) fn reference_quantity(&self) -> Option<ReferenceQuantity> {
        let is_angle = self.columns.reference?.column == Column::AngleDeg && self.conversion.joint.is_none();
        Some(if is_angle { ReferenceQuantity::AngleDeg } else { ReferenceQuantity::Strain })
    }

    pub(crate) const fn has_temperature(&self) -> bool {
        self.columns.temperature.is_some()
    }

    /// Returns the row of a line.
    pub(crate) fn row(&mut self, record: &StringRecord, line: u64) -> Result<Row, Fault> {
        if record.len() != self.columns.width {
            let expected = format!("{} cells, as in the header", self.columns.width);
            return Err(Fault::new(expected, format!("{}", record.len())));
        }
        let temperature = self.columns.temperature.as_ref();
        let (reference, reference_sd) = match &self.columns.reference {
            Some(place) => self.conversion.reference(place, self.columns.reference_sd.as_ref(), record)?,
            None => (f64::NAN, f64::NAN),
        };
        Ok(Row {
            line,
            reference,
            reference_sd,
            reading: self.conversion.reading(&self.columns.reading, record)?,
            temperature_c: match temperature {
                Some(place) => cell::number(place.column.name(), place.cell(record))?,
                None => f64::NAN,
            },
            // The clock comes last, so that a refused line leaves it unchanged.
            time_s: self.clock.read(self.columns.time.cell(record))?,
        })
    }
}

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

    fn reading(&self, place: &ColumnPlace, record: &StringRecord) -> Result<Reading, Fault> {
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

    /// Returns the reference, and its standard deviation if there is a column for it.
    fn reference(
        &self,
        place: &ColumnPlace,
        sd: Option<&ColumnPlace>,
        record: &StringRecord,
    ) -> Result<(f64, f64), Fault> {
        let value = cell::number(place.column.name(), place.cell(record))?;
        let converted = |value: f64| match (place.column, &self.joint) {
            (Column::DisplacementMm, _) => value / self.gauge_length_mm,
            (Column::Strain, _) => self.strain_factor * value,
            (Column::AngleDeg, Some(joint)) => joint.strain(value.to_radians()),
            _ => value,
        };
        let Some(sd) = sd.filter(|_| value.is_finite()) else { return Ok((converted(value), f64::NAN)) };
        let (name, text) = (sd.column.name(), sd.cell(record));
        let sd = cell::number(name, text)?;
        // A missing standard deviation is also refused.
        if !(sd > 0.0) {
            return Err(Fault::in_column(name, "a positive standard deviation beside a known reference", quote(text)));
        }
        let sd = match (place.column, &self.joint) {
            (Column::AngleDeg, Some(_)) => 0.5 * (converted(value + sd) - converted(value - sd)).abs(),
            (Column::Strain, _) => self.strain_factor * sd,
            _ => sd,
        };
        Ok((converted(value), sd))
    }
}
