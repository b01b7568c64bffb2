//! Readings that are recorded while a person follows a protocol.

use std::collections::VecDeque;
use std::time::Instant;

use ohmstrain::MADE_BY;
use ohmstrain_bench_data::{Headed, Metadata, counted};

use super::columns::{Columns, StreamRow, known_cells};
use super::pacer::Pacer;
use super::writer::Writer;
use crate::args::RecordArgs;
use crate::error::CliError;
use crate::port::{Due, Taker};

/// Largest number of readings and planned values kept for the plots.
const MOST_POINTS: usize = 1 << 14;
/// Shortest pause of the readings that spoils a step, s, or in usual steps.
const GAP_S: f64 = 1.0;
const GAP_STEPS: f64 = 5.0;
/// Shortest time between the last row before a restart and the first after it, s.
const LEAST_STEP_S: f64 = 1e-4;

/// A row of the plots.
#[derive(Clone, Copy)]
pub struct Point {
    pub time_s: f64,
    /// The first channel's reading; NaN if it is missing.
    pub reading: f64,
    /// Planned value; NaN if there is none.
    pub planned: f64,
}

/// Counts of rows, holds and the like.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    pub rows: u64,
    pub bad_lines: u64,
    pub restarts: u64,
    pub repeated: u32,
    /// Number of holds at each position.
    pub holds: Vec<u32>,
}

/// A recording that is being made.
pub struct Recording<'a> {
    pub args: &'a RecordArgs,
    name: String,
    overrides: Metadata,
    headed: Headed,
    remarks: Vec<String>,
    columns: Option<Columns>,
    writer: Writer,
    pub pacer: Pacer,
    /// Time that is added to the device's times after its clock has restarted, s.
    offset_s: f64,
    /// The last row's time, s, and its arrival.
    last: Option<(f64, Instant)>,
    usual_step_s: Option<f64>,
    /// Position held in the last row.
    held: Option<usize>,
    pub counts: Counts,
    pub points: VecDeque<Point>,
    /// Last message.
    pub message: String,
    /// Steps that have begun and have not been announced yet, with their times, s.
    pub cues: Vec<(f64, String)>,
}

impl<'a> Recording<'a> {
    /// Creates a recording that waits for a header.
    ///
    /// # Errors
    /// If the header in the flags is invalid, or the file cannot be created.
    pub fn new(args: &'a RecordArgs, pacer: Pacer) -> Result<Self, CliError> {
        let headed = Headed::new(args.port.header.as_deref());
        let counts = Counts { holds: vec![0; pacer.pacing().positions.len()], ..Counts::default() };
        let mut recording = Self {
            args,
            name: args.port.source(),
            overrides: args.setup.metadata(&args.units),
            remarks: Vec::new(),
            columns: None,
            writer: Writer::new(&args.output, args.force, args.port.port.iter().chain([&args.protocol]))?,
            pacer,
            offset_s: 0.0,
            last: None,
            usual_step_s: None,
            held: None,
            counts,
            points: VecDeque::new(),
            message: String::new(),
            cues: Vec::new(),
            headed,
        };
        if let Some(header) = recording.headed.header().map(str::to_owned)
            && !recording.begin(&header)?
        {
            return Err(CliError::Arguments("--header: expected names of columns, time_us,adc for instance".into()));
        }
        Ok(recording)
    }

    /// Returns the present on the clock of the rows, s.
    pub fn now_s(&self) -> f64 {
        let speed =
            if self.args.port.port.as_ref().is_some_and(|port| port.is_file()) { self.args.port.speed } else { 1.0 };
        self.last.map_or(0.0, |(time_s, came)| {
            let longest_s = self.usual_step_s.unwrap_or(0.0);
            time_s + (speed * came.elapsed().as_secs_f64()).min(longest_s)
        })
    }

    /// True if the stream has several columns of readings.
    pub fn has_several_channels(&self) -> bool {
        self.columns.as_ref().is_some_and(|columns| columns.channels() > 1)
    }

    /// Begins with a header; returns false if the line is not one.
    fn begin(&mut self, header: &str) -> Result<bool, CliError> {
        let stream = (self.name.as_str(), &self.overrides, &self.remarks[..]);
        let found = Columns::of(header, stream, self.pacer.pacing());
        let found = found.map_err(|what| CliError::Input(format!("{}: {what}", self.name)))?;
        let Some(columns) = found else { return Ok(false) };
        let (metadata, header) = (columns.metadata(), columns.header(self.pacer.pacing()));
        self.writer.head(&format!("# made_by = {MADE_BY} record\n{metadata}{header}\n"))?;
        self.columns = Some(columns);
        self.message.clear();
        Ok(true)
    }

    /// Repeats the spoiled step, for a reason.
    pub fn repeat(&mut self, why: &str) -> Result<(), CliError> {
        let now_s = self.now_s();
        if self.pacer.repeat(now_s) { self.spoiled(why) } else { Ok(()) }
    }

    /// Pauses or resumes the protocol.
    pub fn toggle_pause(&mut self) -> Result<(), CliError> {
        let now_s = self.now_s();
        if self.pacer.toggle_pause(now_s) {
            self.spoiled("paused")?;
        }
        // Marks made by hand during the pause stay.
        self.writer.settle();
        Ok(())
    }

