use std::path::Path;

use ohmstrain::trace::{self, FIRST_LIVE_READINGS, HandChannel, HandJoint, reading_column};
use ohmstrain::{
    Error, Estimate, Filter, FilterBuilder, FusedEstimate, FusedFilter, FusedSensor, Quantity, Reading, ReadingUnit,
    Sensor, UnitGuess,
};
use ohmstrain_bench_data::{BadContent, LineParser, Metadata};

use crate::channels::masked;
use crate::error::CliError;
use crate::sensor_file;
use crate::whole_file;

/// A joint with its channels and their filter.
pub struct Joint<'a> {
    pub name: &'a str,
    pub channels: Vec<Channel<'a>>,
    /// Fusion of the channels; `None` for a joint with one.
    pub fusion: Option<FusedSensor>,
    filter: JointFilter,
}

enum JointFilter {
    One(Box<Filter>),
    Fused(Box<FusedFilter>),
}

/// A column of readings with its sensor.
pub struct Channel<'a> {
    /// Name of its joint.
    pub joint: &'a str,
    pub entry: &'a HandChannel,
    pub sensor: Sensor,
    /// Reading of the rested sensor, if it differs from that in calibration.
    pub rest_resistance: Option<f64>,
    pub lines: LineParser,
    /// The first known readings.
    early: Vec<f64>,
}

/// Estimate of a joint in one row.
pub struct JointRow {
    /// Angle in degrees, or strain: the number that is reported.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Estimated strain, in the quantity that the sensors were calibrated on.
    pub strain: f64,
    /// Its standard deviation.
    pub strain_sd: f64,
    /// Flags, each behind the name of the joint or the column.
    pub flags: Vec<String>,
    /// Estimate of each channel by itself.
    pub channels: Vec<Estimate>,
}

impl<'a> Joint<'a> {
    /// Reads the sensors of a joint from the folder of the description, for a recording with this name.
    pub fn new(joint: &'a HandJoint, folder: &Path, file: &str) -> Result<Self, CliError> {
        let channel = |entry: &'a HandChannel| Channel::new(joint, entry, folder, file);
        let channels: Vec<Channel<'a>> = joint.channels.iter().map(channel).collect::<Result<_, _>>()?;
        let sensors = || channels.iter().map(|channel| channel.sensor.clone()).collect();
        let fusion = joint.fusion.as_ref().map(|path| {
            let path = folder.join(path);
            let text = whole_file::text(&path)?;
            let name = path.display().to_string();
            FusedSensor::from_toml(sensors(), &text).map_err(|error| CliError::Input(error.in_file(&name)))
        });
        let fusion = fusion.transpose()?;
        let filter = filter(&channels, fusion.as_ref())?;
        Ok(Self { name: &joint.name, channels, fusion, filter })
    }

    /// Returns the endings of its columns in the output.
    pub fn endings(&self) -> [&'static str; 2] {
        if self.is_strain() { ["_strain", "_strain_sd"] } else { ["_deg", "_sd_deg"] }
    }

    /// True if it reports a strain, false if an angle.
    pub fn is_strain(&self) -> bool {
        let params = |channel: &'_ Channel| (channel.sensor.params().quantity, channel.sensor.params().joint.is_none());
        self.channels.iter().all(|channel| params(channel) == (Quantity::Strain, true))
    }

    /// Returns the quantity that its sensors were calibrated on.
    pub fn quantity(&self) -> Quantity {
        self.channels.first().map_or(Quantity::Strain, |channel| channel.sensor.params().quantity)
    }

    /// Restarts the filter after the clock has restarted.
    pub fn restart(&mut self) -> Result<(), CliError> {
        self.filter = filter(&self.channels, self.fusion.as_ref())?;
        self.channels.iter_mut().for_each(|channel| channel.early.clear());
        Ok(())
    }

    /// Restarts the filter at zero, unless the range of a sensor excludes it.
    pub fn start_at_zero(&mut self) -> Result<(), CliError> {
        let at_zero = |channel: &Channel| channel.builder().initial_strain(0.0).build().ok();
        let filters: Option<Vec<Filter>> = self.channels.iter().map(at_zero).collect();
        self.filter = match filters {
            Some(filters) => joined(filters, self.fusion.as_ref())?,
            None => filter(&self.channels, self.fusion.as_ref())?,
        };
        Ok(())
    }

