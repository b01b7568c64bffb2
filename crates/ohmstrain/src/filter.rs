use std::collections::VecDeque;
use std::{fmt, mem};

use ohmstrain_calib::{KnownErrors, KnownStrain, Output};
use ohmstrain_ekf::Gaussian;
use ohmstrain_ekf::live::{Doubts, Flags, RestFollower};

use crate::estimate::Scale;
use crate::known::next_until;
use crate::{Error, Estimate, Reading};

/// A filter for the sizes of the sensor's law, and the way to it from readings and from it to rows.
pub(crate) struct Kernel {
    pub filter: Box<dyn ohmstrain_calib::Filter>,
    pub translator: Translator,
    /// Strains that will be known, in order of time.
    pub known: VecDeque<(f64, Gaussian<f64>)>,
}

/// From readings to what the filter sees, and from what it says to rows.
pub(crate) struct Translator {
    pub scale: Scale,
    /// None if intervals are to be as the filter states them.
    pub doubts: Option<Doubts<f64>>,
    /// None where R₀ is told.
    pub follower: Option<RestFollower<f64>>,
    /// Times of the last row, and of the last one whose reading was used, s.
    pub seen_s: f64,
    pub read_s: f64,
    /// What known strains say of other rows.
    pub errors: KnownErrors,
}

impl Translator {
    /// A reading as the filter is to see it.
    fn relative(&self, reading: Reading) -> Option<ohmstrain_ekf::Reading<f64>> {
        followed(self.follower.as_ref(), reading.relative(self.scale.rest_reading))
    }

    /// The row of a reading and what the filter says of it, in doubt. Doubts are of readings as calibration would have had
    /// them.
    fn row(&mut self, (time_s, reading): (f64, Reading), output: &mut Output) -> Estimate {
        let dt_s = time_s - mem::replace(&mut self.seen_s, time_s);
        let (taken, off) = (taken(&self.scale, reading, output), self.off());
        if let (Some(follower), Some((relative, _))) = (&mut self.follower, taken) {
            output.startled.into_iter().for_each(|jump| follower.jumped(jump));
            follower.see(time_s - self.read_s, relative);
        }
        self.read_s = if taken.is_some() { time_s } else { self.read_s };
        let mut flags = Flags::NONE;
        if let Some(doubts) = &mut self.doubts {
            let stated = output.estimate.strain;
            if output.verdict.is_refused() {
                doubts.refuse();
            }
            let variance = doubts.see(dt_s, taken, stated);
            let (widened, of_doubts) = doubts.widened(output.estimate.rate.mean, variance);
            flags = of_doubts;
            doubt(&mut output.estimate, doubts, widened);
        }
        self.errors.restate(time_s, output.estimate.strain);
        let mut row = self.known_row((time_s, reading), off, output);
        row.flags = row.flags.and(flags);
        row
    }

    /// The row of what is said, with what is known of its error.
    fn known_row(&self, (time_s, reading): (f64, Reading), off: f64, said: &Output) -> Estimate {
        let mut output = *said;
        output.estimate.strain = self.errors.correct(time_s, said.estimate.strain);
        self.scale.row(time_s, reading, off, &output)
    }

    /// By what share R₀ has been followed.
    pub fn off(&self) -> f64 {
        self.follower.map_or(0.0, |follower| follower.off())
    }

    /// R₀ is told: nothing follows any more.
    fn rest_resistance(&mut self, measured: f64) -> Result<(), Error> {
        self.scale.rest_at(measured)?;
        // What errors were known of were those of another R₀.
        self.errors = KnownErrors::new(self.scale.limits());
        self.follower = None;
        self.doubts.iter_mut().for_each(Doubts::told_rest);
        Ok(())
    }

    /// The strain of a row is known, of which something was said; the row as it is now.
    fn told(&mut self, (time_s, reading, output): (f64, Reading, &Output), known: Gaussian<f64>) -> Estimate {
        self.know(KnownStrain { time_s, known, said: output.estimate.strain });
        self.known_row((time_s, reading), self.off(), output)
    }

    fn know(&mut self, strain: KnownStrain) {
        self.errors.tell(strain);
        self.doubts.iter_mut().for_each(Doubts::settle);
    }
}

/// Widens what is said of the strain to a variance, and by as much, on the mean slope, what is said of the reading after a hold.
pub(crate) fn doubt(estimate: &mut ohmstrain_ekf::Estimate<f64>, doubts: &Doubts<f64>, widened: f64) {
    estimate.still_relaxes.variance += doubts.of_reading(widened - estimate.strain.variance).max(0.0);
    estimate.strain.variance = widened;
}

/// A reading relative to R₀ as it is followed.
pub(crate) fn followed(
    follower: Option<&RestFollower<f64>>,
    reading: Option<ohmstrain_ekf::Reading<f64>>,
) -> Option<ohmstrain_ekf::Reading<f64>> {
    reading.map(|reading| follower.map_or(reading, |follower| follower.relative(reading)))
}

/// A reading R/R₀ - 1 that has told the filter something, and its normalised innovation squared.
pub(crate) fn taken(scale: &Scale, reading: Reading, output: &Output) -> Option<(f64, f64)> {
    let relative = reading.relative(scale.rest_reading).filter(|_| output.verdict.is_taken());
    relative.map(|relative| (relative.value, output.nis.unwrap_or(0.0)))
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
    /// Time and reading of the last row, and what was said of it before known strains.
    last: Option<(f64, Reading, Output)>,
}

