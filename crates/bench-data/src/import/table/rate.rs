//! Rows per second, as stated in lines above the data.

use crate::import::table::grid::Grid;
use crate::import::words::{DecimalMark, number};

/// Words of such a line, anywhere before the number.
const WORDS: [&str; 12] = [
    "sampling rate",
    "sample rate",
    "samplerate",
    "sampling frequency",
    "sample frequency",
    "frame rate",
    "framerate",
    "capture rate",
    "scan rate",
    "acquisition rate",
    "data rate",
    "abtastrate",
];
/// Words at its start; further on, a frequency is that of a current or of the motion.
const FIRST_WORDS: [&str; 4] = ["frequency", "rate", "fps", "fs"];

/// Returns the rate of the last line above the data that has one, Hz, and the number of the line.
pub(crate) fn rate(grid: &Grid, decimal: DecimalMark, data: usize) -> Option<(f64, u64)> {
    let of = |row: usize| {
        let cells: Vec<String> = grid.cells(row).iter().map(ToString::to_string).collect();
        Some((rate_of(&cells.join(" "), decimal)?, grid.line(row)))
    };
    (0..data).rev().find_map(of)
}

fn rate_of(line: &str, decimal: DecimalMark) -> Option<f64> {
    let lower = line.to_lowercase();
    let within = WORDS.iter().find_map(|word| lower.split_once(word)).map(|(_, behind)| behind);
    let bare = lower.trim_start_matches(['#', '%', '/', ' ']);
    let ends_word = |behind: &&str| !behind.starts_with(char::is_alphanumeric);
    let behind = within.or_else(|| FIRST_WORDS.iter().find_map(|word| bare.strip_prefix(word)).filter(ends_word))?;
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
            ("# rate_hz = 50", Some(50.0)),
            ("Test frequency: 1 kHz", None),
            ("30 fps", None),
            ("Rate of interest", None),
        ] {
            assert_eq!(rate_of(line, DecimalMark::Point), hz, "{line}");
        }
    }
}