    /// Takes the channels' readings, and returns the joint's estimate.
    pub fn step(&mut self, time_s: f64, readings: &[Reading]) -> Result<JointRow, Error> {
        match &mut self.filter {
            JointFilter::One(filter) => {
                let estimate = filter.step(time_s, readings.first().copied().unwrap_or(Reading::MISSING))?;
                Ok(self.alone(estimate))
            }
            JointFilter::Fused(filter) => {
                let estimate = filter.step(time_s, readings)?;
                Ok(self.fused(estimate))
            }
        }
    }

    /// Smooths a recording; `readings` are those of each channel.
    pub fn smooth(&self, time_s: &[f64], readings: &[&[Reading]]) -> Result<Vec<JointRow>, Error> {
        let builders: Vec<FilterBuilder> = self.channels.iter().map(Channel::builder).collect();
        match &self.fusion {
            Some(fusion) => {
                let rows = fusion.smooth_of(builders, time_s, readings)?;
                Ok(rows.into_iter().map(|row| self.fused(row)).collect())
            }
            None => {
                let of_channel =
                    |(builder, readings): (FilterBuilder, &&[Reading])| builder.smooth_readings(time_s, readings);
                let rows: Vec<_> = builders.into_iter().zip(readings).map(of_channel).collect::<Result<_, _>>()?;
                Ok(rows.into_iter().flatten().map(|row| self.alone(row)).collect())
            }
        }
    }

    /// Returns the row of a joint with one channel.
    fn alone(&self, estimate: Estimate) -> JointRow {
        let flags = estimate.flags.names().map(|flag| format!("{}:{flag}", self.name)).collect();
        let value = estimate.angle_deg.unwrap_or(estimate.strain);
        let sd = estimate.angle_sd.unwrap_or(estimate.strain_sd);
        let (strain, strain_sd) = (estimate.strain, estimate.strain_sd);
        JointRow { value, sd, strain, strain_sd, flags, channels: vec![estimate] }
    }

    /// Returns the row of a joint with several channels.
    fn fused(&self, estimate: FusedEstimate) -> JointRow {
        let of_channels = self
            .channels
            .iter()
            .zip(&estimate.channels)
            .flat_map(|(channel, row)| row.flags.names().map(|flag| format!("{}:{flag}", channel.entry.column)));
        let faulty = estimate.faulty.map(|channel| format!("{}:faulty", self.channels[channel].entry.column));
        let unlike = estimate.is_unlike.then(|| format!("{}:unlike_calibration", self.name));
        let flags = unlike.into_iter().chain(faulty).chain(of_channels).collect();
        let value = estimate.angle_deg.unwrap_or(estimate.strain);
        let sd = estimate.angle_sd.unwrap_or(estimate.strain_sd);
        let (strain, strain_sd) = (estimate.strain, estimate.strain_sd);
        JointRow { value, sd, strain, strain_sd, flags, channels: estimate.channels }
    }
}

/// Creates a filter of the channels in its initial state.
fn filter(channels: &[Channel], fusion: Option<&FusedSensor>) -> Result<JointFilter, CliError> {
    let filters = channels.iter().map(|channel| channel.builder().build()).collect::<Result<Vec<_>, _>>()?;
    joined(filters, fusion)
}

/// Joins the filters of a joint's channels.
fn joined(mut filters: Vec<Filter>, fusion: Option<&FusedSensor>) -> Result<JointFilter, CliError> {
    match (fusion, filters.pop()) {
        (None, Some(only)) => Ok(JointFilter::One(Box::new(only))),
        (Some(fusion), Some(last)) => {
            filters.push(last);
            Ok(JointFilter::Fused(Box::new(fusion.filter_of(filters)?)))
        }
        (_, None) => Err(CliError::Input("expected a joint with a channel, found none".into())),
    }
}

