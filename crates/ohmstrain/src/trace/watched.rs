use ohmstrain_bench_data::Row;

use super::reading;
use crate::known::KNOWN_TO;
use crate::number::significant;
use crate::{Error, Estimate, Filter, FilterBuilder, Interface, QuietWatch, Sensor, UnitDoubt, ValidityWatch};

/// Number of first readings whose unit is checked if a reader waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;

/// A filter on rows as they arrive, with remarks for a person who watches: on use outside the calibrated range, on holds that may be rests,
/// and on the unit of the first readings.
#[derive(Debug)]
pub struct WatchedFilter {
    filter: Filter,
    sensor: Sensor,
    validity: ValidityWatch,
    quiet: QuietWatch,
    /// Reading of the rested sensor, if it differs from that in calibration.
    rest: Option<f64>,
    /// Number of first readings whose median is R₀; 0 if it is not determined so.
    rest_of_first: usize,
    /// The first known readings.
    early: Vec<f64>,
}

impl WatchedFilter {
    /// Builds a filter; the median of the first `rest_of_first` readings becomes R₀, unless that is 0.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`].
    pub fn new(wanted: FilterBuilder, rest_of_first: usize) -> Result<Self, Error> {
        let (validity, quiet) = watches(&wanted);
        let (filter, sensor) = (wanted.build()?, wanted.sensor.clone());
        Ok(Self { filter, sensor, validity, quiet, rest: wanted.rest_resistance, rest_of_first, early: vec![] })
    }

    /// Begins anew with another filter, for another clock or header; R₀ and the first readings remain.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`]. The filter then stays as it was.
    pub fn begin(&mut self, wanted: FilterBuilder) -> Result<(), Error> {
        let wanted = self.rest.map_or(wanted, |measured| wanted.rest_resistance(measured));
        self.filter = wanted.build()?;
        self.sensor = wanted.sensor.clone();
        (self.validity, self.quiet) = watches(&wanted);
        Ok(())
    }

    /// Takes a row, and returns its estimate.
    ///
    /// # Errors
    /// As [`Filter::step`].
    pub fn step(&mut self, row: &Row) -> Result<Estimate, Error> {
        self.filter.step(row.time_s, reading(&row.reading))
    }

    /// Returns a remark on the last row, if there is one; `rested` tells the person how to answer that the sensor is at rest.
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
        if self.early.len() == self.rest_of_first {
            self.rest = median(self.early.clone());
            self.rest.map_or(Ok(()), |measured| self.filter.rest_resistance(measured))?;
            self.validity = ValidityWatch::new(&self.sensor, self.rest);
        }
        let doubt = || self.sensor.check_unit(self.early.iter().copied(), self.rest).err();
        Ok((self.early.len() == enough).then(doubt).flatten())
    }

    /// Takes the sensor as at rest now: its strain is zero, as exactly as known strains are by default.
    ///
    /// # Errors
    /// As [`Filter::know`].
    pub fn rest(&mut self) -> Result<(), Error> {
        self.filter.know(0.0, KNOWN_TO * self.sensor.params().limits.span()).map(|_| ())
    }

    /// Makes a reading R₀ and begins anew at zero, unless the sensor's range excludes it. Returns true if it begins there.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`]. The filter then stays as it was.
    pub fn zero(&mut self, wanted: FilterBuilder, rest: f64) -> Result<bool, Error> {
        let wanted = wanted.rest_resistance(rest);
        let at_zero = wanted.initial_strain(0.0).build();
        let begins_there = at_zero.is_ok();
        self.filter = at_zero.or_else(|_| wanted.build())?;
        self.rest = Some(rest);
        // Strains that need no question remain those of this clock.
        (self.validity, self.quiet) = watches(&wanted.known(&self.quiet.known.clone()));
        Ok(begins_there)
    }
}

/// Creates the watches of a filter.
fn watches(wanted: &FilterBuilder) -> (ValidityWatch, QuietWatch) {
    let (sensor, rest) = (wanted.sensor, wanted.rest_resistance);
    (ValidityWatch::new(sensor, rest), QuietWatch::new(sensor, rest, wanted.known))
}

/// Returns the median of numbers; `None` if there are none.
#[must_use]
pub fn median(mut known: Vec<f64>) -> Option<f64> {
    known.sort_by(f64::total_cmp);
    match known.len() {
        0 => None,
        n if n % 2 == 1 => Some(known[n / 2]),
        n => Some(0.5 * (known[n / 2 - 1] + known[n / 2])),
    }
}
