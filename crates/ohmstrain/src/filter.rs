use std::collections::VecDeque;
use std::fmt;

use ohmstrain_ekf::Gaussian;
use ohmstrain_sensor::{KnownErrors, KnownStrain, Output};

use crate::estimate::Scale;
use crate::known::next_until;
use crate::stored::{Ahead, Last, MadeOf, StoredKernel, WaitingRow};
use crate::{Error, Estimate, Reading, Stored, StoredError};

/// A live filter, with the conversions from readings and to rows.
pub(crate) struct Kernel {
    pub filter: Box<dyn ohmstrain_sensor::Filter>,
    pub rows: RowWriter,
    /// Strains known at later times, in order of time.
    pub known: VecDeque<(f64, Gaussian<f64>)>,
    /// Sensor and options that it was built from.
    pub made_of: MadeOf,
}

/// Conversion of a filter's output to rows.
pub(crate) struct RowWriter {
    pub scale: Scale,
    /// Errors at known strains, applied to other rows.
    pub errors: KnownErrors,
}

impl RowWriter {
    /// Returns the row of a reading and the filter's output.
    fn row(&mut self, row: (f64, Reading), output: &Output) -> Estimate {
        self.errors.restate(row.0, output.stated());
        self.known_row(row, output)
    }

    /// Returns the row of an output, corrected by known errors.
    fn known_row(&self, (time_s, reading): (f64, Reading), stated: &Output) -> Estimate {
        let mut output = *stated;
        output.estimate.strain = self.errors.correct(time_s, stated.stated());
        self.scale.row(time_s, reading, &output)
    }
}

impl Kernel {
    /// Sets R₀, which is no longer adapted to the readings.
    fn rest_resistance(&mut self, measured: f64) -> Result<(), Error> {
        self.rows.scale.rest_at(measured)?;
        self.filter.rest(measured).map_err(Error::Step)?;
        // Known errors belong to the former R₀.
        self.rows.errors = KnownErrors::new(self.rows.scale.limits);
        Ok(())
    }

    fn store(&self) -> Result<StoredKernel, Error> {
        Ok(StoredKernel {
            rest_reading: self.rows.scale.rest_reading,
            known: self.known.iter().copied().map(Ahead::from).collect(),
            strains: self.rows.errors.strains().copied().collect(),
            filter: self.filter.store()?,
        })
    }

    /// Resumes from a state that was stored after the row at `last_s`. Known strains of both remain; those of earlier rows, and those
    /// that the state has already, count once.
    fn resume(&mut self, stored: StoredKernel, last_s: Option<f64>) -> Result<(), Error> {
        let StoredKernel { rest_reading, known, strains, filter } = stored;
        self.filter.resume(filter).map_err(|error| StoredError::Content(Box::new(error)))?;
        self.rows.scale.rest_reading = rest_reading;
        self.rows.errors = KnownErrors::of(self.rows.scale.limits, &strains);
        let ahead: Vec<_> = known.into_iter().map(Ahead::strain).collect();
        self.known.retain(|given| last_s.is_none_or(|last_s| given.0 > last_s) && !ahead.contains(given));
        self.known.extend(ahead);
        self.known.make_contiguous().sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(())
    }

    /// Takes a known strain, with the estimate at that time.
    fn know(&mut self, strain: KnownStrain) {
        self.rows.errors.tell(strain);
        self.filter.settle();
    }
}

/// A running filter: readings in, estimates out. It can be sent to another thread, and owned by an asynchronous task.
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let mut filter = sensor.filter().build()?;
/// let e = filter.step(0.0, 1600.0)?;
/// println!("{:.3} ± {:.3}", e.strain, e.strain_sd);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Filter {
    kernel: Kernel,
    /// Time and reading of the last row, and its output before known strains.
    last: Option<Last>,
}

impl Filter {
    pub(crate) const fn new(kernel: Kernel) -> Self {
        Self { kernel, last: None }
    }