    /// Marks a position by hand, or ends the mark.
    pub fn mark(&mut self, position: usize) -> Result<(), CliError> {
        let now_s = self.now_s();
        if self.pacer.mark(position, now_s) {
            self.spoiled("marked by hand")?;
        }
        self.writer.settle();
        Ok(())
    }

    fn spoiled(&mut self, why: &str) -> Result<(), CliError> {
        self.counts.repeated += 1;
        self.message = format!("{why}: the step is made again");
        self.held = None;
        let unknown = known_cells(self.pacer.pacing(), None);
        self.writer.spoil(&unknown)?;
        self.cue(self.now_s());
        Ok(())
    }

    /// Records the present instruction for users without a terminal.
    fn cue(&mut self, time_s: f64) {
        let text = self.pacer.instruction(time_s).text;
        self.cues.push((time_s, text));
    }

    /// Updates the usual step; returns true if this step was a gap.
    fn is_gap(&mut self, time_s: f64) -> bool {
        let Some((last_s, _)) = self.last else { return false };
        let step_s = time_s - last_s;
        let usual_s = self.usual_step_s.get_or_insert(step_s);
        let is_gap = step_s > GAP_S.max(GAP_STEPS * *usual_s);
        if !is_gap {
            *usual_s += 0.1 * (step_s - *usual_s);
        }
        is_gap
    }

    /// Records that the body is held, or no longer held.
    fn see(&mut self, held: Option<usize>) {
        if let (Some(position), true) = (held, held != self.held) {
            self.counts.holds[position] += 1;
        }
        self.held = held;
    }

    fn plot(&mut self, time_s: f64, reading: f64) {
        let planned = self.pacer.planned(time_s).unwrap_or(f64::NAN);
        self.points.push_back(Point { time_s, reading, planned });
        let oldest_s = time_s - self.args.window_s;
        while self.points.len() > MOST_POINTS || self.points.front().is_some_and(|point| point.time_s < oldest_s) {
            self.points.pop_front();
        }
    }
}

impl Taker for Recording<'_> {
    type Row = StreamRow;

    fn parse(&mut self, line: &[u8], arrived_s: f64) -> Result<Option<Due<StreamRow>>, CliError> {
        let line = self.headed.line(line, arrived_s);
        let text = String::from_utf8_lossy(&line);
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() {
            return Ok(None);
        }
        if text.starts_with('#') {
            match &mut self.columns {
                Some(columns) => columns.remark(text),
                None => self.remarks.push(text.to_owned()),
            }
            return Ok(None);
        }
        let Some(columns) = &mut self.columns else {
            if !self.begin(text)? {
                self.counts.bad_lines += 1;
                self.message =
                    format!("skipped `{text}`: a stream without a header needs --header time_s,resistance_ohm");
            }
            return Ok(None);
        };
        if columns.restart(text).map_err(|what| CliError::Input(format!("{}: {what}", self.name)))? {
            return Ok(None);
        }
        match columns.row(text) {
            Ok(due) => Ok(due),
            Err(fault) => {
                self.counts.bad_lines += 1;
                self.message = format!("skipped {fault}");
                Ok(None)
            }
        }
    }

    fn take(&mut self, due: Due<StreamRow>) -> Result<(), CliError> {
        if let Some((last_s, came)) = self.last
            && (due.restarted || due.time_s + self.offset_s <= last_s)
        {
            let gone_s = came.elapsed().as_secs_f64().max(self.usual_step_s.unwrap_or(0.0)).max(LEAST_STEP_S);
            self.offset_s = last_s + gone_s - due.time_s;
            self.counts.restarts += 1;
            self.last = Some((last_s + gone_s, Instant::now()));
            self.repeat("the device has started anew")?;
        }
        let time_s = due.time_s + self.offset_s;
        let is_gap = self.is_gap(time_s);
        self.last = Some((time_s, Instant::now()));
        if is_gap {
            self.repeat("no readings came")?;
        }
        if self.pacer.advance(time_s) {
            self.writer.settle();
            self.held = None;
            self.cue(time_s);
        }
        let held = self.pacer.held(time_s);
        self.see(held);
        let known = known_cells(self.pacer.pacing(), held);
        self.writer.row(format!("{time_s},{}", due.row.cells), &known)?;
        if !self.pacer.is_in_step() {
            self.writer.settle();
        }
        self.counts.rows += 1;
        self.plot(time_s, due.row.reading);
        Ok(())
    }
}

impl Counts {
    /// Returns the counts as a sentence.
    pub fn text(&self, recording: &Recording) -> String {
        let positions = &recording.pacer.pacing().positions;
        let held = positions.iter().zip(&self.holds).filter(|(_, count)| **count > 0);
        let held: Vec<String> = held.map(|(position, count)| format!("{} × {count}", position.name)).collect();
        let held = if held.is_empty() { "no position".into() } else { held.join(", ") };
        format!(
            "{}: {}, held at {held}; {} repeated, {} skipped, {} of the clock",
            recording.args.output.display(),
            counted(self.rows, "row"),
            counted(self.repeated, "step"),
            counted(self.bad_lines, "line"),
            counted(self.restarts, "restart")
        )
    }
}
