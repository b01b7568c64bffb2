use std::io::Read;

use ohmstrain_bench_data::TraceReader;
use ohmstrain_ekf::Reading;

use crate::error::CliError;
use crate::run::relative;

/// The readings of a long recording, and nothing else of it: 16 bytes a row, 25 for those of a converter.
pub struct Readings {
    time_s: Vec<f64>,
    values: Vec<f64>,
    converter: Option<Converter>,
}

/// What a converter's codes tell beyond the resistance.
#[derive(Default)]
struct Converter {
    sd_ohm: Vec<f64>,
    saturated: Vec<bool>,
}

impl Readings {
    /// Reads what is left in `rows`, at least one.
    pub fn collect<R: Read>(mut rows: TraceReader<R>) -> Result<Self, CliError> {
        let converter = rows.has_codes().then(Converter::default);
        let mut kept = Self { time_s: Vec::new(), values: Vec::new(), converter };
        for row in rows.by_ref() {
            let row = row?;
            kept.time_s.push(row.time_s);
            kept.values.push(row.reading.value);
            if let Some(converter) = &mut kept.converter {
                converter.sd_ohm.push(row.reading.sd_ohm.unwrap_or(f64::NAN));
                converter.saturated.push(row.reading.saturated);
            }
        }
        if kept.values.is_empty() { Err(no_row(&rows)) } else { Ok(kept) }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// All readings as recorded; NaN where missing.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.values.iter().copied()
    }

    /// Time, s, and reading as recorded, of a row.
    pub fn recorded(&self, row: usize) -> (f64, f64) {
        (self.time_s[row], self.values[row])
    }

    /// Whether the converter stood at an end of its scale.
    pub fn is_saturated(&self, row: usize) -> bool {
        self.converter.as_ref().is_some_and(|converter| converter.saturated[row])
    }

    /// Time, s, and reading relative to R₀, of a row.
    pub fn relative(&self, row: usize, rest_reading: f64) -> (f64, Option<Reading<f64>>) {
        let sd_ohm = self.converter.as_ref().map(|converter| converter.sd_ohm[row]);
        (self.time_s[row], relative(self.values[row], sd_ohm, rest_reading))
    }
}

/// A recording has ended before its first row.
pub fn no_row<R: Read>(rows: &TraceReader<R>) -> CliError {
    let none = "expected at least one row of data, found the end of the file";
    CliError::Input(format!("{}:{}: {none}", rows.file(), rows.line() + 1))
}
