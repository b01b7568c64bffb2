//! Lines of a recording of several channels: each channel parses every line under a header in which its own column is the reading.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use ohmstrain_bench_data::{Line, ParquetText, Row};

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
    header: Option<String>,
    /// True for a stream of a device: it may be joined within a line, and its header may come again.
    is_stream: bool,
    /// Advice where the clock has restarted.
    late: &'static str,
}

impl HandParser {
    /// Creates a parser that waits for a header; `late` is advice where the clock has restarted.
    pub fn new(is_stream: bool, late: &'static str) -> Self {
        Self { header: None, is_stream, late }
    }

    /// Parses a line; `place` is its place in messages.
    ///
    /// # Errors
    /// If a header lacks a channel's column.
    pub fn take(&mut self, line: &[u8], place: &str, joints: &mut [Joint]) -> Result<Taken, CliError> {
        let text = String::from_utf8_lossy(line);
        let is_first = self.header.is_none() && !text.starts_with('#') && !text.trim().is_empty();
        let is_header = is_first || (self.is_stream && self.header.as_deref() == Some(text.trim()));
        let mut taken = Taken { is_first, restarted: is_header && !is_first, ..Taken::default() };
        for channel in channels(joints) {
            let result = if is_header {
                match channel.header(text.trim()) {
                    Ok(own) => channel.lines.take(own.as_bytes()),
                    // The rest of a line, as after opening a port late, is no header.
                    Err(what) if self.is_stream && !has_time(&text) => {
                        return Ok(Taken { refused: Some(format!("{place}: {what}")), ..Taken::default() });
                    }
                    Err(what) => return Err(CliError::Input(format!("{place}: {what}"))),
                }
            } else {
                channel.lines.take(line)
            };
            match result {
                Ok(Line::Row(row)) => taken.rows.push(row),
                Ok(Line::Restarted(row)) => {
                    taken.rows.push(row);
                    taken.restarted = true;
                }
                Ok(_) => {}
                Err(fault) => {
                    let hint = if fault.is_late { self.late } else { "" };
                    taken.refused = Some(format!("joint `{}`: {fault}{hint}", channel.joint));
                }
            }
        }
        if is_first && taken.refused.is_none() {
            self.header = Some(text.trim().to_owned());
        }
        // A line that one channel cannot read is a row for none.
        if taken.refused.is_some() || taken.rows.len() < channels(joints).count() {
            taken.rows.clear();
        }
        Ok(taken)
    }
}

/// True if a line names a column of times.
fn has_time(text: &str) -> bool {
    text.split(',').any(|cell| matches!(cell.trim(), "time_s" | "time_us"))
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
