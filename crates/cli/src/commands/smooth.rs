use std::io::{Read, Seek, SeekFrom, Write};

use ohmstrain::trace::{self, check_unit};
use ohmstrain::{Estimate, FilterBuilder, Sensor, Thermometer, ValidityWatch};
use tempfile::SpooledTempFile;

use crate::args::{Format, SmoothArgs, WrittenArgs};
use crate::commands::hand;
use crate::error::CliError;
use crate::estimates::{self, EstimateWriter, Packed};
use crate::input;
use crate::messages::Messages;
use crate::output::RowsOut;
use crate::readings::{StoredReadings, WAIT_IN_MEMORY, temporary};
use crate::run::{builder, rest_resistance};
use crate::sensor_file;
use crate::suits::{self, Unlike};

/// Smooths a recording, writes its estimates, all or none, and returns the number of rows. For a long recording, memory holds
/// the states of a few thousand rows, and one state for each further block of as many. Readings, and estimates, which are
/// produced last segment first, wait in temporary files.
pub fn run(args: &SmoothArgs, messages: &Messages) -> Result<u64, CliError> {
    if sensor_file::is_of_a_hand(&args.estimate.sensor) {
        return hand::smooth::run(args, messages);
    }
    let wanted = args.estimate.estimator.chosen();
    let WrittenArgs { output, replace, columns, .. } = &args.written;
    let inputs = [&args.trace_file, &args.estimate.sensor];
    let mut rows_out = RowsOut::claim(output.as_deref(), columns, replace.force, inputs)?;
    let mut sensor = sensor_file::read(&args.estimate.sensor, wanted)?;
    let rows = input::open(&args.trace_file, &args.estimate.units.metadata())?;
    let header = trace::header(rows.file(), rows.line());
    check_unit(&header, rows.reading_kind(), sensor.params().reading)?;
    if let Some(joint) = trace::joint(rows.metadata()) {
        sensor = sensor.on_joint(joint)?;
    }
    let name = rows.file().to_string();
    sensor = suits::sensor_for(sensor, rows.has_temperature(), &name, messages);
    let readings = StoredReadings::collect(rows, Thermometer::new(&sensor))?;
    let rest = rest_resistance(args.estimate.rest_resistance, &sensor, readings.values(), &name)?;
    suits::check_readings(&header, &sensor, rest, readings.values())?;
    suits::warn_of_temperatures(readings.implausible_temperatures(), &name, messages);
    suits::warn_of_clock(&header, &sensor, (0..readings.len()).map(|row| readings.row(row).0), messages);
    let builder = builder(&sensor, &args.estimate);
    let builder = rest.map_or(builder, |measured| builder.rest_resistance(measured));
    let columns = estimates::columns(&sensor, columns)?;
    let mut unlike = Unlike::default();
    let segments = smooth_into(Packed::new(columns.clone()), builder, &readings, &mut unlike);
    readings.whole()?;
    let segments = segments.map_err(|error| error.named(&name))?;
    suits::warn_of_start(args.estimate.initial_strain, &sensor, messages);
    if let Some(last) = readings.len().checked_sub(1) {
        suits::warn_of_unused(&args.estimate.known, (readings.row(0).0, readings.row(last).0), &name, messages);
    }
    let mut watch = ValidityWatch::new(&sensor, rest);
    let see = |row: usize, rate: f32| {
        let (time_s, reading) = readings.row(row);
        for warning in watch.see(time_s, reading.value, rate.into(), f64::NAN) {
            messages.warning(&format!("{name}: {warning}"));
            unlike.is_warned = true;
        }
    };
    let mut writer = EstimateWriter::new(rows_out.open(false)?, args.written.format(), columns)?;
    segments.write_in_order(&mut writer, see)?;
    readings.whole()?;
    let written = writer.finish()?;
    unlike.warn(&name, messages);
    rows_out.outputs.publish()?;
    Ok(written)
}

fn smooth_into(
    packed: Packed,
    builder: FilterBuilder,
    readings: &StoredReadings,
    unlike: &mut Unlike,
) -> Result<Segments, CliError> {
    let mut segments = Segments::new(packed);
    let mut take = |estimates: &[Estimate]| {
        unlike.see(estimates);
        segments.push(estimates)
    };
    builder.smooth_backward(readings.len(), |row| readings.row(row), |_, estimates| take(estimates))?;
    Ok(segments)
}

/// Segments of rows in reverse order of time: for each its rates, then its packed rows.
struct Segments {
    packed: Packed,
    written: SpooledTempFile,
    /// End of each segment.
    ends: Vec<u64>,
    /// The current segment.
    bytes: Vec<u8>,
}

impl Segments {
    fn new(packed: Packed) -> Self {
        Self { packed, written: tempfile::spooled_tempfile(WAIT_IN_MEMORY), ends: vec![0], bytes: Vec::new() }
    }

    fn push(&mut self, rows: &[Estimate]) -> Result<(), CliError> {
        self.bytes.clear();
        rows.iter().for_each(|row| self.bytes.extend((row.strain_rate as f32).to_le_bytes()));
        rows.iter().for_each(|row| self.packed.push(row, &mut self.bytes));
        self.written.write_all(&self.bytes).map_err(|error| temporary(&error))?;
        let end = self.ends.last().unwrap_or(&0) + self.bytes.len() as u64;
        self.ends.push(end);
        Ok(())
    }

    /// Writes the segments in order of time; `see` receives the number and rate of every row.
    fn write_in_order<W: Write + Send>(
        mut self,
        out: &mut EstimateWriter<W>,
        mut see: impl FnMut(usize, f32),
    ) -> Result<(), CliError> {
        let mut row = 0;
        for place in self.ends.windows(2).rev() {
            self.bytes.resize((place[1] - place[0]) as usize, 0);
            self.written.seek(SeekFrom::Start(place[0])).map_err(|error| temporary(&error))?;
            self.written.read_exact(&mut self.bytes).map_err(|error| temporary(&error))?;
            let rows = self.bytes.len() / (RATE_BYTES + self.packed.row_len());
            let (rates, packed) = self.bytes.split_at(rows * RATE_BYTES);
            for rate in rates.as_chunks::<RATE_BYTES>().0 {
                see(row, f32::from_le_bytes(*rate));
                row += 1;
            }
            self.packed.unpack(packed, out)?;
        }
        Ok(())
    }
}

const RATE_BYTES: usize = size_of::<f32>();

/// Writes a whole recording's estimates.
pub fn write_estimates(out: impl Write + Send, sensor: &Sensor, estimates: &[Estimate]) -> Result<u64, CliError> {
    let mut writer = EstimateWriter::new(out, Format::Csv, sensor.columns())?;
    estimates.iter().try_for_each(|row| writer.write(row))?;
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests segments that fit in memory, and segments that do not.
    #[test]
    fn segments_come_out_in_order_of_time() {
        let text = include_str!("../../tests/fixtures/sensor.toml");
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
            let mut rates = Vec::new();
            segments.write_in_order(&mut writer, |row, rate| rates.push((row, rate))).unwrap();
            assert!(rates.iter().enumerate().all(|(k, (row, rate))| *row == k && *rate == all[k].strain_rate as f32));
            writer.finish().unwrap();
            assert!(out == expected, "{repeated} times");
        }
    }
}
