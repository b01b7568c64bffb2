use std::ops::Range;
use std::sync::Arc;

use ohmstrain_ekf::correction::{FEATURES, FeatureScale, OUTPUTS, ReadingFeatures};
use ohmstrain_ekf::live::SURPRISING_NIS;
use ohmstrain_ekf::{Gaussian, Reading, ReadingVerdict, StepError};

use crate::params::correction::{FUTURE_FEATURES, smoother_inputs};
use crate::run::last_rows::LastRows;
use crate::run::learned::{Learned, OfSmoother};
use crate::run::turns::Turns;
use crate::run::{Output, Rows, SEGMENT, WayBack};

/// The backward pass of a smoother, corrected segment by segment. Only the strain is corrected.
///
/// At a missing reading the correction keeps its last features, and its variance grows as much as the smoother's has
/// since.
pub(crate) struct CorrectedWayBack<'a> {
    back: Box<dyn WayBack + 'a>,
    correction: Arc<OfSmoother>,
    rows: Rows<'a>,
    /// Features of the past before each segment not yet smoothed. These include readings that the filter rejected;
    /// within a segment they are excluded, and the effect of earlier ones fades in seconds.
    starts: Vec<Watched>,
    /// Features of the future.
    ahead: Watched,
    filtered: LastRows,
}

/// Features of the readings, for the correction.
#[derive(Clone, Copy)]
struct Watched {
    features: ReadingFeatures<f64>,
    time_s: Option<f64>,
    /// The smoother's variance at the last reading.
    known_variance: Option<f64>,
}

impl Watched {
    fn new(scale: FeatureScale<f64>) -> Self {
        Self { features: ReadingFeatures::new(scale), time_s: None, known_variance: None }
    }

    /// Takes a row, in either direction of time.
    fn step(
        &mut self,
        time_s: f64,
        CorrectionReading { reading, surprises }: CorrectionReading,
    ) -> Option<[f64; FEATURES]> {
        let dt_s = (time_s - self.time_s.unwrap_or(time_s)).abs();
        self.time_s = Some(time_s);
        self.features.step_unless(surprises, dt_s, reading)
    }

    /// True if the last row had no reading for the features.
    fn missing(&self) -> bool {
        self.features.is_waiting()
    }
}

/// Input of the correction at a row.
#[derive(Clone, Copy)]
struct CorrectionReading {
    reading: Option<f64>,
    /// True if the reading surprised the filter.
    surprises: bool,
}

impl CorrectionReading {
    /// Returns the reading as it was read.
    fn plain(reading: Option<Reading<f64>>) -> Self {
        let finite = |reading: Reading<f64>| Some(reading.value).filter(|value| value.is_finite());
        Self { reading: reading.and_then(finite), surprises: false }
    }

    /// Returns the reading as the filter used it: none if it was rejected.
    fn new(output: &Output, reading: Option<Reading<f64>>) -> Self {
        let is_weighed_down = output.verdict == ReadingVerdict::Downweighted;
        let surprises = is_weighed_down && output.nis.is_some_and(|nis| nis > SURPRISING_NIS);
        Self { surprises, ..Self::plain(reading.filter(|_| output.verdict.is_taken())) }
    }
}

/// Returns the inputs of a correction from a filter's output.
#[must_use]
pub fn outputs(output: &Output) -> [f64; OUTPUTS] {
    let estimate = &output.estimate;
    let [extend, _, retract] = output.phases.unwrap_or_default();
    [estimate.strain.mean, estimate.rate.mean, estimate.relaxation.mean, estimate.baseline, extend, retract]
}

impl<'a> CorrectedWayBack<'a> {
    /// Wraps the backward pass of a smoother over a recording.
    pub(crate) fn new(back: Box<dyn WayBack + 'a>, learned: &Learned, rows: Rows<'a>, filtered: LastRows) -> Self {
        let correction = Arc::clone(&learned.smoother);
        let mut starts = Vec::with_capacity(rows.len() / SEGMENT + 1);
        let mut past = Watched::new(learned.readings);
        for row in 0..rows.len() {
            if row % SEGMENT == 0 {
                starts.push(past);
            }
            let (time_s, reading) = rows.get(row);
            past.step(time_s, CorrectionReading::plain(reading));
        }
        Self { back, correction, rows, starts, ahead: Watched::new(learned.readings.future()), filtered }
    }

    /// Corrects a smoothed row. After the last reading, the future is taken as settled, as at the last reading.
    fn correct(&self, output: &Output, past: &[f64; FEATURES], future: Option<[f64; FEATURES]>) -> Gaussian<f64> {
        let future = future.map_or([0.0; FUTURE_FEATURES], future_features);
        let inputs = smoother_inputs(&outputs(output), past, &future);
        self.correction.correction().correct(&inputs, output.estimate.strain, 1.0).strain
    }
}

impl WayBack for CorrectedWayBack<'_> {
    fn turns(&self) -> &Turns {
        self.back.turns()
    }

    fn next_segment(&mut self, out: &mut Vec<Output>) -> Result<Option<Range<usize>>, (usize, StepError)> {
        let Some(rows) = self.back.next_segment(out)? else { return Ok(None) };
        let Some(mut past) = self.starts.pop() else { return Ok(Some(rows)) };
        let mut known = past.known_variance;
        let mut behind = Vec::with_capacity(rows.len());
        for (row, output) in rows.clone().zip(out.iter()) {
            let (time_s, reading) = self.rows.get(row);
            let features = past.step(time_s, CorrectionReading::new(output, reading));
            known = if past.missing() { known } else { Some(output.estimate.strain.variance) };
            behind.push((features, known));
        }
        for ((row, output), (past, known)) in rows.clone().zip(out.iter_mut()).zip(behind).rev() {
            let (time_s, reading) = self.rows.get(row);
            let future = self.ahead.step(time_s, CorrectionReading::new(output, reading));
            let smoothed = output.estimate.strain;
            if !self.ahead.missing() {
                self.ahead.known_variance = Some(smoothed.variance);
            }
            let Some(past) = past else { continue };
            let mut strain = self.correct(output, &past, future);
            if self.ahead.missing() {
                // The variance at the readings on both sides is the lower bound in between.
                let least = [known, self.ahead.known_variance].into_iter().flatten().reduce(f64::min).unwrap_or(0.0);
                strain.variance += (smoothed.variance - least).max(0.0);
            }
            output.estimate.strain = self.filtered.mixed(row, time_s, strain);
        }
        Ok(Some(rows))
    }
}

/// Returns the features of the future: without the reading itself, which the features of the past contain.
#[must_use]
pub fn future_features([_, others @ ..]: [f64; FEATURES]) -> [f64; FUTURE_FEATURES] {
    others
}

#[cfg(test)]
mod tests;
