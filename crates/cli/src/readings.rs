use std::io::Read;

use ohmstrain::Reading;
use ohmstrain_bench_data::TraceReader;

use crate::error::CliError;

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

    /// Time, s, and reading of a row.
    pub fn row(&self, row: usize) -> (f64, Reading) {
        let value = self.values[row];
        let (sd, saturated) =
            self.converter.as_ref().map_or((0.0, false), |converter| (converter.sd_ohm[row], converter.saturated[row]));
        (self.time_s[row], Reading { value, sd, saturated })
    }
}

/// A recording has ended before its first row.
pub fn no_row<R: Read>(rows: &TraceReader<R>) -> CliError {
    let none = "expected at least one row of data, found the end of the file";
    CliError::Input(format!("{}:{}: {none}", rows.file(), rows.line() + 1))
}
