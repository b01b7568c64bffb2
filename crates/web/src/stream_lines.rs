//! Lines of a board as those of a trace: times that they have not, or have in milliseconds.

use ohmstrain_bench_data::{BadContent, Line, LineParser};

/// Between lines that arrive at once, s: two digits above what is written.
const LEAST_STEP_S: f64 = 1e-4;

/// Source of the lines' times.
enum Clock {
    /// Times in the lines themselves.
    Own,
    /// A cell of the lines counts milliseconds.
    Milliseconds(usize),
    /// They arrive then: the first time, and the last one since, s.
    Arrival(Option<f64>, f64),
}

/// Takes lines.
pub struct Lines {
    pub parser: LineParser,
    clock: Clock,
}

impl Lines {
    /// Waits for a header unless one is given.
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

/// The line with a cell of milliseconds in seconds; as it is if that is no number.
fn with_seconds(line: &str, place: usize) -> String {
    let seconds = |cell: &str| cell.trim().parse().map_or_else(|_| cell.to_owned(), |ms: f64| (ms / 1e3).to_string());
    let cells = line.split(',').enumerate();
    cells.map(|(k, cell)| if k == place { seconds(cell) } else { cell.to_owned() }).collect::<Vec<_>>().join(",")
}
