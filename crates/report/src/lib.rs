//! The report: one HTML file that needs neither network nor scripts, with plots, scores and parameters. With scripts, plots
//! show the values under the pointer and can be zoomed.
//!
//! The feature `trace` adds reports on recordings as a sensor estimates them.
//!
//! Any input gives a report: missing readings and references break lines, what cannot be drawn is said in words. Its
//! size does not grow with the recording's length (`thin.rs`). The same input gives the same bytes.

mod axis;
mod chart;
mod consistency;
mod errors;
mod figures;
mod held;
mod ink;
mod innovations;
mod law;
mod motion;
#[cfg(feature = "trace")]
mod of_trace;
mod pieces;
mod recording;
mod relation;
#[cfg(feature = "trace")]
pub mod scoring;
mod speeds;
mod summary;
mod tables;
mod thin;

use minijinja::Environment;
use minijinja::value::Serde;
use ohmstrain::{Estimate, EstimatorKind, Scores, SensorParams};
use serde::Serialize;

pub use axis::Axis;
pub use chart::{Chart, WIDE};
use figures::Figure;
pub use ink::Ink;
use innovations::Innovations;
pub use law::Law;
#[cfg(feature = "trace")]
pub use of_trace::{Drawn, Estimated, Reporting, ReportingError, estimate};
use recording::PlottedRecording;
use tables::Table;

/// Content of a report. All slices have one entry per row of the recording.
#[derive(Clone, Debug)]
pub struct ReportInput<'a> {
    /// Heading, the recording's name for instance.
    pub title: &'a str,
    /// Name and version of the program.
    pub made_by: &'a str,
    /// Times, s.
    pub time_s: &'a [f64],
    /// Readings; NaN where missing.
    pub reading: &'a [f64],
    /// Reference; NaN where missing.
    pub truth: Option<&'a [f64]>,
    /// The filter's estimates.
    pub filtered: &'a [Estimate],
    /// The smoother's estimates.
    pub smoothed: &'a [Estimate],
    /// The sensor.
    pub params: &'a SensorParams,
    /// R₀ of this recording, in the unit of the readings.
    pub rest_reading: f64,
    /// The part that is scored.
    pub scored: Scored,
    /// Sample that the part belongs to.
    pub sample: Sample,
    /// The estimator.
    pub estimator: EstimatorKind,
    /// Scores, the filter's first.
    pub scores: &'a [ScoreRow<'a>],
    /// Verdict on the scores, in a sentence.
    pub verdict: Option<String>,
    /// Further facts about the calibration: heading and text.
    pub facts: &'a [(&'static str, String)],
}

/// The rows that are scored, by their times.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scored {
    /// Rows at this time, s, or later; `None` for all.
    pub from_s: Option<f64>,
    /// Rows before this time, s; `None` for all.
    pub until_s: Option<f64>,
}

impl Scored {
    /// Returns the rows from a time on, s; all for `None`.
    #[must_use]
    pub const fn since(from_s: Option<f64>) -> Self {
        Self { from_s, until_s: None }
    }

    /// True if a row at this time, s, is one of them.
    #[must_use]
    pub fn holds(self, time_s: f64) -> bool {
        self.from_s.is_none_or(|from_s| time_s >= from_s) && self.until_s.is_none_or(|until_s| time_s < until_s)
    }
}

/// Overlap of rows with the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sample {
    /// All rows were calibrated on.
    In,
    /// Some rows were calibrated on.
    Partly,
    /// No row was calibrated on.
    Out,
}

impl Sample {
    /// Compares times, s, of a file's rows with those of the calibration's file with the same hash.
    #[must_use]
    pub fn of(time_s: &[f64], sha256: &str, params: &SensorParams, scored: Scored) -> Self {
        let of_it = params.recordings.iter().filter(|info| info.sha256 == sha256);
        let seen = |time_s: &&f64| of_it.clone().any(|info| (info.first_s..=info.last_s).contains(*time_s));
        let rows = time_s.iter().filter(|time_s| scored.holds(**time_s));
        match rows.clone().filter(seen).count() {
            0 => Self::Out,
            all if all == rows.count() => Self::In,
            _ => Self::Partly,
        }
    }

    /// Returns its name, in a word or two.
    pub const fn name(self) -> &'static str {
        match self {
            Self::In => "in-sample",
            Self::Partly => "partly in-sample",
            Self::Out => "not calibrated on",
        }
    }
}

/// Scores of one estimator.
#[derive(Clone, Copy, Debug)]
pub struct ScoreRow<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its scores.
    pub scores: Scores,
}

/// Reason why there is no report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The plotting library failed.
    #[error("cannot draw a plot of the report: {0}")]
    Plot(String),
    /// The template failed.
    #[error("cannot fill the report's template: {0}")]
    Template(#[from] minijinja::Error),
}

/// Content of the template.
#[derive(Debug, Serialize)]
struct Page<'a> {
    title: &'a str,
    made_by: &'a str,
    #[serde(skip)]
    sample: Sample,
    estimator: &'static str,
    headline: String,
    verdict: Option<String>,
    summary: String,
    facts: &'a [(&'static str, String)],
    scores: Option<Table>,
    sections: Vec<Section>,
    inks: Vec<ink::Style>,
}

/// A part of the report.
#[derive(Debug, Serialize)]
struct Section {
    title: &'static str,
    /// True if it is folded initially.
    folded: bool,
    text: String,
    figures: Vec<Figure>,
    tables: Vec<Table>,
}