    /// Takes the reading at `time_s`, and returns the estimate from all readings so far. A missing reading is NaN, `None` or
    /// [`Reading::MISSING`]; the estimate is then a prediction. An infinite reading is implausible.
    ///
    /// # Errors
    /// If time goes backwards or is NaN. The filter stays as it was: the next good row continues from the last good one.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build()?;
    /// let known = filter.step(0.00, 1600.0)?;
    /// let missing = filter.step(0.05, None)?;
    /// assert!(missing.resistance.is_none() && missing.strain_sd > known.strain_sd);
    /// assert!(filter.step(0.04, 1600.0).is_err());
    /// filter.step(0.10, 1601.0)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step(&mut self, time_s: f64, reading: impl Into<Reading>) -> Result<Estimate, Error> {
        let (kernel, reading) = (&mut self.kernel, reading.into());
        kernel.filter.step(time_s, reading.relative(kernel.rows.scale.rest_reading))?;
        let output = kernel.filter.output();
        let mut row = kernel.rows.row((time_s, reading), &output);
        while let Some(known) = next_until(&mut kernel.known, time_s) {
            kernel.know(KnownStrain { time_s, known, estimated: output.stated() });
            row = kernel.rows.known_row((time_s, reading), &output);
        }
        self.last = Some(Last { time_s, reading, output });
        Ok(row)
    }

    /// Takes a strain (or angle) known now, with standard deviation `sd`. It corrects the estimate of the last row (of the
    /// first one, if there is none yet) and those of later rows. The error at that time counts for seconds, and for an hour as
    /// far as several known strains, or one far from the estimate, show an offset or another gain.
    ///
    /// # Errors
    /// If the strain lies beyond the limits by more than a tenth of their span, or `sd` is not positive. The filter stays as it
    /// was.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build()?;
    /// let before = filter.step(0.0, 1600.0)?;
    /// let e = filter.know(0.10, 0.002)?;
    /// assert!((e.strain - 0.10).abs() < 0.01 && e.strain_sd < before.strain_sd);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn know(&mut self, strain: f64, sd: f64) -> Result<Estimate, Error> {
        let kernel = &mut self.kernel;
        let known = kernel.rows.scale.known(strain, sd)?;
        let Some(Last { time_s, reading, output }) = self.last else {
            kernel.known.push_front((f64::NEG_INFINITY, known));
            return Ok(kernel.rows.scale.row(f64::NAN, Reading::MISSING, &kernel.filter.output()));
        };
        kernel.know(KnownStrain { time_s, known, estimated: output.stated() });
        Ok(kernel.rows.known_row((time_s, reading), &output))
    }

    /// Stores everything that the next row depends on; [`FilterBuilder::resume`](crate::FilterBuilder::resume) resumes from it,
    /// to the bit.
    ///
    /// # Errors
    /// If TOML cannot represent it.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::Stored;
    ///
    /// let mut filter = sensor.filter().build()?;
    /// filter.step(0.0, 1600.0)?;
    /// let text = filter.store()?.to_toml()?;
    /// let mut resumed = sensor.filter().resume(&Stored::from_toml(&text)?)?;
    /// assert_eq!(resumed.step(0.1, 1602.0)?, filter.step(0.1, 1602.0)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn store(&self) -> Result<Stored, Error> {
        Ok(Stored::new(&self.kernel.made_of, None, self.last, Vec::new(), self.kernel.store()?))
    }

    /// Returns R₀ in the unit of the readings.
    pub(crate) const fn rest_reading(&self) -> f64 {
        self.kernel.rows.scale.rest_reading
    }

    pub(crate) fn resume(&mut self, stored: &Stored) -> Result<(), Error> {
        stored.check(&self.kernel.made_of, None)?;
        self.kernel.resume(stored.kernel.clone(), stored.last.map(|last| last.time_s))?;
        self.last = stored.last;
        Ok(())
    }

    /// Sets the reading of the rested, unstretched sensor from now on, in place of that in calibration.
    ///
    /// # Errors
    /// If it is not a positive number, or differs from that in calibration by more than a factor of
    /// [`FARTHEST_REST`](crate::FARTHEST_REST).
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build()?;
    /// filter.rest_resistance(1712.0)?;
    /// filter.step(0.0, 1730.0)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn rest_resistance(&mut self, measured: f64) -> Result<(), Error> {
        self.kernel.rest_resistance(measured)
    }
}

/// A running fixed-lag smoother: each row is estimated from the readings up to a fixed lag after it. See
/// [`FilterBuilder::build_lagged`](crate::FilterBuilder::build_lagged).
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let mut filter = sensor.filter().build_lagged(0.1)?;
/// let mut rows = Vec::new();
/// for k in 0..100 {
///     rows.extend_from_slice(filter.step(0.05 * f64::from(k), 1600.0)?);
/// }
/// rows.extend_from_slice(filter.finish()?);
/// assert_eq!(rows.len(), 100);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LaggedFilter {
    kernel: Kernel,
    lag_s: f64,
    /// Time of the last row, s.
    last_s: Option<f64>,
    /// Rows whose estimates are pending until later readings arrive.
    waiting: VecDeque<(f64, Reading)>,
    /// Estimates that have become due.
    due: Vec<Estimate>,
    /// True if they have been returned.
    are_out: bool,
}

impl LaggedFilter {
    pub(crate) const fn new(kernel: Kernel, lag_s: f64) -> Self {
        Self { kernel, lag_s, last_s: None, waiting: VecDeque::new(), due: Vec::new(), are_out: true }
    }

