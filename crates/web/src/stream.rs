//! Filtering of a board's lines, as in `ohmstrain live`.

use ohmstrain::trace::{WatchedFilter, restarted};
use ohmstrain::{MADE_BY, Sensor};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Row, RowWriter};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::{json, refused};
use crate::stream_lines::Lines;

/// Numbers per row that are returned.
const WIDTH: usize = 4;

/// Filter for the lines of a board, or of a recording that is played back.
#[wasm_bindgen]
pub struct Stream {
    sensor: Sensor,
    lines: Lines,
    filter: WatchedFilter,
    counts: Counts,
    message: String,
    /// Rows for the record; after each restart or header, another record.
    records: Vec<Vec<u8>>,
}

/// Counts of rows, gaps, bad lines and the like.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Counts {
    rows: u64,
    missing: u64,
    #[serde(rename = "badLines")]
    bad_lines: u64,
    restarts: u64,
}

/// Summary of a stream.
#[derive(Serialize)]
struct Described<'a> {
    counts: Counts,
    message: &'a str,
    /// Columns of the header; empty before one has arrived.
    columns: Vec<&'static str>,
    metadata: String,
}

impl Stream {
    /// Creates a stream that waits for a header, unless `header` names the columns: those of a trace, or `time_ms`; without a
    /// time, rows get their time of arrival. `front_end` describes the electronics of converter codes.
    pub(crate) fn new(sensor: &Sensor, header: Option<&str>, front_end: Option<&str>) -> Result<Self, String> {
        let mut overrides = Metadata::default();
        if let Some(text) = front_end.filter(|text| !text.is_empty()) {
            overrides.front_end = Some(text.parse().map_err(|error| format!("--front-end: {error}"))?);
        }
        let lines = Lines::new(LineParser::new("the port", overrides), header)?;
        let filter = WatchedFilter::new(sensor.filter(), 0).map_err(|error| error.to_string())?;
        let mut stream = Self {
            sensor: sensor.clone(),
            lines,
            filter,
            counts: Counts::default(),
            message: String::new(),
            records: vec![vec![]],
        };
        if header.is_some() {
            stream.headed()?;
        }
        Ok(stream)
    }

    /// Takes a line without its end, and appends the numbers of its row to `out`.
    fn take_line(&mut self, line: &str, arrived_s: f64, out: &mut Vec<f64>) -> Result<(), String> {
        match self.lines.take(line, arrived_s) {
            Ok(Line::Row(row)) => self.take_row(row, out),
            Ok(Line::Restarted(row)) => {
                self.restart()?;
                self.another_record();
                self.take_row(row, out)
            }
            Ok(Line::Header) => self.headed(),
            Ok(_) => Ok(()),
            Err(fault) => {
                self.counts.bad_lines += 1;
                self.message = format!("skipped {fault}");
                Ok(())
            }
        }
    }

    /// Begins another stream after a header.
    fn headed(&mut self) -> Result<(), String> {
        let (found, expected) = (self.columns()[1], self.sensor.columns()[1].name());
        let is_ratio = found == "resistance_ratio";
        if is_ratio != (expected == "resistance_ratio") {
            return Err(format!(
                "the port: column `{found}`: expected `{expected}` as in the sensor's calibration, found `{found}`"
            ));
        }
        self.message.clear();
        self.another_record();
        if self.counts.rows > 0 {
            return self.restart();
        }
        self.begin()?.into_iter().for_each(|remark| self.message = remark.into());
        Ok(())
    }

    /// Starts a new filter; returns a remark on its columns.
    fn begin(&mut self) -> Result<Option<&'static str>, String> {
        let has_temperature = self.lines.parser.has_temperature();
        self.filter.begin(self.sensor.filter(), has_temperature).map_err(|error| error.to_string())
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), String> {
        self.counts.restarts += 1;
        self.message = restarted(self.begin()?);
        Ok(())
    }

    fn take_row(&mut self, row: Row, out: &mut Vec<f64>) -> Result<(), String> {
        let estimate = match self.filter.step(&row) {
            Ok(estimate) => estimate,
            Err(error) => {
                self.counts.bad_lines += 1;
                self.message = error.to_string();
                return Ok(());
            }
        };
        self.counts.rows += 1;
        self.counts.missing += u64::from(!row.reading.value.is_finite());
        if let Some(remark) = self.filter.remark(&estimate, "say so").map_err(|error| error.to_string())? {
            self.message = remark;
        }
        self.record_row(&row).map_err(|error| error.to_string())?;
        let reading = estimate.resistance.unwrap_or(f64::NAN);
        out.extend([row.time_s, reading, estimate.strain, estimate.strain_sd]);
        Ok(())
    }

    /// Returns the columns of the record; empty before a header.
    fn columns(&self) -> Vec<&'static str> {
        let parser = &self.lines.parser;
        parser.reading_kind().map(|_| "time_s").into_iter().chain(parser.recorded_columns()).collect()
    }

    /// Returns the lines above a record's header.
    fn metadata(&self) -> String {
        let mut metadata = self.lines.parser.metadata();
        metadata.other.retain(|(key, _)| key != "made_by");
        format!("# made_by = {MADE_BY} live\n{metadata}")
    }

    /// Begins another record: times after a restart are no later ones, and a header may have other columns.
    fn another_record(&mut self) {
        self.records.push(format!("{}{}\n", self.metadata(), self.columns().join(",")).into_bytes());
    }

    fn record_row(&mut self, row: &Row) -> std::io::Result<()> {
        let Some(record) = self.records.last_mut() else { return Ok(()) };
        let mut rows = RowWriter::new(record);
        rows.number(row.time_s);
        self.lines.parser.recorded(row).for_each(|number| rows.number(number));
        rows.end()?;
        rows.flush()
    }
}

#[wasm_bindgen]
impl Stream {
    /// Takes complete lines that have arrived at a time, s, on this computer's clock. Returns four numbers per row: time in s,
    /// reading at the temperature of the calibration, strain and its standard deviation.
    pub fn take(&mut self, text: &str, arrived_s: f64) -> Result<Vec<f64>, JsError> {
        let mut out = Vec::with_capacity(WIDTH * text.len() / 8);
        for line in text.lines() {
            self.take_line(line, arrived_s, &mut out).map_err(refused)?;
        }
        Ok(out)
    }

    /// Returns the summary: counts, columns, the last message.
    #[wasm_bindgen(unchecked_return_type = "StreamSummary")]
    pub fn summary(&self) -> Result<JsValue, JsError> {
        let (columns, metadata) = (self.columns(), self.metadata());
        json(&Described { counts: self.counts, message: &self.message, columns, metadata })
    }

    /// Takes the sensor as rested and unstretched now: the strain is zero.
    pub fn rest(&mut self) -> Result<(), JsError> {
        self.filter.rest().map_err(refused)?;
        self.message = "the strain is zero now".into();
        Ok(())
    }

    /// Takes the sensor as rested now: its reading becomes R₀, and the strain starts again at zero.
    pub fn zero(&mut self) {
        self.message = self.filter.zero(self.sensor.filter());
    }

    /// Returns the rows of a trace CSV since the last call. The first text continues the record; each one after it is the beginning of
    /// another record, for another clock or header, with the lines above its rows.
    pub fn recorded(&mut self) -> Vec<String> {
        let records = std::mem::replace(&mut self.records, vec![vec![]]);
        records.into_iter().map(|record| String::from_utf8(record).unwrap_or_default()).collect()
    }
}
