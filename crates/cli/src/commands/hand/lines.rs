//! Lines of a recording of several channels: each channel parses every line under a header in which its own column is the reading.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use ohmstrain_bench_data::{Line, LineParser, ParquetText, Row, cells};

use super::joint::{Channel, Joint};
use crate::error::CliError;
use crate::readings::no_row;
use crate::whole_file::is_stdin;

/// Longest line, bytes; anything longer is not a row.
const LONGEST_LINE: u64 = 64 * 1024;

/// Result of a line.
#[derive(Default)]
pub struct Taken {
    /// A row of each channel; empty for any other line.
    pub rows: Vec<Row>,
    /// True for the first header.
    pub is_first: bool,
    /// True if the clock has restarted.
    pub restarted: bool,
    /// Reason why a channel cannot read the line.
    pub refused: Option<String>,
}

/// Parser of all channels' lines.
pub struct HandParser {
    has_header: bool,
    /// True for a stream of a device: it may be joined within a line, and its header may come again.
    is_stream: bool,
    /// Advice where the clock has restarted.
    late: &'static str,
}

impl HandParser {
    /// Creates a parser that waits for a header; `late` is advice where the clock has restarted.
    pub fn new(is_stream: bool, late: &'static str) -> Self {
        Self { has_header: false, is_stream, late }
    }

    /// Parses a line; `place` is its place in messages.
    ///
    /// # Errors
    /// If a header lacks a channel's column.
    pub fn take(&mut self, line: &[u8], place: &str, joints: &mut [Joint]) -> Result<Taken, CliError> {
        let text = String::from_utf8_lossy(line);
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() || text.starts_with('#') {
            return Ok(self.rows(line, joints));
        }
        let names = cells(text).unwrap_or_else(|| vec![text.to_owned()]);
        let has_time = names.iter().any(|name| name == "time_s" || name == "time_us");
        let is_first = !self.has_header;
        if !(is_first || self.is_stream && has_time) {
            return Ok(self.rows(line, joints));
        }
        let headers: Result<Vec<String>, String> = channels(joints).map(|channel| channel.header(&names)).collect();
        match headers {
            Ok(headers) => self.begin(&headers, joints, is_first),
            // The rest of a line, as after opening a port late, is no header.
            Err(what) if self.is_stream && !(is_first && has_time) => {
                Ok(Taken { refused: Some(format!("{place}: {what}")), ..Taken::default() })
            }
            Err(what) => Err(CliError::Input(format!("{place}: {what}"))),
        }
    }

    /// Begins with a header, in the form for each channel; one that comes again may have its columns in another order.
    fn begin(&mut self, headers: &[String], joints: &mut [Joint], is_first: bool) -> Result<Taken, CliError> {
        let mut taken = Taken { is_first, restarted: !is_first, ..Taken::default() };
        for (channel, header) in channels(joints).zip(headers) {
            if let Err(fault) = channel.lines.take(header.as_bytes()) {
                taken.refused = Some(channel.refused(fault, ""));
            }
        }
        self.has_header |= taken.refused.is_none();
        Ok(taken)
    }

    /// Parses a line that is no header.
    fn rows(&self, line: &[u8], joints: &mut [Joint]) -> Taken {
        let parsers = channels(joints).map(|channel| &mut channel.lines);
        match LineParser::take_together(parsers, line) {
            Ok(lines) => Taken {
                restarted: lines.iter().any(|line| matches!(line, Line::Restarted(_))),
                rows: lines.into_iter().filter_map(Line::row).collect(),
                ..Taken::default()
            },
            Err((index, fault)) => {
                let hint = if fault.is_late { self.late } else { "" };
                let refused = channels(joints).nth(index).map(|channel| channel.refused(fault, hint));
                Taken { refused, ..Taken::default() }
            }
        }
    }
}

/// Returns the channels of all joints.
pub fn channels<'j, 'a: 'j>(joints: &'j mut [Joint<'a>]) -> impl Iterator<Item = &'j mut Channel<'a>> {
    joints.iter_mut().flat_map(|joint| &mut joint.channels)
}

/// Lines of a recording or of standard input.
pub struct HandLines {
    path: PathBuf,
    /// Its name in messages.
    pub file: String,
    /// True if a reader waits for each row.
    pub is_live: bool,
    source: BufReader<Box<dyn Read>>,
    line: Vec<u8>,
    /// Number of the last line.
    number: u64,
    parser: HandParser,
}

impl HandLines {
    /// Opens a recording, or standard input.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(path: &Path, parser: HandParser) -> Result<Self, CliError> {
        let (file, source): (String, Box<dyn Read>) = if is_stdin(path) {
            ("stdin".into(), Box::new(io::stdin()))
        } else {
            let file = File::open(path).map_err(|error| CliError::file("read", path, &error))?;
            (path.display().to_string(), Box::new(file))
        };
        let mut source = BufReader::new(source);
        if source.fill_buf().is_ok_and(ParquetText::is_one) {
            let what = "expected text: a recording of several channels is not read from Parquet";
            return Err(CliError::Input(format!("{file}: {what}")));
        }
        Ok(Self {
            path: path.into(),
            file,
            is_live: is_stdin(path) || !path.is_file(),
            source,
            line: Vec::new(),
            number: 0,
            parser,
        })
    }

    /// Returns the place of the last line.
    pub fn place(&self) -> String {
        format!("{}:{}", self.file, self.number)
    }

    /// Parses the next line; `None` at the end.
    ///
    /// # Errors
    /// If it cannot be read, or a header lacks a channel's column.
    pub fn next(&mut self, joints: &mut [Joint]) -> Result<Option<Taken>, CliError> {
        let unreadable = |error| CliError::file("read", &self.path, &error);
        if self.line.len() as u64 == LONGEST_LINE && !self.line.ends_with(b"\n") {
            self.source.skip_until(b'\n').map_err(unreadable)?;
        }
        self.line.clear();
        let mut limited = (&mut self.source).take(LONGEST_LINE);
        if limited.read_until(b'\n', &mut self.line).map_err(unreadable)? == 0 {
            return Ok(None);
        }
        self.number += 1;
        let place = self.place();
        self.parser.take(&self.line, &place, joints).map(Some)
    }

    /// Returns the error of a recording without a row.
    pub fn no_row(&self) -> CliError {
        no_row(&self.file, self.number)
    }
}