    /// Takes the reading at `time_s`, as [`Filter::step`] does, and returns the rows that have become due, in order.
    ///
    /// # Errors
    /// As [`Filter::step`]. Rows that have become due meanwhile are returned by the next step.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(0.1)?;
    /// assert_eq!(filter.step(0.00, 1600.0)?.len(), 0);
    /// assert_eq!(filter.step(0.15, 1600.0)?.len(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step(&mut self, time_s: f64, reading: impl Into<Reading>) -> Result<&[Estimate], Error> {
        let (reading, lag_s) = (reading.into(), self.lag_s);
        self.forget_handed_out();
        self.take_known();
        self.waiting.push_back((time_s, reading));
        let Kernel { filter, rows, .. } = &mut self.kernel;
        let relative = reading.relative(rows.scale.rest_reading);
        let (waiting, due) = (&mut self.waiting, &mut self.due);
        let mut out = |output| due.extend(waiting.pop_front().map(|row| rows.row(row, &output)));
        let taken = filter.step_lagged(time_s, relative, lag_s, &mut out);
        if taken.is_err() {
            self.waiting.pop_back();
        }
        taken?;
        self.last_s = Some(time_s);
        self.are_out = true;
        Ok(&self.due)
    }

    /// Returns the pending rows, estimated from all available readings.
    ///
    /// # Errors
    /// If a step of the smoother fails.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(1.0)?;
    /// filter.step(0.0, 1600.0)?;
    /// assert_eq!(filter.finish()?.len(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn finish(&mut self) -> Result<&[Estimate], Error> {
        self.forget_handed_out();
        self.take_known();
        let Kernel { filter, rows, .. } = &mut self.kernel;
        let (waiting, due) = (&mut self.waiting, &mut self.due);
        let mut out = |output| due.extend(waiting.pop_front().map(|row| rows.row(row, &output)));
        filter.flush_lagged(&mut out)?;
        self.are_out = true;
        Ok(&self.due)
    }

    /// Sets a known strain as [`Filter::know`] does, for rows that are still pending and later ones.
    ///
    /// # Errors
    /// As [`Filter::know`].
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(0.5)?;
    /// filter.step(0.0, 1600.0)?;
    /// assert!(filter.know(0.10, 0.0).is_err());
    /// filter.know(0.10, 0.002)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn know(&mut self, strain: f64, sd: f64) -> Result<(), Error> {
        let strain = self.kernel.rows.scale.known(strain, sd)?;
        self.kernel.known.push_front((f64::NEG_INFINITY, strain));
        if self.last_s.is_some() {
            self.take_known();
        }
        Ok(())
    }

    /// Stores the filter as [`Filter::store`] does, with its pending rows.
    /// [`FilterBuilder::resume_lagged`](crate::FilterBuilder::resume_lagged) resumes from it.
    ///
    /// # Errors
    /// If TOML cannot represent it, or if rows that are due have not been returned, as after an error: take another row first.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(0.1)?;
    /// filter.step(0.0, 1600.0)?;
    /// let mut resumed = sensor.filter().resume_lagged(0.1, &filter.store()?)?;
    /// assert_eq!(resumed.step(0.2, 1602.0)?, filter.step(0.2, 1602.0)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn store(&self) -> Result<Stored, Error> {
        if !self.are_out && !self.due.is_empty() {
            return Err(StoredError::RowsDue.into());
        }
        let rows = self.waiting.iter().map(|&(time_s, reading)| WaitingRow { time_s, reading }).collect();
        let mut stored = Stored::new(&self.kernel.made_of, Some(self.lag_s), None, rows, self.kernel.store()?);
        stored.last_s = self.last_s;
        Ok(stored)
    }

    pub(crate) fn resume(&mut self, stored: &Stored) -> Result<(), Error> {
        stored.check(&self.kernel.made_of, Some(self.lag_s))?;
        self.kernel.resume(stored.kernel.clone(), stored.last_s)?;
        self.waiting = stored.waiting.iter().map(|row| (row.time_s, row.reading)).collect();
        self.last_s = stored.last_s;
        Ok(())
    }

    /// Applies strains known by the last row. They lie after all rows returned so far, since rows are returned as soon as they
    /// are due.
    fn take_known(&mut self) {
        let Some(time_s) = self.last_s else { return };
        while let Some(known) = next_until(&mut self.kernel.known, time_s) {
            let estimated = self.kernel.filter.output().stated();
            self.kernel.know(KnownStrain { time_s, known, estimated });
        }
    }

    /// Sets the reading of the rested sensor; see [`Filter::rest_resistance`].
    ///
    /// # Errors
    /// If it is not a positive number, or differs from that in calibration by more than a factor of
    /// [`FARTHEST_REST`](crate::FARTHEST_REST).
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().build_lagged(0.5)?;
    /// assert!(filter.rest_resistance(0.0).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn rest_resistance(&mut self, measured: f64) -> Result<(), Error> {
        self.kernel.rest_resistance(measured)
    }

    fn forget_handed_out(&mut self) {
        if self.are_out {
            self.due.clear();
        }
        self.are_out = false;
    }
}

impl fmt::Debug for Filter {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        out.debug_struct("Filter").field("scale", &self.kernel.rows.scale).finish_non_exhaustive()
    }
}

impl fmt::Debug for LaggedFilter {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (scale, lag_s, waiting) = (&self.kernel.rows.scale, &self.lag_s, &self.waiting.len());
        let mut out = out.debug_struct("LaggedFilter");
        out.field("scale", scale).field("lag_s", lag_s).field("waiting", waiting).finish_non_exhaustive()
    }
}
