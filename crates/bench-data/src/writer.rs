use std::io::{self, Write};

use crate::columns::Column;
use crate::trace::{Quantity, ReadingKind, Trace};

impl Trace {
    /// Writes the recording in the schema that [`Trace::read`] reads: metadata lines, header, rows.
    ///
    /// Numbers are written with as many digits as bring them back exactly. Readings that came from a converter are
    /// written as its codes, displacements and angles that became strains are written as strains.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "{}", self.metadata)?;
        let mut rows = csv::WriterBuilder::new().from_writer(out);
        rows.write_record(self.header().iter().map(|column| column.name())).map_err(io_error)?;
        let mut cells = Vec::new();
        for row in 0..self.len() {
            self.row_cells(row, &mut cells);
            rows.write_record(&cells).map_err(io_error)?;
        }
        rows.flush()
    }

    fn header(&self) -> Vec<Column> {
        let reading = match (&self.readings.converter, self.readings.kind) {
            (Some(_), _) => Column::Adc,
            (None, ReadingKind::Ohm) => Column::ResistanceOhm,
            (None, ReadingKind::Ratio) => Column::ResistanceRatio,
        };
        let reference = self.reference.as_ref().map(|reference| match reference.quantity {
            Quantity::Strain => Column::Strain,
            Quantity::AngleDeg => Column::AngleDeg,
        });
        let temperature = self.temperature_c.as_ref().map(|_| Column::TemperatureC);
        [Some(Column::TimeS), Some(reading), reference, temperature].into_iter().flatten().collect()
    }

    fn row_cells(&self, row: usize, cells: &mut Vec<String>) {
        cells.clear();
        cells.push(self.time_s[row].to_string());
        cells.push(match &self.readings.converter {
            Some(converter) => converter.codes[row].map_or_else(|| MISSING.to_owned(), |code| code.to_string()),
            None => number(self.readings.values[row]),
        });
        cells.extend(self.reference.iter().map(|reference| number(reference.values[row])));
        cells.extend(self.temperature_c.iter().map(|temperature| number(temperature[row])));
    }
}

/// What `out` said; the csv crate's own conversion forgets the kind, and with it that a pipe is closed.
fn io_error(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        kind => io::Error::other(format!("{kind:?}")),
    }
}

/// A word rather than nothing, so that no row looks short.
const MISSING: &str = "NaN";

fn number(value: f64) -> String {
    if value.is_nan() { MISSING.to_owned() } else { value.to_string() }
}
