//! Filtering of a board's lines, as in `ohmstrain live`.

use std::collections::VecDeque;

use ohmstrain::number::significant;
use ohmstrain::{Interface, MADE_BY, QuietWatch, Sensor, ValidityWatch};
use ohmstrain_bench_data::{Line, LineParser, Metadata, Reading, ReadingKind, ReferenceQuantity, Row, RowWriter};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::{json, refused};
use crate::stream_lines::Lines;

/// Duration, s, over which the reading of the rested sensor is determined, and the smallest number of readings for that.
const REST_S: f64 = 1.0;
const LEAST_AT_REST: usize = 5;
/// Standard deviation of a known rest, as a share of the limits' span: that of a known strain on the command line.
const KNOWN_TO: f64 = 0.005;
/// Number of readings after which their unit is checked.
const FIRST_READINGS: usize = 20;
/// Numbers per row that are returned.
const WIDTH: usize = 4;

/// Filter for the lines of a board, or of a recording that is played back.
#[wasm_bindgen]
pub struct Stream {
    sensor: Sensor,
    lines: Lines,
    filter: ohmstrain::Filter,
    watch: ValidityWatch,
    quiet: QuietWatch,
    rest: Option<f64>,
    early: Vec<f64>,
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
        let filter = sensor.filter().build().map_err(|error| error.to_string())?;
        let (watch, quiet) = (ValidityWatch::new(sensor, None), QuietWatch::new(sensor, None, &[]));
        let mut stream = Self {
            sensor: sensor.clone(),
            lines,
            filter,
            watch,
            quiet,
            rest: None,
            early: vec![],
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
            Ok(Line::Row(row)) => self.take_row(&row, out),
            Ok(Line::Restarted(row)) => {
                self.restart()?;
                self.take_row(&row, out)
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
        let (found, expected) = (self.reading_column(), self.sensor.columns()[1].name());
        let is_ratio = found == "resistance_ratio";
        if is_ratio != (expected == "resistance_ratio") {
            return Err(format!(
                "the port: column `{found}`: expected `{expected}` as in the sensor's calibration, found `{found}`"
            ));
        }
        self.message.clear();
        if self.counts.rows > 0 { self.restart() } else { Ok(()) }
    }

    /// Restarts everything that depends on time, after the clock has restarted.
    fn restart(&mut self) -> Result<(), String> {
        self.counts.restarts += 1;
        self.begin(false)?;
        self.message = "the clock has started again, and so has the filter".into();
        Ok(())
    }

    /// Starts a new filter.
    fn begin(&mut self, at_zero: bool) -> Result<(), String> {
        let builder = self.sensor.filter();
        let builder = self.rest.map_or(builder, |measured| builder.rest_resistance(measured));
        // A sensor whose range excludes zero cannot start there.
        let zero = at_zero.then(|| builder.initial_strain(0.0).build().ok()).flatten();
        self.filter = zero.map_or_else(|| builder.build(), Ok).map_err(|error| error.to_string())?;
        self.watch = ValidityWatch::new(&self.sensor, self.rest);
        self.quiet = QuietWatch::new(&self.sensor, self.rest, &[]);
        self.recent.clear();
        Ok(())
    }

    fn take_row(&mut self, row: &Row, out: &mut Vec<f64>) -> Result<(), String> {
        let Reading { value, sd_ohm, saturated, .. } = row.reading;
        let reading = ohmstrain::Reading { value, sd: sd_ohm.unwrap_or(0.0), saturated };
        let estimate = match self.filter.step(row.time_s, reading) {
            Ok(estimate) => estimate,
            Err(error) => {
                self.counts.bad_lines += 1;
                self.message = error.to_string();
                return Ok(());
            }
        };
        self.counts.rows += 1;
        self.counts.missing += u64::from(!value.is_finite());
        self.recent.push_back((row.time_s, value));
        while self.recent.front().is_some_and(|(time_s, _)| *time_s < row.time_s - REST_S)
            && self.recent.len() > LEAST_AT_REST
        {
            self.recent.pop_front();
        }
        if let Some(warning) = self.watch.see(row.time_s, value, estimate.strain_rate, f64::NAN).last() {
            self.message = warning.to_string();
        }
        if let Some(quiet) = self.quiet.see(&estimate) {
            let quiet_s = significant(quiet.now_s - quiet.from_s, 2);
            self.message = format!("{quiet_s} s of quiet that may be a rest: say so, if it is one");
        }
        self.doubt_early(value);
        self.record_row(row).map_err(|error| error.to_string())?;
        out.extend([row.time_s, value, estimate.strain, estimate.strain_sd]);
        Ok(())
    }

    /// Checks the unit of the readings, once there are enough.
    fn doubt_early(&mut self, value: f64) {
        if !value.is_finite() || self.early.len() >= FIRST_READINGS {
            return;
        }
        self.early.push(value);
        if self.early.len() == FIRST_READINGS
            && let Err(doubt) = self.sensor.check_unit(self.early.iter().copied(), self.rest)
        {
            self.message = doubt.text(Interface::CommandLine);
        }
    }

    fn reading_column(&self) -> &'static str {
        match (self.lines.parser.has_codes(), self.lines.parser.reading_kind()) {
            (true, _) => "adc",
            (_, Some(ReadingKind::Ratio)) => "resistance_ratio",
            _ => "resistance_ohm",
        }
    }

