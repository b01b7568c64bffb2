//! Lines of a board in the form of a trace: missing times are added, milliseconds become seconds.

use ohmstrain_bench_data::{BadContent, Line, LineParser};

/// Interval between lines that arrive at once, s: a hundred times the resolution of the written times.
const LEAST_STEP_S: f64 = 1e-4;

/// Source of the lines' times.
enum Clock {
    /// Times in the lines themselves.
    Own,
    /// A cell of milliseconds in each line, by its index.
    Milliseconds(usize),
    /// Arrival of the lines: the first time, and the last time since then, s.
    Arrival(Option<f64>, f64),
}

/// Parser of lines.
pub struct Lines {
    pub parser: LineParser,
    clock: Clock,
}

impl Lines {
    /// Creates a parser that waits for a header, unless one is given.
    pub fn new(mut parser: LineParser, header: Option<&str>) -> Result<Self, String> {
        let Some(header) = header else { return Ok(Self { parser, clock: Clock::Own }) };
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        let clock = match names.iter().position(|name| *name == "time_ms") {
            Some(place) => Clock::Milliseconds(place),
            None if names.iter().any(|name| matches!(*name, "time_s" | "time_us")) => Clock::Own,
            None => Clock::Arrival(None, -LEAST_STEP_S),
        };
        let header = match clock {
            Clock::Arrival(..) => format!("time_s,{header}"),
            _ => header.replace("time_ms", "time_s"),
        };
        match parser.take(header.as_bytes()) {
            Ok(Line::Header) => Ok(Self { parser, clock }),
            Ok(_) => Err("--header: expected names of columns".into()),
            Err(fault) => Err(format!("--header: expected {}", fault.expected)),
        }
    }

    /// Takes a line that has arrived at a time, s.
    pub fn take(&mut self, line: &str, arrived_s: f64) -> Result<Line, BadContent> {
        if line.trim().is_empty() {
            return Ok(Line::Nothing);
        }
        match &mut self.clock {
            Clock::Own => self.parser.take(line.as_bytes()),
            Clock::Milliseconds(place) => {
                let line = with_seconds(line, *place);
                self.parser.take(line.as_bytes())
            }
            Clock::Arrival(first_s, last_s) => {
                let elapsed_s = arrived_s - *first_s.get_or_insert(arrived_s);
                *last_s = elapsed_s.max(*last_s + LEAST_STEP_S);
                self.parser.take(format!("{last_s:.6},{line}").as_bytes())
            }
        }
    }
}

/// Converts a cell of milliseconds to seconds; the line stays as it is if the cell is not a number.
fn with_seconds(line: &str, place: usize) -> String {
    let seconds = |cell: &str| cell.trim().parse().map_or_else(|_| cell.to_owned(), |ms: f64| (ms / 1e3).to_string());
    let cells = line.split(',').enumerate();
    cells.map(|(k, cell)| if k == place { seconds(cell) } else { cell.to_owned() }).collect::<Vec<_>>().join(",")
}
