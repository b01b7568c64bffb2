//! The report: one HTML file that needs neither network nor scripts, with plots, scores and parameters.
//!
//! Any input gives a report: missing readings and references break lines, what cannot be drawn is said in words. Its
//! size does not grow with the recording's length (see [`thin`]). The same input gives the same bytes.

mod axis;
mod chart;
mod consistency;
mod figures;
mod ink;
mod innovations;
mod law;
mod motion;
pub mod number;
mod recording;
mod summary;
mod tables;
mod thin;

use minijinja::Environment;
use minijinja::value::Serde;
use ohmstrain_calib::{Output, SensorParams};
use serde::Serialize;

use figures::Figure;
use innovations::Innovations;
use recording::Recording;
use tables::Table;

/// What a report shows. All slices have one entry per row of the recording.
#[derive(Clone, Copy, Debug)]
pub struct ReportInput<'a> {
    /// Heading, the recording's name for instance.
    pub title: &'a str,
    /// Program and version.
    pub made_by: &'a str,
    /// Times, s.
    pub time_s: &'a [f64],
    /// Readings; NaN where missing.
    pub reading: &'a [f64],
    /// Reference; NaN where missing.
    pub truth: Option<&'a [f64]>,
    /// The filter's outputs.
    pub filtered: &'a [Output],
    /// The smoother's outputs.
    pub smoothed: &'a [Output],
    /// The sensor.
    pub params: &'a SensorParams,
    /// R₀ of this recording, in the unit of the readings.
    pub rest_reading: f64,
    /// Start of the part that the scores are about, if it is not everything.
    pub scored_from_s: Option<f64>,
    /// Scores, the filter's first.
    pub scores: &'a [ScoreRow<'a>],
}

/// How well one estimator did.
#[derive(Clone, Copy, Debug)]
pub struct ScoreRow<'a> {
    /// Its name.
    pub name: &'a str,
    /// Root mean squared error, in the quantity's unit.
    pub rmse: f64,
    /// The same in percent of full scale.
    pub rmse_percent_fs: f64,
    /// Share of rows, 0 to 1, whose 95 % interval holds the reference; `None` for an estimator without intervals.
    pub coverage_95: Option<f64>,
    /// Mean width of those intervals in percent of full scale.
    pub width_95_percent_fs: Option<f64>,
    /// Mean continuous ranked probability score in percent of full scale.
    pub crps_percent_fs: f64,
}

/// Why there is no report.
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

/// What the template shows.
#[derive(Debug, Serialize)]
struct Page<'a> {
    title: &'a str,
    made_by: &'a str,
    summary: String,
    scores: Option<Table>,
    sections: Vec<Section>,
    inks: Vec<ink::Style>,
}

/// A part of the report.
#[derive(Debug, Serialize)]
struct Section {
    title: &'static str,
    text: String,
    figures: Vec<Figure>,
    tables: Vec<Table>,
}

/// The report as HTML.
///
/// # Errors
/// If a plot cannot be drawn or the template cannot be filled; no input is known that does this.
pub fn render(input: &ReportInput) -> Result<String, ReportError> {
    let recording = Recording::new(input);
    let innovations = Innovations::new(input.filtered);
    let scores = (!input.scores.is_empty()).then(|| tables::scores(input.scores, input.params.quantity));
    let mut environment = Environment::new();
    environment.add_template("report.html", include_str!("report.html"))?;
    let page = Page {
        title: input.title,
        made_by: input.made_by,
        summary: summary::sentences(input, &recording),
        scores,
        sections: sections(&recording, &innovations)?,
        inks: ink::styles(chart::UNITS_PER_PX),
    };
    Ok(environment.get_template("report.html")?.render(Serde(page))?)
}

fn sections(recording: &Recording, innovations: &Innovations) -> Result<Vec<Section>, ReportError> {
    let mut sections = vec![];
    if recording.time_s.iter().any(|time| time.is_finite()) {
        sections.push(Section {
            title: "The recording",
            text: String::new(),
            figures: vec![figures::reading(recording)?, figures::strain(recording)?],
            tables: vec![],
        });
        sections.push(sensor_behaviour(recording)?);
        sections.push(consistency_of(recording, innovations)?);
    }
    sections.push(Section {
        title: "The sensor",
        text: String::new(),
        figures: vec![figures::gauge(recording)?],
        tables: tables::parameters(recording.params, recording.rest_reading),
    });
    Ok(sections)
}

fn sensor_behaviour(recording: &Recording) -> Result<Section, ReportError> {
    let relaxation = figures::relaxation(recording)?;
    let text = match relaxation {
        Some(_) => String::new(),
        None => format!(
            "No relaxation is plotted: the recording holds still nowhere for {} s or more after a motion.",
            recording::SHORTEST_HOLD_S
        ),
    };
    let figures = std::iter::once(figures::hysteresis(recording)?).chain(relaxation).collect();
    Ok(Section { title: "Hysteresis and relaxation", text, figures, tables: vec![] })
}

fn consistency_of(recording: &Recording, innovations: &Innovations) -> Result<Section, ReportError> {
    let figures = if innovations.count > 0 {
        vec![
            consistency::size(recording, innovations)?,
            consistency::histogram(innovations)?,
            consistency::autocorrelation(innovations)?,
        ]
    } else {
        vec![]
    };
    Ok(Section { title: "Consistency", text: summary::consistency(innovations), figures, tables: vec![] })
}

#[cfg(test)]
mod tests;
