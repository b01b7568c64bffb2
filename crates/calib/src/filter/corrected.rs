use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use ohmstrain_ekf::correction::{FEATURES, FeatureScale, OUTPUTS, ReadingFeatures, filter_inputs, mixture};
use ohmstrain_ekf::live::{Innovations, SURPRISING_NIS, Sieve};
use ohmstrain_ekf::{Gaussian, Guard, Reading, ReadingVerdict, StepError};

use crate::CalibrationError;
use crate::filter::learned::{Learned, OfFilter, OfSmoother};
use crate::filter::way_back::SEGMENT;
use crate::filter::{Filter, Output, Rows, WayBack};
use crate::params::correction::{FUTURE_FEATURES, smoother_inputs};

/// A filter with the learned correction of its strain. Everything else that it says is the filter's.
///
/// Where a reading is missing the correction holds what it has seen last, and its variance grows by as much as the filter's
/// has grown since. With a fixed lag the strain is the mixture of the filter's corrected strain and the lagged one.
pub(crate) struct Corrected {
    filter: Box<dyn Filter>,
    of_filter: Arc<OfFilter>,
    learned: Arc<Learned>,
    readings: Watched,
    /// What the filter has said of the last row.
    said: Option<Output>,
    /// Corrected strains of the rows that wait for a fixed lag, and how much larger innovations had been than stated.
    waiting: VecDeque<(Gaussian<f64>, f64)>,
    /// Lagged estimates on their way out.
    lagged: Vec<Output>,
}

/// What the correction has seen of the readings.
#[derive(Clone, Copy)]
struct Watched {
    features: ReadingFeatures<f64>,
    time_s: Option<f64>,
    /// The filter's variance at the last reading, once one has been missing since.
    known_variance: Option<f64>,
    /// How much larger the filter's innovations had been than stated, before the row; time of the last of them, s.
    innovations: Innovations<f64>,
    innovated_s: Option<f64>,
    birge: f64,
}

impl Watched {
    fn new(scale: FeatureScale<f64>) -> Self {
        let features = ReadingFeatures::new(scale);
        let innovations = Innovations::none();
        Self { features, time_s: None, known_variance: None, innovations, innovated_s: None, birge: 1.0 }
    }

    /// Takes a row in either direction of time.
    fn step(&mut self, time_s: f64, Seen { reading, surprises, nis }: Seen) -> Option<[f64; FEATURES]> {
        let dt_s = (time_s - self.time_s.unwrap_or(time_s)).abs();
        self.time_s = Some(time_s);
        self.birge = self.innovations.birge();
        if let Some(nis) = nis {
            let last_s = self.innovated_s.replace(time_s).unwrap_or(time_s);
            self.innovations.step((time_s - last_s).abs(), nis);
        }
        self.features.step_unless(surprises, dt_s, reading)
    }

    /// Whether the last row had no reading that is seen here.
    fn missing(&self) -> bool {
        self.features.is_waiting()
    }
}

impl Corrected {
    pub(crate) fn new(filter: Box<dyn Filter>, learned: &Arc<Learned>) -> Result<Self, CalibrationError> {
        Ok(Self {
            filter,
            of_filter: learned.for_filter()?,
            learned: Arc::clone(learned),
            readings: Watched::new(learned.params.readings.past()),
            said: None,
            waiting: VecDeque::new(),
            lagged: Vec::new(),
        })
    }

    /// Lets the correction see a row that the filter has taken.
    fn see(&mut self, time_s: f64, reading: Option<Reading<f64>>) {
        let said = self.filter.output();
        self.readings.step(time_s, Seen::new(&said, reading));
        if !self.readings.missing() {
            self.readings.known_variance = Some(said.estimate.strain.variance);
        }
        self.said = Some(said);
    }

    /// The filter's strain, corrected; as it is before the first reading.
    fn corrected(&self, output: &Output) -> Gaussian<f64> {
        let filtered = output.estimate.strain;
        let Some(past) = self.readings.features.now() else { return filtered };
        let inputs = filter_inputs(&outputs(output), &past);
        let strain = self.of_filter.correction().correct(&inputs, filtered, self.readings.birge).strain;
        let grown = self.readings.known_variance.map_or(0.0, |known| (filtered.variance - known).max(0.0));
        if self.readings.missing() { Gaussian { variance: strain.variance + grown, ..strain } } else { strain }
    }

    /// Mixes lagged estimates with what was said of their rows.
    fn hand_out(&mut self, out: &mut dyn FnMut(Output)) {
        for mut output in self.lagged.drain(..) {
            if let Some((corrected, birge)) = self.waiting.pop_front() {
                let lagged = output.estimate.strain;
                output.estimate.strain = mixture([corrected, Gaussian { variance: lagged.variance * birge, ..lagged }]);
            }
            out(output);
        }
    }
}

/// What the correction is shown of a row.
#[derive(Clone, Copy)]
struct Seen {
    reading: Option<f64>,
    /// Whether the filter would rather not have seen it.
    surprises: bool,
    /// Its normalised innovation squared.
    nis: Option<f64>,
}

impl Seen {
    /// As it was read.
    fn plain(reading: Option<Reading<f64>>) -> Self {
        let finite = |reading: Reading<f64>| Some(reading.value).filter(|value| value.is_finite());
        Self { reading: reading.and_then(finite), surprises: false, nis: None }
    }

