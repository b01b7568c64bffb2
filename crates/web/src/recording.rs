//! A recording for calibration, filter or report: a trace and the bytes of its file.

use ohmstrain::trace::TraceFile;
use ohmstrain::{ReadingUnit, Sensor};
use ohmstrain_bench_data::{Metadata, TraceReader};
use sha2::{Digest, Sha256};
use wasm_bindgen::prelude::*;

use crate::json::refused;

/// A recording: times, readings and optionally a reference, with the bytes of its trace CSV.
#[wasm_bindgen]
#[derive(Clone)]
pub struct Recording {
    pub(crate) file: TraceFile,
    pub(crate) bytes: Vec<u8>,
}

impl Recording {
    /// Reads a trace CSV.
    pub(crate) fn of_trace(name: &str, bytes: Vec<u8>) -> Result<Self, ohmstrain_bench_data::TraceError> {
        let rows = TraceReader::with_overrides(bytes.as_slice(), name, &Metadata::default())?;
        let sha256 = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { file: TraceFile::collect(rows, sha256)?, bytes })
    }
}

/// Returns the sensor for a recording: mounted as it describes, with wider intervals if it lacks temperatures.
pub(crate) fn seated(sensor: &Sensor, recording: &TraceFile) -> Result<Sensor, String> {
    recording.check_unit(sensor.params().reading).map_err(|error| error.to_string())?;
    let sensor = recording.sensor_for(sensor);
    match recording.joint() {
        Some(joint) => sensor.on_joint(joint).map_err(|error| error.to_string()),
        None => Ok(sensor),
    }
}

#[wasm_bindgen]
impl Recording {
    /// Creates a recording from times, s, readings, Ω, and, if they are known, strains. A missing reading or strain is NaN.
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

    /// Returns its name.
    #[wasm_bindgen(getter)]
    pub fn name(&self) -> String {
        self.file.name.clone()
    }

    /// Returns the number of rows.
    #[wasm_bindgen(getter)]
    pub fn rows(&self) -> usize {
        self.file.trace.len()
    }

    /// Returns the times, s.
    #[wasm_bindgen(getter)]
    pub fn time(&self) -> Vec<f64> {
        self.file.trace.time_s.clone()
    }

    /// Returns the readings, Ω or a ratio; NaN where missing.
    #[wasm_bindgen(getter)]
    pub fn reading(&self) -> Vec<f64> {
        self.file.trace.readings.values.clone()
    }

    /// Returns the reference, strain or degrees; NaN where missing.
    #[wasm_bindgen(getter)]
    pub fn reference(&self) -> Option<Vec<f64>> {
        self.file.trace.reference.as_ref().map(|reference| reference.values.clone())
    }

    /// Returns the quantity of the reference: `strain` or `angle_deg`.
    #[wasm_bindgen(getter, js_name = quantity)]
    pub fn quantity_name(&self) -> Option<String> {
        self.file.quantity().map(|quantity| quantity.name().to_owned())
    }

    /// Returns the unit of the readings: `ohm` or `ratio`.
    #[wasm_bindgen(getter, js_name = unit)]
    pub fn unit_name(&self) -> String {
        if self.file.unit() == ReadingUnit::Ohm { "ohm".into() } else { "ratio".into() }
    }

    /// Returns another handle for it, since a calibration consumes its recordings.
    pub fn copy(&self) -> Recording {
        self.clone()
    }

    /// Returns the trace CSV.
    pub fn csv(&self) -> Vec<u8> {
        self.bytes.clone()
    }
}