    fn reference_column(&self) -> Option<&'static str> {
        self.lines.parser.reference_quantity().map(|quantity| match quantity {
            ReferenceQuantity::Strain => "strain",
            ReferenceQuantity::AngleDeg => "angle_deg",
        })
    }

    /// Returns the columns of the record; empty before a header.
    fn columns(&self) -> Vec<&'static str> {
        if self.lines.parser.reading_kind().is_none() {
            return vec![];
        }
        ["time_s", self.reading_column()].into_iter().chain(self.reference_column()).collect()
    }

    fn record_row(&mut self, row: &Row) -> std::io::Result<()> {
        let (has_codes, has_reference) = (self.lines.parser.has_codes(), self.reference_column().is_some());
        let mut rows = RowWriter::new(&mut self.record);
        rows.number(row.time_s);
        rows.number(if has_codes { row.reading.code.map_or(f64::NAN, f64::from) } else { row.reading.value });
        if has_reference {
            rows.number(row.reference);
        }
        rows.end()?;
        rows.flush()
    }
}

#[wasm_bindgen]
impl Stream {
    /// Takes complete lines that have arrived at a time, s, on this computer's clock. Returns four numbers per row: time in s,
    /// reading, strain and its standard deviation.
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
        let sd = KNOWN_TO * self.sensor.params().limits.span();
        self.filter.know(0.0, sd).map_err(refused)?;
        self.message = "the strain is zero now".into();
        Ok(())
    }

    /// Takes the sensor as rested now: its reading becomes R₀, and the strain starts again at zero.
    pub fn zero(&mut self) -> Result<(), JsError> {
        let mut readings: Vec<f64> =
            self.recent.iter().map(|(_, reading)| *reading).filter(|reading| reading.is_finite()).collect();
        readings.sort_by(f64::total_cmp);
        let count = readings.len();
        let Some(middle) = readings.get(count / 2) else { return Ok(()) };
        let rest = if count % 2 == 1 { *middle } else { 0.5 * (readings[count / 2 - 1] + middle) };
        if let Err(refusal) = self.sensor.check_rest_resistance(rest) {
            self.message = format!("R0 stays as it was: {refusal}");
            return Ok(());
        }
        self.rest = Some(rest);
        self.begin(true).map_err(refused)?;
        self.message = format!("R0 is {} now, the median of {count} readings", significant(rest, 5));
        Ok(())
    }

    /// Returns the rows of a trace CSV since the last call.
    pub fn recorded(&mut self) -> String {
        String::from_utf8(std::mem::take(&mut self.record)).unwrap_or_default()
    }
}
