//! A recording as a calibration, a filter or a report takes it: a trace and the bytes of its file.

use ohmstrain::{JointParams, Quantity, Reading, ReadingUnit, Sensor};
use ohmstrain_bench_data::{Metadata, ReadingKind, ReferenceQuantity, Trace, TraceReader};
use ohmstrain_calib::Samples;
use sha2::{Digest, Sha256};
use wasm_bindgen::prelude::*;

use crate::json::refused;

/// A recording: times, readings and perhaps a reference, with the bytes of the trace CSV that they stand in.
#[wasm_bindgen]
#[derive(Clone)]
pub struct Recording {
    pub(crate) name: String,
    /// Name of its header in messages: file and line.
    pub(crate) header: String,
    pub(crate) bytes: Vec<u8>,
    pub(crate) sha256: String,
    /// Rows of the file before the first one here.
    pub(crate) first_row: usize,
    pub(crate) trace: Trace,
}

impl Recording {
    /// Reads a trace CSV.
    pub(crate) fn of_trace(name: &str, bytes: Vec<u8>) -> Result<Self, ohmstrain_bench_data::TraceError> {
        let rows = TraceReader::with_overrides(bytes.as_slice(), name, &Metadata::default())?;
        let (name, line) = (rows.file().to_owned(), rows.line());
        let trace = Trace::collect(rows)?;
        let sha256 = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        let header = if line == 0 { name.clone() } else { format!("{name}:{line}") };
        Ok(Self { header, name, bytes, sha256, first_row: 0, trace })
    }

    /// Time, s, and reading of a row.
    pub(crate) fn row(&self, row: usize) -> (f64, Reading) {
        let (time_s, value) = (self.trace.time_s[row], self.trace.readings.values[row]);
        let converter = self.trace.readings.converter.as_ref();
        let sd = converter.and_then(|converter| converter.sd_ohm.get(row).copied()).unwrap_or(0.0);
        let saturated = converter.is_some_and(|converter| converter.saturated.get(row).copied().unwrap_or(false));
        (time_s, Reading { value, sd, saturated })
    }

    /// Returns time, reading and reference in a row.
    pub(crate) fn known_row(&self, row: usize) -> (f64, Reading, f64) {
        let (time_s, reading) = self.row(row);
        (time_s, reading, self.truth(row))
    }

    /// The reference in a row; NaN where it is missing.
    pub(crate) fn truth(&self, row: usize) -> f64 {
        let value = self.trace.reference.as_ref().and_then(|reference| reference.values.get(row));
        value.copied().unwrap_or(f64::NAN)
    }

    /// Quantity of the reference.
    pub(crate) fn quantity(&self) -> Option<Quantity> {
        self.trace.reference.as_ref().map(|reference| match reference.quantity {
            ReferenceQuantity::Strain => Quantity::Strain,
            ReferenceQuantity::AngleDeg => Quantity::AngleDeg,
        })
    }

    /// Unit of the readings.
    pub(crate) fn unit(&self) -> ReadingUnit {
        match self.trace.readings.kind {
            ReadingKind::Ohm => ReadingUnit::Ohm,
            ReadingKind::Ratio => ReadingUnit::Ratio,
        }
    }

    /// The joint that its metadata describe.
    pub(crate) fn joint(&self) -> Option<JointParams> {
        self.trace.metadata.joint.map(|joint| JointParams {
            prestrain: joint.prestrain,
            moment_arm_mm: joint.moment_arm_mm,
            gauge_length_mm: joint.gauge_length_mm,
        })
    }

