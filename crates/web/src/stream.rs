//! Filtering of a board's lines, as in `ohmstrain live`.

use std::collections::VecDeque;

use ohmstrain::number::{median, significant};
use ohmstrain::trace::WatchedFilter;
use ohmstrain::{MADE_BY, Sensor};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Row, RowWriter};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::{json, refused};
use crate::stream_lines::Lines;

/// Duration, s, over which the reading of the rested sensor is determined, and the smallest number of readings for that.
const REST_S: f64 = 1.0;
const LEAST_AT_REST: usize = 5;
/// Numbers per row that are returned.
const WIDTH: usize = 4;

/// Filter for the lines of a board, or of a recording that is played back.
#[wasm_bindgen]
pub struct Stream {
    sensor: Sensor,
    lines: Lines,
    filter: WatchedFilter,
    /// Times, s, and readings of the last seconds.
    recent: VecDeque<(f64, f64)>,
    counts: Counts,
    message: String,
    record: Vec<u8>,
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
            recent: VecDeque::new(),
            counts: Counts::default(),
            message: String::new(),
            record: vec![],
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
        if self.counts.rows > 0 { self.restart() } else { self.begin() }
    }

    /// Starts a new filter.
    fn begin(&mut self) -> Result<(), String> {
        let has_temperature = self.lines.parser.has_temperature();
        let remark = self.filter.begin(self.sensor.filter(), has_temperature).map_err(|error| error.to_string())?;
        remark.into_iter().for_each(|remark| self.message = remark.into());
        Ok(())
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), String> {
        self.counts.restarts += 1;
        self.begin()?;
        self.recent.clear();
        self.message = "the clock has started again, and so has the filter".into();
        Ok(())
    }

    fn take_row(&mut self, mut row: Row, out: &mut Vec<f64>) -> Result<(), String> {
        let estimate = match self.filter.step(&mut row) {
            Ok(estimate) => estimate,
            Err(error) => {
                self.counts.bad_lines += 1;
                self.message = error.to_string();
                return Ok(());
            }
        };
        let value = row.reading.value;
        self.counts.rows += 1;
        self.counts.missing += u64::from(!value.is_finite());
        self.recent.push_back((row.time_s, value));
        while self.recent.front().is_some_and(|(time_s, _)| *time_s < row.time_s - REST_S)
            && self.recent.len() > LEAST_AT_REST
        {
            self.recent.pop_front();
        }
        if let Some(remark) = self.filter.remark(&estimate, "say so").map_err(|error| error.to_string())? {
            self.message = remark;
        }
        self.record_row(&row).map_err(|error| error.to_string())?;
        out.extend([row.time_s, value, estimate.strain, estimate.strain_sd]);
        Ok(())
    }

    /// Returns the columns of the record; empty before a header.
    fn columns(&self) -> Vec<&'static str> {
        let parser = &self.lines.parser;
        parser.reading_kind().map(|_| "time_s").into_iter().chain(parser.recorded_columns()).collect()
    }

    fn record_row(&mut self, row: &Row) -> std::io::Result<()> {
        let mut rows = RowWriter::new(&mut self.record);
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
        let mut metadata = self.lines.parser.metadata();
        metadata.other.retain(|(key, _)| key != "made_by");
        let metadata = format!("# made_by = {MADE_BY} live\n{metadata}");
        json(&Described { counts: self.counts, message: &self.message, columns: self.columns(), metadata })
    }

    /// Takes the sensor as rested and unstretched now: the strain is zero.
    pub fn rest(&mut self) -> Result<(), JsError> {
        self.filter.rest().map_err(refused)?;
        self.message = "the strain is zero now".into();
        Ok(())
    }

    /// Takes the sensor as rested now: its reading becomes R₀, and the strain starts again at zero.
    pub fn zero(&mut self) {
        let readings: Vec<f64> =
            self.recent.iter().map(|(_, reading)| *reading).filter(|reading| reading.is_finite()).collect();
        let count = readings.len();
        let Some(rest) = median(readings) else { return };
        self.message = match self.filter.zero(self.sensor.filter(), rest) {
            Err(refused) => format!("R0 stays as it was: {refused}"),
            Ok(_) => {
                self.recent.clear();
                format!("R0 is {} now, the median of {count} readings", significant(rest, 5))
            }
        };
    }

    /// Returns the rows of a trace CSV since the last call.
    pub fn recorded(&mut self) -> String {
        String::from_utf8(std::mem::take(&mut self.record)).unwrap_or_default()
    }
}