    /// As the filter has taken it: nothing, if it was kept from it.
    fn new(output: &Output, reading: Option<Reading<f64>>) -> Self {
        let (is_seen, surprises) = match output.verdict {
            ReadingVerdict::Accepted | ReadingVerdict::Readmitted => (true, false),
            ReadingVerdict::Downweighted => (true, output.nis.is_some_and(|nis| nis > SURPRISING_NIS)),
            _ => (false, false),
        };
        Self { surprises, nis: output.nis.filter(|_| is_seen), ..Self::plain(reading.filter(|_| is_seen)) }
    }
}

/// What a correction sees of a filter's output.
pub(crate) fn outputs(output: &Output) -> [f64; OUTPUTS] {
    let estimate = &output.estimate;
    let [extend, _, retract] = output.phases.unwrap_or_default();
    [estimate.strain.mean, estimate.rate.mean, estimate.relaxation.mean, estimate.baseline, extend, retract]
}

impl Filter for Corrected {
    fn guard(&mut self, guard: Guard<f64>) {
        self.filter.guard(guard);
    }

    fn sieve(&mut self, sieve: Sieve<f64>) {
        self.filter.sieve(sieve);
    }

    fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) -> Result<(), StepError> {
        self.filter.step(time_s, reading)?;
        self.see(time_s, reading);
        Ok(())
    }

    fn strain(&self) -> Gaussian<f64> {
        self.output().estimate.strain
    }

    fn output(&self) -> Output {
        let mut output = self.said.unwrap_or_else(|| self.filter.output());
        output.estimate.strain = self.corrected(&output);
        output
    }

    fn step_lagged(
        &mut self,
        time_s: f64,
        reading: Option<Reading<f64>>,
        lag_s: f64,
        out: &mut dyn FnMut(Output),
    ) -> Result<(), StepError> {
        let lagged = &mut self.lagged;
        let stepped = self.filter.step_lagged(time_s, reading, lag_s, &mut |output| lagged.push(output));
        if stepped.is_ok() {
            self.see(time_s, reading);
            let corrected = self.strain();
            self.waiting.push_back((corrected, self.readings.birge));
        }
        self.hand_out(out);
        stepped
    }

    fn flush_lagged(&mut self, out: &mut dyn FnMut(Output)) -> Result<(), StepError> {
        let lagged = &mut self.lagged;
        let flushed = self.filter.flush_lagged(&mut |output| lagged.push(output));
        self.hand_out(out);
        flushed
    }

    fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> Result<Box<dyn WayBack + 'a>, (usize, StepError)> {
        let correction = self.learned.for_smoother().map_err(|_| (0, StepError::NoSmoother))?;
        let mut starts = Vec::with_capacity(rows.len() / SEGMENT + 1);
        let mut past = self.readings;
        for row in 0..rows.len() {
            if row % SEGMENT == 0 {
                starts.push(past);
            }
            let (time_s, reading) = rows.get(row);
            past.step(time_s, Seen::plain(reading));
        }
        // The filter says what it says at the end of the recording.
        (self.readings, self.said) = (past, None);
        let back = self.filter.way_back(rows)?;
        let ahead = Watched::new(self.learned.params.readings.future());
        Ok(Box::new(CorrectedWayBack { back, correction, rows, starts, ahead }))
    }
}

/// A smoother on its way back, corrected segment by segment.
struct CorrectedWayBack<'a> {
    back: Box<dyn WayBack + 'a>,
    correction: Arc<OfSmoother>,
    rows: Rows<'a>,
    /// What had been seen of the past before each segment that is still to come. Readings that were kept from the filter
    /// were seen here, as far as features go: within a segment they are not, and what was before it fades in seconds.
    starts: Vec<Watched>,
    /// What has been seen of the future.
    ahead: Watched,
}

impl WayBack for CorrectedWayBack<'_> {
    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        let Some(rows) = self.back.next_segment(out)? else { return Ok(None) };
        let Some(mut past) = self.starts.pop() else { return Ok(Some(rows)) };
        let mut known = past.known_variance;
        let mut behind = Vec::with_capacity(rows.len());
        for (row, output) in rows.clone().zip(out.iter()) {
            let (time_s, reading) = self.rows.get(row);
            let features = past.step(time_s, Seen::new(output, reading));
            known = if past.missing() { known } else { Some(output.estimate.strain.variance) };
            behind.push((features, known));
        }
        for ((row, output), (past, known)) in rows.clone().zip(out.iter_mut()).zip(behind).rev() {
            let (time_s, reading) = self.rows.get(row);
            let future = self.ahead.step(time_s, Seen::new(output, reading));
            let smoothed = output.estimate.strain;
            if !self.ahead.missing() {
                self.ahead.known_variance = Some(smoothed.variance);
            }
            let Some(past) = past else { continue };
            let mut strain = self.correct(output, &past, future);
            if self.ahead.missing() {
                // The readings on both sides bound what the smoother knows in between.
                let least = [known, self.ahead.known_variance].into_iter().flatten().reduce(f64::min).unwrap_or(0.0);
                strain.variance += (smoothed.variance - least).max(0.0);
            }
            output.estimate.strain = strain;
        }
        Ok(Some(rows))
    }
}

impl CorrectedWayBack<'_> {
    /// After the last reading the future is as at the last reading: settled.
    fn correct(&self, output: &Output, past: &[f64; FEATURES], future: Option<[f64; FEATURES]>) -> Gaussian<f64> {
        let future = future.map_or([0.0; FUTURE_FEATURES], future_features);
        let inputs = smoother_inputs(&outputs(output), past, &future);
        self.correction.correction().correct(&inputs, output.estimate.strain, 1.0).strain
    }
}

/// Features of the readings to come: without the reading itself, which those of the past have.
pub(crate) fn future_features([_, others @ ..]: [f64; FEATURES]) -> [f64; FUTURE_FEATURES] {
    others
}

#[cfg(test)]
mod tests;