    /// Returns it in the form that calibration takes.
    pub(crate) fn samples(&self) -> Result<Samples<'_>, String> {
        let none = "expected a reference (strain, displacement_mm or angle_deg), found none";
        let Some(reference) = &self.trace.reference else {
            return Err(format!("{}: column `strain`: {none}", self.header));
        };
        Samples::new(&self.trace.time_s, &self.trace.readings.values, &reference.values)
            .map_err(|error| format!("{}: data {error}", self.name))
    }

    /// Refuses readings in another unit than the sensor's.
    pub(crate) fn check_unit(&self, expected: ReadingUnit) -> Result<(), String> {
        let column = |unit| if unit == ReadingUnit::Ohm { "resistance_ohm" } else { "resistance_ratio" };
        let found = self.unit();
        if found == expected {
            return Ok(());
        }
        let (expected, found) = (column(expected), column(found));
        let header = &self.header;
        Err(format!(
            "{header}: column `{found}`: expected `{expected}` as in the sensor's calibration, found `{found}`"
        ))
    }

    /// Refuses a reference that measures another quantity.
    pub(crate) fn check_quantity(&self, expected: Quantity) -> Result<(), String> {
        match self.quantity().filter(|found| *found != expected).map(Quantity::name) {
            None => Ok(()),
            Some(found) => Err(format!(
                "{}: column `{found}`: expected a reference in `{}`, as the calibration has it, found `{found}`",
                self.header,
                expected.name()
            )),
        }
    }

    /// The sensor as it sits in this recording.
    pub(crate) fn sensor(&self, sensor: &Sensor) -> Result<Sensor, String> {
        self.check_unit(sensor.params().reading)?;
        let sensor = sensor.clone();
        match self.joint() {
            Some(joint) => sensor.on_joint(joint).map_err(|error| error.to_string()),
            None => Ok(sensor),
        }
    }

    /// Returns some of its rows, by their times.
    pub(crate) fn between(&self, from_s: Option<f64>, until_s: Option<f64>) -> Self {
        let row_at = |time_s: f64| self.trace.time_s.partition_point(|earlier_s| *earlier_s < time_s);
        let end = until_s.map_or(self.trace.len(), row_at);
        let rows = from_s.map_or(0, row_at).min(end)..end;
        Self { first_row: self.first_row + rows.start, trace: self.trace.rows(rows), ..self.clone() }
    }
}

#[wasm_bindgen]
impl Recording {
    /// Times, s; readings, Ω; and, if they are known, strains. NaN stands for a missing reading or strain.
    #[wasm_bindgen(constructor)]
    pub fn new(time_s: &[f64], ohm: &[f64], strain: Option<Vec<f64>>) -> Result<Recording, JsError> {
        if ohm.len() != time_s.len() || strain.as_ref().is_some_and(|strain| strain.len() != time_s.len()) {
            return Err(refused("expected columns of one length"));
        }
        let header = if strain.is_some() { "time_s,resistance_ohm,strain\n" } else { "time_s,resistance_ohm\n" };
        let cell = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
        let row = |k: usize| {
            let strain = strain.as_ref().map_or_else(String::new, |strain| format!(",{}", cell(strain[k])));
            format!("{},{}{strain}\n", time_s[k], cell(ohm[k]))
        };
        let text = header.to_owned() + &(0..time_s.len()).map(row).collect::<String>();
        Self::of_trace("recording", text.into_bytes()).map_err(refused)
    }

    /// Reads a trace CSV.
    #[wasm_bindgen(js_name = fromCsv)]
    pub fn from_csv(name: &str, bytes: Vec<u8>) -> Result<Recording, JsError> {
        Self::of_trace(name, bytes).map_err(refused)
    }

    /// Its name.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.name.clone()
    }

    /// Number of rows.
    #[wasm_bindgen(getter)]
    pub fn rows(&self) -> usize {
        self.trace.len()
    }

    /// Times, s.
    #[wasm_bindgen(getter)]
    pub fn time(&self) -> Vec<f64> {
        self.trace.time_s.clone()
    }

    /// Readings, Ω or a ratio; NaN where missing.
    #[wasm_bindgen(getter)]
    pub fn reading(&self) -> Vec<f64> {
        self.trace.readings.values.clone()
    }

    /// The reference, strain or degrees; NaN where missing.
    #[wasm_bindgen(getter)]
    pub fn reference(&self) -> Option<Vec<f64>> {
        self.trace.reference.as_ref().map(|reference| reference.values.clone())
    }

    /// Returns the quantity of the reference: `strain` or `angle_deg`.
    #[wasm_bindgen(getter, js_name = quantity)]
    pub fn quantity_name(&self) -> Option<String> {
        self.quantity().map(|quantity| quantity.name().to_owned())
    }

    /// Unit of the readings: `ohm` or `ratio`.
    #[wasm_bindgen(getter, js_name = unit)]
    pub fn unit_name(&self) -> String {
        if self.unit() == ReadingUnit::Ohm { "ohm".into() } else { "ratio".into() }
    }

    /// Another handle for it: a calibration takes what it is given.
    pub fn copy(&self) -> Recording {
        self.clone()
    }

    /// The trace CSV.
    pub fn csv(&self) -> Vec<u8> {
        self.bytes.clone()
    }
}
