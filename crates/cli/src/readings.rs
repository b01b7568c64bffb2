use std::cell::RefCell;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use ohmstrain::{Reading, Thermometer};
use ohmstrain_bench_data::{TraceError, TraceReader};
use tempfile::SpooledTempFile;

use crate::error::CliError;

/// Bytes that are buffered in memory; more of them go to a temporary file.
pub const WAIT_IN_MEMORY: usize = 16 << 20;

/// Readings of a recording that may exceed memory, without its other columns. Bytes beyond 16 MB go to a temporary file, from
/// which rows are read by the thousand.
pub struct StoredReadings {
    /// True if a row contains, besides time and value, the deviation of a converter's reading and a byte for saturation.
    has_codes: bool,
    len: usize,
    implausible_temperatures: usize,
    kept: RefCell<Kept>,
}

/// The file, and the rows around the one that was requested last.
struct Kept {
    file: SpooledTempFile,
    first: usize,
    rows: Vec<(f64, Reading)>,
    bytes: Vec<u8>,
    /// Error that prevents rows from being read back.
    failed: Option<io::Error>,
}

/// Rows that are read back at once: those of a segment of the smoother, which passes through it twice.
const AT_ONCE: usize = 4096;
const NUMBER: usize = size_of::<f64>();

impl StoredReadings {
    /// Reads the remaining `rows`, at least one, as they would be at the thermometer's reference temperature.
    pub fn collect<R: Read>(mut rows: TraceReader<R>, mut thermometer: Thermometer) -> Result<Self, CliError> {
        let has_codes = rows.has_codes();
        let mut out = BufWriter::new(tempfile::spooled_tempfile(WAIT_IN_MEMORY));
        let mut len = 0;
        for row in rows.by_ref() {
            let row =
                row.map_err(|error| late(error, "give each part a file of its own, or `filter --skip-bad` both"))?;
            let mut put = |number: f64| out.write_all(&number.to_le_bytes()).map_err(|error| temporary(&error));
            put(row.time_s)?;
            put(thermometer.at_reference(row.reading.value, row.temperature_c))?;
            if has_codes {
                put(row.reading.sd_ohm.unwrap_or(f64::NAN))?;
                out.write_all(&[row.reading.saturated.into()]).map_err(|error| temporary(&error))?;
            }
            len += 1;
        }
        if len == 0 {
            return Err(no_row(rows.file(), rows.line()));
        }
        let file = out.into_inner().map_err(|error| temporary(error.error()))?;
        let kept = Kept { file, first: 0, rows: Vec::new(), bytes: Vec::new(), failed: None };
        Ok(Self { has_codes, len, implausible_temperatures: thermometer.implausible(), kept: RefCell::new(kept) })
    }

    /// Returns the number of implausible temperatures.
    pub const fn implausible_temperatures(&self) -> usize {
        self.implausible_temperatures
    }

    /// Returns the number of rows.
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Returns all readings as recorded; NaN where missing.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        (0..self.len).map(|row| self.row(row).1.value)
    }

    /// Returns the time, s, and the reading of a row; NaN if it cannot be read back, which [`Self::whole`] then reports.
    pub fn row(&self, row: usize) -> (f64, Reading) {
        let mut kept = self.kept.borrow_mut();
        if kept.failed.is_none() && (kept.rows.is_empty() || row / AT_ONCE != kept.first / AT_ONCE) {
            let first = row - row % AT_ONCE;
            kept.failed = kept.take_out(first, AT_ONCE.min(self.len - first), self.has_codes).err();
        }
        let known = kept.failed.is_none().then(|| kept.rows[row - kept.first]);
        known.unwrap_or((f64::NAN, Reading { value: f64::NAN, sd: 0.0, saturated: false }))
    }

    /// Fails unless all requested rows could be read back.
    pub fn whole(&self) -> Result<(), CliError> {
        self.kept.borrow().failed.as_ref().map_or(Ok(()), |error| Err(temporary(error)))
    }
}

impl Kept {
    fn take_out(&mut self, first: usize, count: usize, has_codes: bool) -> io::Result<()> {
        let row_len = if has_codes { 3 * NUMBER + 1 } else { 2 * NUMBER };
        self.bytes.resize(count * row_len, 0);
        self.file.seek(SeekFrom::Start((first * row_len) as u64))?;
        self.file.read_exact(&mut self.bytes)?;
        self.first = first;
        self.rows.clear();
        self.rows.extend(self.bytes.chunks_exact(row_len).map(unpacked));
        Ok(())
    }
}

fn unpacked(row: &[u8]) -> (f64, Reading) {
    let (numbers, saturated) = row.as_chunks::<NUMBER>();
    let number = |place: usize| numbers.get(place).map(|bytes| f64::from_le_bytes(*bytes));
    let reading = Reading {
        value: number(1).unwrap_or(f64::NAN),
        sd: number(2).unwrap_or(0.0),
        saturated: saturated.first().is_some_and(|byte| *byte != 0),
    };
    (number(0).unwrap_or(f64::NAN), reading)
}

/// Creates the error of a temporary file, which is not a closed pipe.
pub fn temporary(error: &io::Error) -> CliError {
    CliError::Other(format!("cannot keep rows in a temporary file: {error}"))
}

/// Creates the error of a row; for a row out of order, with advice on a clock that has restarted.
pub fn late(error: TraceError, hint: &str) -> CliError {
    match error {
        TraceError::Content(fault) if fault.is_late => {
            CliError::Input(format!("{fault}; if the clock has started again there, {hint}"))
        }
        error => error.into(),
    }
}

/// Creates the error of a recording that ends before its first row.
pub fn no_row(file: &str, line: u64) -> CliError {
    let none = "expected at least one row of data, found the end of the file";
    CliError::Input(format!("{file}:{}: {none}", line + 1))
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;

    /// Tests rows in a smoother's order: forward, then segment by segment backwards. Their number exceeds the memory buffer, or
    /// is small.
    #[test]
    fn rows_come_out_as_they_went_in() {
        let sensor = ohmstrain::Sensor::from_toml(include_str!("../tests/fixtures/sensor.toml")).unwrap();
        for rows in [10, WAIT_IN_MEMORY / (2 * NUMBER) + 5000] {
            let mut text = String::from("time_s,resistance_ohm\n");
            let value = |row: usize| if row % 7 == 3 { None } else { Some(1000 + row % 911) };
            for row in 0..rows {
                let cell = value(row).map_or_else(String::new, |value| value.to_string());
                writeln!(text, "{row},{cell}").unwrap();
            }
            let written = TraceReader::new(text.as_bytes(), "t.csv").unwrap();
            let readings = StoredReadings::collect(written, Thermometer::new(&sensor)).unwrap();
            assert_eq!(readings.len(), rows);
            assert_eq!(readings.kept.borrow().file.is_rolled(), rows > 10);
            let backwards = (0..rows.div_ceil(AT_ONCE)).rev().flat_map(|at| at * AT_ONCE..rows.min((at + 1) * AT_ONCE));
            for row in (0..rows).chain(backwards) {
                let (time_s, reading) = readings.row(row);
                assert!(time_s == row as f64 && reading.sd == 0.0 && !reading.saturated);
                assert_eq!(reading.value.is_finite().then_some(reading.value as usize), value(row), "row {row}");
            }
            assert!(readings.kept.borrow().rows.len() <= AT_ONCE);
            readings.whole().unwrap();
        }
    }
}
