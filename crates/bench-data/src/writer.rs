use std::io::{self, Write};

use crate::columns::Column;
use crate::rows::RowWriter;
use crate::trace::Trace;

impl Trace {
    /// Writes the recording in the schema that [`Trace::read`] reads: metadata lines, header, rows.
    ///
    /// Numbers have as many digits as are needed to read them back exactly. Readings from a converter are written as
    /// its codes; displacements and angles that became strains are written as strains.
    ///
    /// # Errors
    /// The error of `out`.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "{}", self.metadata)?;
        let mut rows = RowWriter::new(io::BufWriter::new(out));
        for column in self.header() {
            rows.text(column.name());
        }
        rows.end()?;
        for row in 0..self.len() {
            self.write_row(row, &mut rows)?;
        }
        rows.flush()
    }

    /// Returns the recording as [`Trace::write`] writes it, marked with the program that made it.
    ///
    /// # Errors
    /// If a number cannot be written.
    pub fn marked(mut self, made_by: &str) -> io::Result<Vec<u8>> {
        self.metadata.set_made_by(made_by);
        let mut bytes = Vec::new();
        self.write(&mut bytes)?;
        Ok(bytes)
    }

    fn header(&self) -> Vec<Column> {
        let reference = self.reference.as_ref().map(|reference| Column::of_reference(reference.quantity));
        let has_sd = self.reference.as_ref().is_some_and(|reference| !reference.sd.is_empty());
        let deviation = reference.filter(|_| has_sd).and_then(Column::deviation);
        let temperature = self.temperature_c.as_ref().map(|_| Column::TemperatureC);
        [Some(Column::TimeS), Some(self.readings.column()), reference, deviation, temperature]
            .into_iter()
            .flatten()
            .collect()
    }

    fn write_row(&self, row: usize, rows: &mut RowWriter<impl Write>) -> io::Result<()> {
        rows.number(self.time_s[row]);
        number(rows, self.readings.written(row));
        let reference = self.reference.iter().flat_map(|reference| [&reference.values, &reference.sd]);
        for values in reference.filter(|values| !values.is_empty()).chain(&self.temperature_c) {
            number(rows, values[row]);
        }
        rows.end()
    }
}

/// Missing value: a word rather than nothing, so that no row looks short.
const MISSING: &str = "NaN";

fn number(rows: &mut RowWriter<impl Write>, value: f64) {
    if value.is_nan() { rows.text(MISSING) } else { rows.number(value) }
}
