use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};

use ohmstrain_calib::{Filter, Output, Rows, SensorParams};
use tempfile::SpooledTempFile;

use crate::args::SmoothArgs;
use crate::error::CliError;
use crate::estimates::{EstimateRow, EstimateWriter};
use crate::input::{self, Recording, check_unit};
use crate::readings::Readings;
use crate::run::{filter, no_smoother, rest_reading, step_error};
use crate::sensor_file;
use crate::suits;
use crate::validity::ValidityWatch;

/// Smooths a recording and writes its estimates, all of them or none. Of a long one, readings and rates are held in memory, and
/// the states of a few thousand rows; estimates, which come out last segment first, wait in a temporary file.
pub fn run(args: &SmoothArgs) -> Result<(), CliError> {
    let wanted = args.estimate.estimator.chosen().map(|estimator| estimator.0);
    let mut params = sensor_file::read(&args.estimate.sensor, wanted)?;
    let kind = args.estimate.kind(&params);
    let rows = input::open(&args.trace_file, &args.estimate.trace.metadata())?;
    let header = input::header(&rows);
    check_unit(&header, rows.reading_kind(), params.reading)?;
    input::take_joint(&mut params, rows.metadata());
    let name = rows.file().to_string();
    let readings = Readings::collect(rows)?;
    let rest_reading = rest_reading(args.estimate.rest_resistance, &params, readings.values(), &name)?;
    suits::check_readings(&header, &params, rest_reading, readings.values())?;
    let mut filter = filter(&params, kind.smoother(), &args.estimate)?;
    let writer = EstimateWriter::new(Segments::new(), &params, &args.estimate.columns)?;
    let mut rates = vec![f32::NAN; readings.len()];
    let segments = smooth_into(writer, filter.as_mut(), &readings, rest_reading, &name, &mut rates)?;
    let mut watch = ValidityWatch::new(&name, &params, rest_reading);
    for (row, rate) in rates.into_iter().enumerate() {
        let (time_s, reading) = readings.recorded(row);
        watch.see(time_s, reading, rate.into(), f64::NAN, &mut |warning| CliError::warning(&warning));
    }
    segments.write_in_order(&mut io::stdout().lock())
}

/// Writes the smoothed rows of a recording, last segment first, and keeps their rates.
fn smooth_into(
    mut writer: EstimateWriter<Segments>,
    filter: &mut dyn Filter,
    readings: &Readings,
    rest_reading: f64,
    name: &str,
    rates: &mut [f32],
) -> Result<Segments, CliError> {
    let failed = |(row, error)| step_error(name, row, error);
    writer.get_mut().end_segment()?;
    let row = |row: usize| readings.relative(row, rest_reading);
    let mut back = filter.way_back(Rows::new(readings.len(), &row)).map_err(failed)?;
    let (mut outputs, mut first) = (Vec::new(), readings.len());
    while let Some(rows) = back.next_segment(&mut outputs).map_err(failed)? {
        first = rows.start;
        for (row, output) in rows.zip(&outputs) {
            let (time_s, reading) = readings.recorded(row);
            let saturated = readings.is_saturated(row);
            rates[row] = output.estimate.rate.mean as f32;
            writer.write(&EstimateRow { time_s, reading, saturated, rest_reading, output: *output })?;
        }
        writer.get_mut().end_segment()?;
    }
    if first == 0 { Ok(writer.into_inner()) } else { Err(no_smoother()) }
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
pub fn write_estimates(
    out: impl Write,
    recording: &Recording,
    params: &SensorParams,
    rest_reading: f64,
    outputs: &[Output],
    columns: &[String],
) -> Result<(), CliError> {
    let trace = &recording.trace;
    let saturated = trace.readings.converter.as_ref().map(|converter| converter.saturated.as_slice());
    let mut writer = EstimateWriter::new(out, params, columns)?;
    for (k, output) in outputs.iter().enumerate() {
        writer.write(&EstimateRow {
            time_s: trace.time_s[k],
            reading: trace.readings.values[k],
            saturated: saturated.and_then(|saturated| saturated.get(k).copied()).unwrap_or(false),
            rest_reading,
            output: *output,
        })?;
    }
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
