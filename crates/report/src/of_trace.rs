//! The report on a recording: its estimates by filter and smoother, their scores, and the verdict on them.

use ohmstrain::trace::TraceFile;
use ohmstrain::{Error, Estimate, EstimatorKind, Known, MADE_BY, Reading, Scores, Sensor, StepError, Tested, verdict};
use ohmstrain_calib::running_cubic;

use crate::{FigureFiles, Report, ReportError, ReportInput, Sample, ScoreRow, Scored, scoring};

/// Subject of a report.
#[derive(Clone, Copy, Debug)]
pub struct Reporting<'a> {
    /// The recording, at the sensor's reference temperature.
    pub recording: &'a TraceFile,
    /// The sensor.
    pub sensor: &'a Sensor,
    /// Estimator; `None` for the sensor's own choice.
    pub kind: Option<EstimatorKind>,
    /// Reading of the rested sensor, if it differs from that in calibration.
    pub rest_resistance: Option<f64>,
    /// The rows that are scored.
    pub part: Scored,
    /// Overlap of these rows with the calibration.
    pub sample: Sample,
    /// Scores on rows that were kept from the calibration, if known.
    pub tested: Option<&'a Tested>,
    /// Further facts: heading and text.
    pub facts: &'a [(&'static str, String)],
}

/// A report and its plots.
pub struct Drawn {
    /// The report, one page of HTML.
    pub html: String,
    /// The plots as files.
    pub figures: Vec<FigureFiles>,
}

/// Results of both passes over a recording.
#[derive(Clone, Debug)]
pub struct Estimated {
    /// The filter's estimates, row by row.
    pub filtered: Vec<Estimate>,
    /// The smoother's.
    pub smoothed: Vec<Estimate>,
}

/// Reason why a recording has no estimates, or no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportingError {
    /// No filter can be built.
    #[error(transparent)]
    Build(Error),
    /// The filter refused a row.
    #[error("{source}")]
    Row {
        /// Index of the row, from zero.
        row: usize,
        /// Error of the step.
        source: StepError,
    },
    /// The recording as a whole was refused.
    #[error(transparent)]
    Rows(Error),
    /// The report cannot be drawn.
    #[error(transparent)]
    Report(#[from] ReportError),
}

impl Reporting<'_> {
    /// Estimates, scores and draws; `title` is the heading.
    ///
    /// # Errors
    /// As [`estimate`]; or if the report cannot be drawn; no input is known that does this.
    pub fn drawn(&self, title: &str) -> Result<Drawn, ReportingError> {
        let Self { recording, sensor, part, .. } = *self;
        let (params, rest_reading) = (sensor.params(), sensor.rest_reading(self.rest_resistance));
        let estimated = estimate(recording, sensor, self.rest_resistance, self.kind, &[])?;
        let moved = params.rest_reading / rest_reading;
        let filter = scoring::of_estimates(recording, &estimated.filtered, part);
        let smoother = scoring::of_estimates(recording, &estimated.smoothed, part);
        let cubic = scoring::of_baseline(recording, running_cubic(params.static_cubic), part, moved);
        let rows = [("filter", filter), ("smoother", smoother), ("static cubic", cubic)];
        let scores: Vec<ScoreRow> =
            rows.into_iter().filter_map(|(name, scores)| scores.map(|scores| ScoreRow { name, scores })).collect();
        let report = Report::new(&ReportInput {
            title,
            made_by: MADE_BY,
            time_s: &recording.trace.time_s,
            reading: &recording.trace.readings.values,
            truth: recording.trace.reference.as_ref().map(|reference| reference.values.as_slice()),
            filtered: &estimated.filtered,
            smoothed: &estimated.smoothed,
            params,
            rest_reading,
            scored: part,
            sample: self.sample,
            estimator: self.kind.unwrap_or(params.default_estimator),
            scores: &scores,
            verdict: filter.map(|filter| self.verdict(&filter, cubic.as_ref())),
            facts: self.facts,
        })?;
        Ok(Drawn { html: report.html()?, figures: report.figures()? })
    }

    /// Returns the verdict. Rows that were calibrated on look better than others, so known scores of those others count, too.
    fn verdict(&self, filter: &Scores, cubic: Option<&Scores>) -> String {
        let params = self.sensor.params();
        let left_out = params.summary.as_ref().filter(|_| self.sample != Sample::Out).map(verdict::Known::from);
        let known = [verdict::Known::new(filter, cubic)].into_iter().chain(left_out);
        let known: Vec<_> = known.chain(self.tested.map(verdict::Known::from)).collect();
        let kind = self.kind.unwrap_or(params.default_estimator);
        if kind == EstimatorKind::StaticCubic { verdict::of_static_curve(&known) } else { verdict::verdict(&known) }
    }
}

/// Filters and smooths a recording in which some strains are `known`; `kind` replaces the sensor's default estimator.
///
/// # Errors
/// If no filter can be built, or a row is refused.
pub fn estimate(
    recording: &TraceFile,
    sensor: &Sensor,
    rest_resistance: Option<f64>,
    kind: Option<EstimatorKind>,
    known: &[Known],
) -> Result<Estimated, ReportingError> {
    let mut builder = sensor.filter().known(known).estimator(kind.unwrap_or(sensor.params().default_estimator));
    if let Some(measured) = rest_resistance {
        builder = builder.rest_resistance(measured);
    }
    let mut filter = builder.build().map_err(ReportingError::Build)?;
    let time_s = &recording.trace.time_s;
    let readings: Vec<Reading> = (0..time_s.len()).map(|row| recording.reading(row).1).collect();
    let mut filtered = Vec::with_capacity(time_s.len());
    for (row, (&time_s, &reading)) in time_s.iter().zip(&readings).enumerate() {
        filtered.push(filter.step(time_s, reading).map_err(|error| match error {
            Error::Step(source) => ReportingError::Row { row, source },
            other => ReportingError::Rows(other),
        })?);
    }
    let smoothed = builder.smooth_readings(time_s, &readings).map_err(ReportingError::Rows)?;
    Ok(Estimated { filtered, smoothed })
}