impl Filter {
    pub(crate) const fn new(kernel: Kernel) -> Self {
        Self { kernel, last: None }
    }

    /// Takes the reading at `time_s` and tells what is known then. A missing reading is NaN, `None` or
    /// [`Reading::MISSING`]; the estimate is then a prediction. An infinite one is none that a sensor can have.
    ///
    /// # Errors
    /// If time goes backwards or is no number. The filter stays as it was: the next good row goes on from the last good one.
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
        let (Kernel { filter, translator, known }, reading) = (&mut self.kernel, reading.into());
        filter.step(time_s, translator.relative(reading))?;
        let mut said = filter.output();
        let mut row = translator.row((time_s, reading), &mut said);
        while let Some(known) = next_until(known, time_s) {
            row = translator.told((time_s, reading, &said), known);
        }
        self.last = Some((time_s, reading, said));
        Ok(row)
    }

    /// Takes in that the strain (or angle) is known now, to `sd`: the estimate of the last row, or of the first one if there is
    /// none yet, and those after it follow. What the error was then counts for seconds, and for an hour as far as more than one known
    /// strain, or one that is far from what was said, show an offset or another gain.
    ///
    /// # Errors
    /// If the strain lies beyond the limits by more than a tenth of them, or `sd` is not positive. The filter stays as it was.
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
        let Kernel { filter, translator, known } = &mut self.kernel;
        let strain = translator.scale.known(strain, sd)?;
        let Some((time_s, reading, said)) = &self.last else {
            known.push_front((f64::NEG_INFINITY, strain));
            return Ok(translator.scale.row(f64::NAN, Reading::MISSING, 0.0, &filter.output()));
        };
        Ok(translator.told((*time_s, *reading, said), strain))
    }

    /// What the rested, unstretched sensor is found to read from now on, in place of what it read in calibration.
    ///
    /// # Errors
    /// If it is not a positive number, or farther from the calibration's than by a factor of
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
        self.kernel.translator.rest_resistance(measured)
    }
}

/// A running filter that waits: each row is estimated from the readings up to a fixed lag after it. See
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
    /// Rows whose estimates wait for later readings.
    waiting: VecDeque<(f64, Reading)>,
    /// Estimates that have become due.
    due: Vec<Estimate>,
    /// Whether they have been handed out.
    are_out: bool,
}

impl LaggedFilter {
    pub(crate) const fn new(kernel: Kernel, lag_s: f64) -> Self {
        Self { kernel, lag_s, last_s: None, waiting: VecDeque::new(), due: Vec::new(), are_out: true }
    }

    /// Takes the reading at `time_s`, as [`Filter::step`] does, and hands out the rows that have become due, in order.
    ///
    /// # Errors
    /// As [`Filter::step`]. Rows that have become due meanwhile are handed out with the next step.
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
        let Kernel { filter, translator, .. } = &mut self.kernel;
        let relative = translator.relative(reading);
        let (waiting, due) = (&mut self.waiting, &mut self.due);
        let mut out = |mut output| due.extend(waiting.pop_front().map(|row| translator.row(row, &mut output)));
        let taken = filter.step_lagged(time_s, relative, lag_s, &mut out);
        if taken.is_err() {
            self.waiting.pop_back();
        }
        taken?;
        self.last_s = Some(time_s);
        self.are_out = true;
        Ok(&self.due)
    }

    /// Hands out the rows that still wait, from all readings there are.
    ///
    /// # Errors
    /// If a step backwards fails.
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
        let Kernel { filter, translator, .. } = &mut self.kernel;
        let (waiting, due) = (&mut self.waiting, &mut self.due);
        let mut out = |mut output| due.extend(waiting.pop_front().map(|row| translator.row(row, &mut output)));
        filter.flush_lagged(&mut out)?;
        self.are_out = true;
        Ok(&self.due)
    }

    /// As [`Filter::know`], for rows that are still to be handed out and those to come.
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
        let strain = self.kernel.translator.scale.known(strain, sd)?;
        self.kernel.known.push_front((f64::NEG_INFINITY, strain));
        if self.last_s.is_some() {
            self.take_known();
        }
        Ok(())
    }

    /// Takes in what is known by the last row. Rows are handed out as soon as they are due: it is after them.
    fn take_known(&mut self) {
        let Kernel { filter, translator, known } = &mut self.kernel;
        let Some(time_s) = self.last_s else { return };
        while let Some(known) = next_until(known, time_s) {
            translator.know(KnownStrain { time_s, known, said: filter.strain() });
        }
    }

    /// As [`Filter::rest_resistance`].
    ///
    /// # Errors
    /// If it is not a positive number, or farther from the calibration's than by a factor of
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
        self.kernel.translator.rest_resistance(measured)
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
        out.debug_struct("Filter").field("scale", &self.kernel.translator.scale).finish_non_exhaustive()
    }
}

impl fmt::Debug for LaggedFilter {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let (scale, lag_s, waiting) = (&self.kernel.translator.scale, &self.lag_s, &self.waiting.len());
        let mut out = out.debug_struct("LaggedFilter");
        out.field("scale", scale).field("lag_s", lag_s).field("waiting", waiting).finish_non_exhaustive()
    }
}
