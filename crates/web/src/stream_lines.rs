//! Lines of a board in the form of a trace: missing times are added, milliseconds become seconds.

use std::borrow::Cow;

use ohmstrain_bench_data::{BadContent, Headed, Line, LineParser};

/// Parser of lines.
pub struct Lines {
    pub parser: LineParser,
    headed: Headed,
    /// Index of a cell of milliseconds in each line, if there is one.
    milliseconds: Option<usize>,
}

impl Lines {
    /// Creates a parser that waits for a header, unless one is given.
    pub fn new(mut parser: LineParser, header: Option<&str>) -> Result<Self, String> {
        let milliseconds = header.and_then(|names| names.split(',').position(|name| name.trim() == "time_ms"));
        let headed = Headed::new(header.map(|names| names.replace("time_ms", "time_s")).as_deref());
        match headed.header().map(|header| parser.take(header.as_bytes())) {
            None | Some(Ok(Line::Header)) => Ok(Self { parser, headed, milliseconds }),
            Some(Ok(_)) => Err("--header: expected names of columns".into()),
            Some(Err(fault)) => Err(format!("--header: expected {}", fault.expected)),
        }
    }

    /// Takes a line that has arrived at a time, s.
    pub fn take(&mut self, line: &str, arrived_s: f64) -> Result<Line, BadContent> {
        if line.trim().is_empty() {
            return Ok(Line::Nothing);
        }
        let line = self.milliseconds.map_or(Cow::from(line), |place| with_seconds(line, place).into());
        self.parser.take(&self.headed.line(line.as_bytes(), arrived_s))
    }
}

/// Converts a cell of milliseconds to seconds; the line stays as it is if the cell is not a number.
fn with_seconds(line: &str, place: usize) -> String {
    let seconds = |cell: &str| cell.trim().parse().map_or_else(|_| cell.to_owned(), |ms: f64| (ms / 1e3).to_string());
    let cells = line.split(',').enumerate();
    cells.map(|(k, cell)| if k == place { seconds(cell) } else { cell.to_owned() }).collect::<Vec<_>>().join(",")
}