/// A plot as files.
pub struct FigureFiles {
    /// Name without its ending.
    pub name: String,
    /// The drawing.
    pub svg: String,
    /// Drawn data.
    pub csv: String,
}

/// A report that has been drawn.
pub struct Report<'a> {
    page: Page<'a>,
}

impl<'a> Report<'a> {
    /// Draws the plots.
    ///
    /// # Errors
    /// If a plot cannot be drawn; no input is known that does this.
    pub fn new(input: &ReportInput<'a>) -> Result<Self, ReportError> {
        let recording = PlottedRecording::new(input);
        let innovations = Innovations::new(input.filtered);
        let scores =
            (!input.scores.is_empty()).then(|| tables::scores(input.scores, input.params.quantity, input.sample));
        let page = Page {
            title: input.title,
            made_by: input.made_by,
            sample: input.sample,
            estimator: input.estimator.name(),
            headline: summary::headline(&recording),
            verdict: input.verdict.clone(),
            summary: summary::extent_of(&recording),
            facts: input.facts,
            scores,
            sections: sections(&recording, &innovations)?,
            inks: ink::styles(chart::UNITS_PER_PX),
        };
        Ok(Self { page })
    }

    /// Renders the report as HTML.
    ///
    /// # Errors
    /// If the template cannot be filled; no input is known that does this.
    pub fn html(&self) -> Result<String, ReportError> {
        Ok(Environment::new().render_named_str("report.html", PAGE, Serde(&self.page))?)
    }

    /// Returns every plot as files of its own.
    ///
    /// # Errors
    /// If a plot cannot be drawn; no input is known that does this.
    pub fn figures(&self) -> Result<Vec<FigureFiles>, ReportError> {
        let figures = self.page.sections.iter().flat_map(|section| &section.figures);
        let Page { made_by, sample, .. } = self.page;
        // Each file carries the note on its rows, wherever it is taken.
        let made_by = if sample == Sample::Out { made_by.into() } else { format!("{made_by}, {}", sample.name()) };
        figures.map(|figure| files(&figure.chart, &figure.title, &figure.file, &made_by)).collect()
    }
}

/// The template of a report.
pub const PAGE: &str = include_str!("report.html");

/// Returns a chart as files of its own; `name` is their name without the endings.
///
/// # Errors
/// If it cannot be drawn; no such chart is known.
pub fn files(chart: &Chart, title: &str, name: &str, made_by: &str) -> Result<FigureFiles, ReportError> {
    let by = format!("Generated by {made_by}");
    let svg = chart.standalone(title)?;
    let (svg, csv) = (format!("<!-- {by} -->\n{svg}"), format!("# {by}\n# {title}\n{}", chart.csv()));
    Ok(FigureFiles { name: name.into(), svg, csv })
}

/// Converts a title to the name of a file.
pub fn slug(title: &str) -> String {
    let word = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    let name: String = title.chars().map(word).collect();
    name.split('-').filter(|part| !part.is_empty()).collect::<Vec<_>>().join("-")
}

fn sections(recording: &PlottedRecording, innovations: &Innovations) -> Result<Vec<Section>, ReportError> {
    let mut sections = vec![];
    let plain = |title, figures| Section { title, folded: false, text: String::new(), figures, tables: vec![] };
    if recording.time_s.iter().any(|time| time.is_finite()) {
        let strain = std::iter::once(figures::strain(recording)?).chain(errors::strain(recording)?);
        sections.push(plain("The recording", strain.chain([figures::reading(recording)?]).collect()));
        let (pieces, text) = pieces::strain(recording)?;
        if !pieces.is_empty() {
            sections.push(Section { folded: true, text, ..plain("Piece by piece", pieces) });
        }
        sections.push(sensor_behaviour(recording)?);
        sections.push(consistency_of(recording, innovations)?);
    } else {
        sections.push(plain("The sensor", vec![relation::gauge(recording)?]));
    }
    let tables = tables::parameters(recording.params, recording.rest_reading);
    sections.push(Section { folded: true, tables, ..plain("The sensor in numbers", vec![]) });
    Ok(sections)
}

fn sensor_behaviour(recording: &PlottedRecording) -> Result<Section, ReportError> {
    let relaxation = held::relaxation(recording)?;
    let text = match relaxation {
        Some(_) => String::new(),
        None => format!(
            "No relaxation is plotted: the recording holds still nowhere for {} s or more after a motion.",
            recording::SHORTEST_HOLD_S
        ),
    };
    let figures = std::iter::once(relation::hysteresis(recording)?)
        .chain(speeds::loops(recording)?)
        .chain([relation::gauge(recording)?])
        .chain(held::levels(recording)?)
        .chain(relaxation)
        .chain(held::rate(recording)?)
        .collect();
    Ok(Section { title: "The sensor", folded: false, text, figures, tables: vec![] })
}

fn consistency_of(recording: &PlottedRecording, innovations: &Innovations) -> Result<Section, ReportError> {
    let mut figures: Vec<Figure> = errors::reading(recording)?.into_iter().collect();
    if innovations.count > 0 {
        figures.push(consistency::size(recording, innovations)?);
        figures.push(consistency::histogram(innovations)?);
        figures.push(consistency::autocorrelation(innovations)?);
    }
    let text = summary::consistency(innovations);
    Ok(Section { title: "Statistics: residuals and innovations", folded: true, text, figures, tables: vec![] })
}

#[cfg(test)]
mod tests;