impl<'a> Channel<'a> {
    fn new(joint: &'a HandJoint, entry: &'a HandChannel, folder: &Path, file: &str) -> Result<Self, CliError> {
        // Readings of a hand are not converted to one temperature.
        let mut sensor = sensor_file::read(&folder.join(&entry.sensor), None)?.without_temperature();
        if let Some(joint) = trace::joint(&Metadata { joint: joint.joint, ..Metadata::default() }) {
            sensor = sensor.on_joint(joint)?;
        }
        if let Some(measured) = entry.rest_resistance {
            let refused = |error| CliError::Input(format!("joint `{}`: rest_resistance: {error}", joint.name));
            sensor.check_rest_resistance(measured).map_err(refused)?;
        }
        let lines = LineParser::new(file, Metadata { front_end: entry.front_end, ..Metadata::default() });
        let rest_resistance = entry.rest_resistance;
        Ok(Self { joint: &joint.name, entry, sensor, rest_resistance, lines, early: vec![] })
    }

    fn builder(&self) -> FilterBuilder<'_> {
        let wanted = self.sensor.filter();
        self.rest_resistance.map_or(wanted, |measured| wanted.rest_resistance(measured))
    }

    /// Returns the header for this channel: its column is the reading, those of other channels are ignored.
    pub fn header(&self, names: &[String]) -> Result<String, String> {
        let has = |column: &str| names.iter().any(|name| name == column);
        let header = || quoted(&names.join(","));
        if !has("time_s") && !has("time_us") {
            return Err(format!("expected a header with the column `time_s` or `time_us`, found {}", header()));
        }
        let (joint, column) = (self.joint, &self.entry.column);
        if !has(column) {
            return Err(format!("joint `{joint}`: expected a column `{column}`, found {}", header()));
        }
        let expected = self.sensor.params().reading;
        if let Some(found) = self.stated_unit().filter(|found| *found != expected) {
            return Err(format!(
                "column `{column}`: joint `{joint}`: expected `{}` as in the sensor's calibration, found `{}`",
                reading_column(expected),
                reading_column(found)
            ));
        }
        let own = self.own_column();
        Ok(masked(names.iter().map(String::as_str), |_, name| match name {
            name if name == column => Some(own),
            "time_s" | "time_us" => Some(name),
            _ => None,
        }))
    }

    /// Returns the column of its readings in a recording of one channel.
    fn own_column(&self) -> &'static str {
        if self.entry.front_end.is_some() { "adc" } else { reading_column(self.sensor.params().reading) }
    }

    /// Returns the message about a line that it cannot read, with its column as in the file.
    pub fn refused(&self, fault: BadContent, hint: &str) -> String {
        let fault = fault.renamed(self.own_column(), &self.entry.column);
        format!("{fault}{hint}")
    }

    /// Returns the unit of the readings according to the electronics, the lines above the header or the ending of the column's
    /// name.
    fn stated_unit(&self) -> Option<ReadingUnit> {
        if self.entry.front_end.is_some() || self.lines.metadata().resistance_unit.is_some() {
            return Some(ReadingUnit::Ohm);
        }
        match self.entry.column.to_lowercase().rsplit('_').next()? {
            "ohm" | "ohms" | "kohm" => Some(ReadingUnit::Ohm),
            "ratio" => Some(ReadingUnit::Ratio),
            _ => None,
        }
    }

    /// Checks the unit of the readings once enough are known; returns a doubt.
    pub fn doubt(&mut self, reading: f64) -> Option<String> {
        if !reading.is_finite() || self.early.len() >= FIRST_LIVE_READINGS {
            return None;
        }
        self.early.push(reading);
        if self.early.len() < FIRST_LIVE_READINGS { None } else { self.unit_doubt() }
    }

    /// Checks the unit if the recording has ended before that; returns a doubt.
    pub fn last_doubt(&self) -> Option<String> {
        if self.early.len() < FIRST_LIVE_READINGS { self.unit_doubt() } else { None }
    }

    fn unit_doubt(&self) -> Option<String> {
        let doubt = self.sensor.check_unit(self.early.iter().copied(), self.rest_resistance).err()?;
        let answer = match doubt.guess {
            UnitGuess::KiloOhm => "Then say so with a line `# resistance_unit = kohm` above the header",
            UnitGuess::CalibrationInKiloOhm => "Then calibrate again with `--unit resistance=kohm`",
            _ => "Bring them to the sensor's unit",
        };
        Some(format!("joint `{}`: {doubt} {answer}", self.joint))
    }
}

/// Shortens and quotes a header for a message.
pub fn quoted(header: &str) -> String {
    const LONGEST: usize = 80;
    let shown: String = header.chars().take(LONGEST).collect();
    if shown.len() < header.len() { format!("`{shown}…`") } else { format!("`{shown}`") }
}
