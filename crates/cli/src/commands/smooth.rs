use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::Range;

use ohmstrain::{Estimate, FilterBuilder, Sensor, ValidityWatch};
use tempfile::SpooledTempFile;

use crate::args::SmoothArgs;
use crate::error::CliError;
use crate::estimates::EstimateWriter;
use crate::input::{self, check_unit};
use crate::readings::Readings;
use crate::run::{builder, rest_resistance};
use crate::sensor_file;
use crate::suits;

/// Smooths a recording and writes its estimates, all of them or none. Of a long one, readings and rates are held in memory, and
/// the states of a few thousand rows; estimates, which come out last segment first, wait in a temporary file.
pub fn run(args: &SmoothArgs) -> Result<(), CliError> {
    let wanted = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let mut sensor = sensor_file::read(&args.estimate.sensor, wanted)?;
    let rows = input::open(&args.trace_file, &args.estimate.trace.metadata())?;
    let header = input::header(&rows);
    check_unit(&header, rows.reading_kind(), sensor.params().reading)?;
    if let Some(joint) = input::joint(rows.metadata()) {
        sensor = sensor.on_joint(joint)?;
    }
    let name = rows.file().to_string();
    let readings = Readings::collect(rows)?;
    let rest = rest_resistance(args.estimate.rest_resistance, readings.values(), &name)?;
    suits::check_readings(&header, &sensor, rest, readings.values())?;
    let builder = builder(&sensor, &args.estimate);
    let builder = rest.map_or(builder, |measured| builder.rest_resistance(measured));
    let writer = EstimateWriter::new(Segments::new(), &sensor, &args.columns)?;
    let mut rates = vec![f32::NAN; readings.len()];
    let segments = smooth_into(writer, builder, &readings, &mut rates).map_err(|error| error.named(&name))?;
    suits::warn_of_start(args.estimate.initial_strain, &sensor);
    let mut watch = ValidityWatch::new(&sensor, rest);
    for (row, rate) in rates.into_iter().enumerate() {
        let (time_s, reading) = readings.row(row);
        for warning in watch.see(time_s, reading.value, rate.into(), f64::NAN) {
            CliError::warning(&format!("{name}: {warning}"));
        }
    }
    segments.write_in_order(&mut io::stdout().lock())
}

/// Writes the smoothed rows of a recording, last segment first, and keeps their rates.
fn smooth_into(
    mut writer: EstimateWriter<Segments>,
    builder: FilterBuilder,
    readings: &Readings,
    rates: &mut [f32],
) -> Result<Segments, CliError> {
    writer.get_mut().end_segment()?;
    builder.smooth_backward(
        readings.len(),
        |row| readings.row(row),
        |rows: Range<usize>, estimates| {
            for (rate, estimate) in rates[rows].iter_mut().zip(estimates) {
                *rate = estimate.strain_rate as f32;
                writer.write(estimate)?;
            }
            writer.get_mut().end_segment()
        },
    )?;
    Ok(writer.into_inner())
}

/// Bytes of estimates that wait in memory; more of them wait in a temporary file.
const WAIT_IN_MEMORY: usize = 16 << 20;

/// A header and segments of rows that were written last segment first.
struct Segments {
    written: BufWriter<SpooledTempFile>,
    /// Where the header and each segment end.
    ends: Vec<u64>,
}

impl Segments {
    fn new() -> Self {
        let file = tempfile::spooled_tempfile(WAIT_IN_MEMORY);
        Self { written: BufWriter::new(file), ends: Vec::new() }
    }

    fn end_segment(&mut self) -> Result<(), CliError> {
        self.ends.push(self.written.stream_position().map_err(temporary)?);
        Ok(())
    }

    /// The header, then the segments in order of time.
    fn write_in_order(mut self, out: &mut impl Write) -> Result<(), CliError> {
        self.written.flush().map_err(temporary)?;
        let file = self.written.get_mut();
        let segments = self.ends.windows(2).rev().map(|ends| ends[0]..ends[1]);
        let header = self.ends.first().map(|end| 0..*end);
        for place in header.into_iter().chain(segments) {
            file.seek(SeekFrom::Start(place.start)).map_err(temporary)?;
            io::copy(&mut (&mut *file).take(place.end - place.start), out)?;
        }
        Ok(out.flush()?)
    }
}

impl Write for Segments {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.written.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.written.flush()
    }
}

/// The temporary file fails, which is not a closed pipe.
fn temporary(error: io::Error) -> CliError {
    CliError::Other(format!("cannot keep estimates in a temporary file: {error}"))
}

/// Writes a whole recording's estimates.
pub fn write_estimates(out: impl Write, sensor: &Sensor, estimates: &[Estimate]) -> Result<(), CliError> {
    let mut writer = EstimateWriter::new(out, sensor, &[])?;
    estimates.iter().try_for_each(|row| writer.write(row))?;
    writer.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Segments that fit in memory, and such that do not.
    #[test]
    fn segments_come_out_in_order_of_time() {
        for rows in [3, WAIT_IN_MEMORY] {
            let mut segments = Segments::new();
            segments.write_all(b"header\n").unwrap();
            segments.end_segment().unwrap();
            for letter in [b"c", b"b", b"a"] {
                segments.write_all(&letter.repeat(rows)).unwrap();
                segments.end_segment().unwrap();
            }
            let mut out = Vec::new();
            segments.write_in_order(&mut out).unwrap();
            let expected = [b"header\n".to_vec(), b"a".repeat(rows), b"b".repeat(rows), b"c".repeat(rows)].concat();
            assert!(out == expected, "{rows} rows");
        }
    }
}
