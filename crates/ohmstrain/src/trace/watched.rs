use std::collections::VecDeque;

use ohmstrain_bench_data::Row;

use super::reading;
use crate::known::KNOWN_TO;
use crate::number::{median, significant};
use crate::{
    Error, Estimate, Filter, FilterBuilder, Interface, Known, QuietWatch, Reading, Sensor, Thermometer, UnitDoubt,
    ValidityWatch,
};

/// Number of first readings whose unit is checked if a reader waits for each row.
pub const FIRST_LIVE_READINGS: usize = 20;
/// Duration, s, over which the reading of the rested sensor is determined.
pub const REST_S: f64 = 1.0;
/// Smallest number of readings for that: where fewer came, the last ones are taken, however old.
pub const LEAST_AT_REST: usize = 5;

/// Returns the sentence for a person after a restart of the clock, with the remark of [`WatchedFilter::begin`].
#[must_use]
pub fn restarted(remark: Option<&str>) -> String {
    let again = "the clock has started again, and so has the filter";
    remark.map_or_else(|| again.into(), |remark| format!("{again}; {remark}"))
}

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
    /// Times, s, and known readings for the next zero: those of the last second, or the last few.
    recent: VecDeque<(f64, f64)>,
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
            recent: VecDeque::new(),
            last_s: f64::NEG_INFINITY,
            rests_first: false,
        })
    }

    /// Begins anew with another filter, for another clock or header; R₀, the first readings and the last temperature remain. Without
    /// temperatures, intervals are wider by the effect of the calibration's temperatures on the strain; returns a remark if they are.
    ///
    /// # Errors
    /// As [`FilterBuilder::build`], and the filter then stays as it was; as [`Filter::know`], if a rest came before the first row.
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
        self.recent.clear();
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

    /// Takes a row, and returns the estimate of its reading at the temperature of the calibration.
    ///
    /// # Errors
    /// As [`Filter::step`].
    pub fn step(&mut self, row: &Row) -> Result<Estimate, Error> {
        let value = self.thermometer.at_reference(row.reading.value, row.temperature_c);
        let estimate = self.filter.step(row.time_s, Reading { value, ..reading(&row.reading) })?;
        (self.last_s, self.rests_first) = (row.time_s, false);
        if value.is_finite() {
            self.recent.push_back((row.time_s, value));
        }
        let is_old = |first: &(f64, f64)| first.0 < row.time_s - REST_S;
        while self.recent.len() > LEAST_AT_REST && self.recent.front().is_some_and(is_old) {
            self.recent.pop_front();
        }
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
            format!("{quiet_s} s of quiet readings, which may be a rest: {rested}, if it is one")
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

    /// Takes the sensor as rested now: the median of the last second's known readings, or of the last five if fewer came, is R₀ at the
    /// temperature of the calibration, whatever the first readings say. The filter begins anew at zero, unless the sensor's range excludes
    /// it. The sensor stays the one that it began with. Of the known strains those after the last row apply. Where no reading has come
    /// on this clock, or it cannot be R₀, the filter stays as it was. Returns a sentence for the person about the change.
    pub fn zero(&mut self, wanted: FilterBuilder) -> String {
        let readings: Vec<f64> = self.recent.iter().map(|(_, reading)| *reading).collect();
        let (count, first_s) = (readings.len(), self.recent.front().map_or(self.last_s, |(time_s, _)| *time_s));
        let Some(rest) = median(readings) else { return "R0 stays as it was: there is no reading yet".into() };
        let at_zero = match self.begin_at_zero(wanted, rest) {
            Ok(at_zero) => at_zero,
            Err(refused) => return format!("R0 stays as it was: {refused}"),
        };
        let span_s = self.last_s - first_s;
        let over = if span_s > REST_S { format!(" over {} s", significant(span_s, 2)) } else { String::new() };
        let starts = if at_zero { "; it starts again at zero" } else { "" };
        format!("R0 is {} now, the median of {count} readings{over}{starts}", significant(rest, 5))
    }

    /// Makes a reading R₀, and begins anew at zero if the sensor's range includes it; returns true if it does.
    fn begin_at_zero(&mut self, wanted: FilterBuilder, rest: f64) -> Result<bool, Error> {
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
