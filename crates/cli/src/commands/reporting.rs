use std::path::Path;

use ohmstrain::trace::TraceFile;
use ohmstrain::verdict::{Known, verdict};
use ohmstrain::{EstimatorKind, Scores, Sensor, Tested};

use super::scoring;
use crate::args::ReportArgs;
use crate::error::CliError;
use crate::output::{Claim, Kind, Outputs};
use crate::printable::printable;
use crate::run::estimate;
use ohmstrain::MADE_BY;
use ohmstrain_report::{FigureFiles, Report, ReportInput, Sample, ScoreRow, Scored};

/// Subject of a report.
pub struct Reporting<'a> {
    pub recording: &'a TraceFile,
    pub sensor: &'a Sensor,
    /// Estimator; `None` for the sensor's own choice.
    pub kind: Option<EstimatorKind>,
    /// Reading of the rested sensor, if it differs from that in calibration.
    pub rest_resistance: Option<f64>,
    /// The rows that are scored, and whether they were calibrated on.
    pub part: Scored,
    pub sample: Sample,
    /// Scores on rows that were kept from the calibration, if known.
    pub tested: Option<&'a Tested>,
    /// Further facts: heading and text.
    pub facts: &'a [(&'static str, String)],
}

/// A report and its plots.
pub struct Drawn {
    html: String,
    figures: Vec<FigureFiles>,
}

/// Destination of report and figures.
pub struct Wanted<'a> {
    report: Option<Claim>,
    figures: Option<&'a Path>,
}

impl<'a> Wanted<'a> {
    /// Claims the requested files; `None` if none are requested.
    pub fn claim(args: &'a ReportArgs, outputs: &mut Outputs) -> Result<Option<Self>, CliError> {
        let report = args.report.as_deref().map(|path| outputs.claim(path, Kind::Report)).transpose()?;
        let figures = args.figures.as_deref();
        figures.map_or(Ok(()), |folder| outputs.folder(folder))?;
        Ok((report.is_some() || figures.is_some()).then_some(Self { report, figures }))
    }

    /// Puts report and figures into their places.
    pub fn put(self, drawn: Drawn, outputs: &mut Outputs) -> Result<(), CliError> {
        if let Some(claim) = self.report {
            outputs.put(claim, drawn.html);
        }
        let Some(folder) = self.figures else { return Ok(()) };
        put_figures(folder, drawn.figures, outputs)
    }
}

/// Puts figures into a folder.
pub fn put_figures(folder: &Path, figures: Vec<FigureFiles>, outputs: &mut Outputs) -> Result<(), CliError> {
    for FigureFiles { name, svg, csv } in figures {
        for (ending, content) in [("svg", svg), ("csv", csv)] {
            let claim = outputs.claim(&folder.join(format!("{name}.{ending}")), Kind::Figure)?;
            outputs.put(claim, content.into_bytes());
        }
    }
    Ok(())
}

impl Reporting<'_> {
    /// Estimates, scores and draws.
    pub fn drawn(&self) -> Result<Drawn, CliError> {
        let Self { recording, sensor, part, .. } = *self;
        let (params, rest_reading) = (sensor.params(), sensor.rest_reading(self.rest_resistance));
        let estimated = estimate(recording, sensor, self.rest_resistance, self.kind, &[])?;
        let kind = self.kind.unwrap_or(params.default_estimator);
        let moved = params.rest_reading / rest_reading;
        let filter = scoring::of_estimates(recording, &estimated.filtered, part);
        let smoother = scoring::of_estimates(recording, &estimated.smoothed, part);
        let cubic = scoring::of_baseline(recording, ohmstrain_calib::running_cubic(params.static_cubic), part, moved);
        let rows = [("filter", filter), ("smoother", smoother), ("static cubic", cubic)];
        let scores: Vec<ScoreRow> =
            rows.into_iter().filter_map(|(name, scores)| scores.map(|scores| ScoreRow { name, scores })).collect();
        let name =
            Path::new(&recording.name).file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
        let input = ReportInput {
            title: &printable(&name),
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
            estimator: kind,
            scores: &scores,
            verdict: filter.map(|filter| self.verdict(&filter, cubic.as_ref())),
            facts: self.facts,
        };
        let failed = |error: ohmstrain_report::ReportError| CliError::Other(error.to_string());
        let report = Report::new(&input).map_err(failed)?;
        Ok(Drawn { html: report.html().map_err(failed)?, figures: report.figures().map_err(failed)? })
    }

    /// Returns the verdict. Rows that were calibrated on look better than others, so known scores of those others count, too.
    fn verdict(&self, filter: &Scores, cubic: Option<&Scores>) -> String {
        let params = self.sensor.params();
        let left_out = params.summary.as_ref().filter(|_| self.sample != Sample::Out).map(Known::from);
        let known = [Known::new(filter, cubic)].into_iter().chain(left_out).chain(self.tested.map(Known::from));
        verdict(&known.collect::<Vec<_>>())
    }
}
