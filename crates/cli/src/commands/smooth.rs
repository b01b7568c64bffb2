use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::ops::Range;

use ohmstrain::{Estimate, FilterBuilder, Sensor, ValidityWatch};
use tempfile::SpooledTempFile;

use crate::args::{Format, SmoothArgs};
use crate::error::CliError;
use crate::estimates::{EstimateWriter, Packed, columns};
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
    let columns = columns(&sensor, &args.written.columns)?;
    let mut rates = vec![f32::NAN; readings.len()];
    let segments = smooth_into(Packed::new(columns.clone()), builder, &readings, &mut rates)
        .map_err(|error| error.named(&name))?;
    suits::warn_of_start(args.estimate.initial_strain, &sensor);
    let mut watch = ValidityWatch::new(&sensor, rest);
    for (row, rate) in rates.into_iter().enumerate() {
        let (time_s, reading) = readings.row(row);
        for warning in watch.see(time_s, reading.value, rate.into(), f64::NAN) {
            CliError::warning(&format!("{name}: {warning}"));
        }
    }
    let out = BufWriter::with_capacity(WRITTEN_AT_ONCE, io::stdout());
    let mut writer = EstimateWriter::new(out, args.written.format, columns)?;
    segments.write_in_order(&mut writer)?;
    writer.finish()
}

/// Smooths a recording, and keeps its rates.
fn smooth_into(
    packed: Packed,
    builder: FilterBuilder,
    readings: &Readings,
    rates: &mut [f32],
) -> Result<Segments, CliError> {
    let mut segments = Segments::new(packed);
    builder.smooth_backward(
        readings.len(),
        |row| readings.row(row),
        |rows: Range<usize>, estimates| {
            for (rate, estimate) in rates[rows].iter_mut().zip(estimates) {
                *rate = estimate.strain_rate as f32;
            }
            segments.push(estimates)
        },
    )?;
    Ok(segments)
}

/// Bytes handed to standard output at once.
const WRITTEN_AT_ONCE: usize = 1 << 16;

/// Bytes of estimates that wait in memory; more of them wait in a temporary file.
const WAIT_IN_MEMORY: usize = 16 << 20;

/// Segments of rows that came last segment first.
struct Segments {
    packed: Packed,
    written: SpooledTempFile,
    /// Where each segment ends.
    ends: Vec<u64>,
    /// The segment at hand.
    bytes: Vec<u8>,
}

impl Segments {
    fn new(packed: Packed) -> Self {
        Self { packed, written: tempfile::spooled_tempfile(WAIT_IN_MEMORY), ends: vec![0], bytes: Vec::new() }
    }

    fn push(&mut self, rows: &[Estimate]) -> Result<(), CliError> {
        self.bytes.clear();
        rows.iter().for_each(|row| self.packed.push(row, &mut self.bytes));
        self.written.write_all(&self.bytes).map_err(temporary)?;
        let end = self.ends.last().unwrap_or(&0) + self.bytes.len() as u64;
        self.ends.push(end);
        Ok(())
    }

    /// The segments in order of time.
    fn write_in_order<W: Write + Send>(mut self, out: &mut EstimateWriter<W>) -> Result<(), CliError> {
        for place in self.ends.windows(2).rev() {
            self.bytes.resize((place[1] - place[0]) as usize, 0);
            self.written.seek(SeekFrom::Start(place[0])).map_err(temporary)?;
            self.written.read_exact(&mut self.bytes).map_err(temporary)?;
            self.packed.unpack(&self.bytes, out)?;
        }
        Ok(())
    }
}

/// The temporary file fails, which is not a closed pipe.
fn temporary(error: io::Error) -> CliError {
    CliError::Other(format!("cannot keep estimates in a temporary file: {error}"))
}

/// Writes a whole recording's estimates.
pub fn write_estimates(out: impl Write + Send, sensor: &Sensor, estimates: &[Estimate]) -> Result<(), CliError> {
    let mut writer = EstimateWriter::new(out, Format::Csv, sensor.columns())?;
    estimates.iter().try_for_each(|row| writer.write(row))?;
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Segments that fit in memory, and such that do not.
    #[test]
    fn segments_come_out_in_order_of_time() {
        let text = include_str!("../../../ohmstrain/examples/sensor.toml");
        let sensor = Sensor::from_toml(text).unwrap();
        let mut filter = sensor.filter().build().unwrap();
        let rows: Vec<Estimate> = (0..9).map(|k| filter.step(0.05 * f64::from(k), 1600.0).unwrap()).collect();
        for repeated in [1, WAIT_IN_MEMORY / 900] {
            let all: Vec<Estimate> = rows.chunks(3).flat_map(|rows| rows.repeat(repeated)).collect();
            let mut segments = Segments::new(Packed::new(sensor.columns()));
            all.chunks(3 * repeated).rev().for_each(|rows| segments.push(rows).unwrap());
            assert_eq!(segments.written.is_rolled(), repeated > 1);
            let (mut expected, mut out) = (Vec::new(), Vec::new());
            write_estimates(&mut expected, &sensor, &all).unwrap();
            let mut writer = EstimateWriter::new(&mut out, Format::Csv, sensor.columns()).unwrap();
            segments.write_in_order(&mut writer).unwrap();
            writer.finish().unwrap();
            assert!(out == expected, "{repeated} times");
        }
    }
}
