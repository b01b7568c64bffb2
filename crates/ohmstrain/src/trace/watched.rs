use ohmstrain_bench_data::Row;

use super::reading;
use crate::known::KNOWN_TO;
use crate::number::{median, significant};
use crate::{
    Error, Estimate, Filter, FilterBuilder, Interface, Known, QuietWatch, Sensor, Thermometer, UnitDoubt, ValidityWatch,
};

/// Number of first readings whose unit is checked if a reader waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// A filter on rows as they arrive, converted to the temperature of the calibration, with remarks for a person who watches: on use outside
/// the calibrated range, on holds that may be rests, on the unit of the first readings, and on temperatures that are not measured.
#[derive(Debug)]
pub struct WatchedFilter {
    filter: Filter,
    /// The sensor for the stream's columns.
    sensor: Sensor,
    /// Conversion of the readings to its reference temperature.
    thermometer: Thermometer,
    validity: ValidityWatch,
    quiet: QuietWatch,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest: Option<f64>,
    /// Number of first readings whose median is R₀; 0 if it is not determined so.
    rest_of_first: usize,
    /// The first known readings.
    early: Vec<f64>,
    /// Time of the last row, s.
    last_s: f64,
    /// True if the sensor was taken as at rest, and no row has come since.
    rests_first: bool,
}

impl WatchedFilter {
    /// Builds a filter for rows with temperatures; the median of the first `rest_of_first` readings becomes R₀, unless that is 0.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`].
    pub fn new(wanted: FilterBuilder, rest_of_first: usize) -> Result<Self, Error> {
        let (sensor, rest, known) = (wanted.sensor.clone(), wanted.rest_resistance, wanted.known);
        Ok(Self {
            filter: wanted.build()?,
            validity: ValidityWatch::new(&sensor, rest),
            quiet: QuietWatch::new(&sensor, rest, known),
            thermometer: Thermometer::new(&sensor),
            sensor,
            rest,
            rest_of_first,
            early: vec![],
            last_s: f64::NEG_INFINITY,
            rests_first: false,
        })
    }

    /// Begins anew with another filter, for another clock or header; R₀, the first readings and the last temperature remain. Without
    /// temperatures, intervals are wider by what the calibration's do to the strain; returns a remark if they are.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`]. The filter then stays as it was.
    pub fn begin(&mut self, wanted: FilterBuilder, has_temperature: bool) -> Result<Option<&'static str>, Error> {
        let (sensor, known) = (wanted.sensor.clone(), wanted.known);
        let is_wider = sensor.params().temperature.is_some() && !has_temperature;
        let sensor = if is_wider { sensor.without_temperature() } else { sensor };
        let mut wanted = self.rest.map_or(wanted, |measured| wanted.rest_resistance(measured));
        wanted.sensor = &sensor;
        self.filter = wanted.build()?;
        self.thermometer = Thermometer::new(&sensor).after(self.thermometer.last_c());
        self.sensor = sensor;
        self.last_s = f64::NEG_INFINITY;
        self.watch(known);
        if self.rests_first {
            self.rest()?;
        }
        Ok(is_wider.then_some("no column temperature_c: intervals are wider"))
    }

    /// Watches the filter anew, which is told these strains.
    fn watch(&mut self, known: &[Known]) {
        self.validity = ValidityWatch::new(&self.sensor, self.rest);
        self.quiet = QuietWatch::new(&self.sensor, self.rest, known);
    }

    /// Takes a row, converts its reading to the temperature of the calibration, and returns its estimate.
    ///
    /// # Errors
    /// As [`Filter::step`].
    pub fn step(&mut self, row: &mut Row) -> Result<Estimate, Error> {
        row.reading.value = self.thermometer.at_reference(row.reading.value, row.temperature_c);
        let estimate = self.filter.step(row.time_s, reading(&row.reading))?;
        (self.last_s, self.rests_first) = (row.time_s, false);
        Ok(estimate)
    }

    /// Watches a row after its step, and determines R₀ with the last of the first readings, if that was asked for. Returns a remark on the
    /// row, if there is one; `rested` tells the person how to answer that the sensor is at rest.
    ///
    /// # Errors
    /// If the median of the first readings cannot be R₀.
    pub fn remark(&mut self, last: &Estimate, rested: &str) -> Result<Option<String>, Error> {
        let reading = last.resistance.unwrap_or(f64::NAN);
        let beyond = self.validity.see(last.time_s, reading, last.strain_rate, f64::NAN).last();
        let quiet = self.quiet.see(last).map(|quiet| {
            let quiet_s = significant(quiet.now_s - quiet.from_s, 2);
            format!("{quiet_s} s of quiet that may be a rest: {rested}, if it is one")
        });
        let unit = self.take_early(reading)?.map(|doubt| doubt.text(Interface::CommandLine));
        Ok(unit.or(quiet).or_else(|| beyond.map(|beyond| beyond.to_string())))
    }

    /// Determines R₀ from the first readings if requested, and checks their unit.
    fn take_early(&mut self, reading: f64) -> Result<Option<UnitDoubt>, Error> {
        let enough = self.rest_of_first.max(FIRST_LIVE_READINGS);
        if !reading.is_finite() || self.early.len() >= enough {
            return Ok(None);
        }
        self.early.push(reading);
        if self.early.len() == self.rest_of_first
            && let Some(measured) = median(self.early.clone())
        {
            self.filter.rest_resistance(measured)?;
            self.rest = Some(measured);
            self.watch(&self.quiet.known.clone());
        }
        let doubt = || self.sensor.check_unit(self.early.iter().copied(), self.rest).err();
        Ok((self.early.len() == enough).then(doubt).flatten())
    }

    /// Takes the sensor as at rest now: its strain is zero, as exactly as known strains are by default.
    ///
    /// # Errors
    /// As [`Filter::know`].
    pub fn rest(&mut self) -> Result<(), Error> {
        self.filter.know(0.0, KNOWN_TO * self.sensor.params().limits.span())?;
        self.rests_first = self.last_s == f64::NEG_INFINITY;
        Ok(())
    }

    /// Makes a reading at the temperature of the calibration R₀, whatever the first readings say, and begins anew at zero, unless the
    /// sensor's range excludes it. The sensor stays the one that it began with. Of the known strains those after the last row apply.
    /// Returns true if it begins at zero.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`]. The filter then stays as it was.
    pub fn zero(&mut self, wanted: FilterBuilder, rest: f64) -> Result<bool, Error> {
        let to_come: Vec<Known> = wanted.known.iter().filter(|known| known.time_s > self.last_s).copied().collect();
        let mut wanted = wanted.known(&to_come).rest_resistance(rest);
        (wanted.sensor, wanted.initial_strain) = (&self.sensor, None);
        let at_zero = wanted.initial_strain(0.0).build();
        let begins_there = at_zero.is_ok();
        self.filter = at_zero.or_else(|_| wanted.build())?;
        (self.rest, self.rest_of_first) = (Some(rest), 0);
        // Strains that need no question remain those of this clock.
        self.watch(&self.quiet.known.clone());
        Ok(begins_there)
    }
}
