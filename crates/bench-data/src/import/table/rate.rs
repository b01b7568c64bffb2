//! Rows per second, as lines above the data speak of them.

use crate::import::table::grid::Grid;
use crate::import::words::{DecimalMark, number};

/// What such a line has before the number.
const WORDS: [&str; 14] = [
    "sampling rate",
    "sample rate",
    "samplerate",
    "sampling frequency",
    "sample frequency",
    "frame rate",
    "framerate",
    "frames per second",
    "fps",
    "scan rate",
    "acquisition rate",
    "data rate",
    "frequency",
    "abtastrate",
];

/// The rate of the last line above the data that has one, Hz, and the number of the line.
pub(crate) fn rate(grid: &Grid, decimal: DecimalMark, data: usize) -> Option<(f64, u64)> {
    let of = |row: usize| {
        let cells: Vec<String> = grid.cells(row).iter().map(ToString::to_string).collect();
        Some((rate_of(&cells.join(" "), decimal)?, grid.line(row)))
    };
    (0..data).rev().find_map(of)
}

fn rate_of(line: &str, decimal: DecimalMark) -> Option<f64> {
    let lower = line.to_lowercase();
    let behind = WORDS.iter().find_map(|word| lower.split_once(word)).map(|(_, behind)| behind)?;
    let start = behind.find(|c: char| c.is_ascii_digit())?;
    let end = behind[start..]
        .find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | ',')))
        .map_or(behind.len(), |end| start + end);
    let prefix = behind[..start].to_owned() + behind[end..].trim_start();
    let kilo = if prefix.contains("khz") { 1e3 } else { 1.0 };
    number(behind[start..end].trim_end_matches(['.', ',']), decimal, 0)
        .map(|hz| kilo * hz)
        .filter(|hz| (1e-3..1e7).contains(hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_speaks_of_a_rate() {
        for (line, hz) in [
            ("Sampling rate: 250 Hz", Some(250.0)),
            ("# sample rate (kHz) = 1.5", Some(1500.0)),
            ("FREQUENCY 100", Some(100.0)),
            ("Capture Frame Rate 120.000000 Export", Some(120.0)),
            ("30 fps", None),
            ("Rate of interest", None),
        ] {
            assert_eq!(rate_of(line, DecimalMark::Point), hz, "{line}");
        }
    }
}
