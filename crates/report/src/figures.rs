//! The plots of readings and strain against time.

use std::ops::Range;

use ohmstrain::Estimate;
use serde::Serialize;

use super::axis::{Axis, extent};
use super::chart::{Chart, WIDE};
use super::ink::{Ink, Key};
use super::recording::PlottedRecording;
use super::{ReportError, Scored, slug};

/// A plot with its heading, legend and note.
#[derive(Debug, Serialize)]
pub struct Figure {
    /// Heading.
    pub title: String,
    /// The drawing; markup, not to be escaped.
    pub svg: String,
    /// Keys of its layers.
    pub legend: Vec<Key>,
    /// Note on how to read it.
    pub note: String,
    /// True if it shares its line with the next one.
    pub half: bool,
    /// Name of its files without their ending: the same for every recording, so that a paper can include them.
    #[serde(skip)]
    pub file: String,
    /// Chart that it was drawn from.
    #[serde(skip)]
    pub chart: Chart,
}

impl Figure {
    /// Draws a chart.
    pub fn new(chart: Chart, title: &str, note: &str, half: bool) -> Result<Self, ReportError> {
        let svg = chart.svg(&format!("{title}. {note}"))?;
        let (title, file, note) = (title.into(), slug(title), note.into());
        Ok(Self { title, svg, legend: chart.legend(), note, half, file, chart })
    }
}

/// Largest number of ticks on an axis.
pub const WIDE_TICKS: usize = 10;
pub const HALF_TICKS: usize = 6;
pub const HIGH_TICKS: usize = 6;

/// Returns a time axis over the whole recording.
pub fn time_axis(recording: &PlottedRecording) -> Axis {
    let (first, last) = extent(recording.time_s.iter().copied()).unwrap_or((0.0, 1.0));
    Axis::linear("Time, s", first, last, WIDE_TICKS)
}

/// Marks the scored part.
pub fn mark_test(chart: &mut Chart, recording: &PlottedRecording) {
    if recording.scored == Scored::default() {
        return;
    }
    let (first, last) = extent(recording.time_s.iter().copied()).unwrap_or((0.0, 0.0));
    let Scored { from_s, until_s } = recording.scored;
    chart.shade(Ink::TEST, "scored part", from_s.unwrap_or(first), until_s.unwrap_or(last));
}

/// Pairs values with their times.
pub fn against_time<'a>(recording: &PlottedRecording<'a>, values: impl Iterator<Item = f64> + 'a) -> Vec<(f64, f64)> {
    recording.time_s.iter().copied().zip(values).collect()
}

/// Draws the recorded readings, the filter's fit, and the law with its band.
pub fn reading(recording: &PlottedRecording) -> Result<Figure, ReportError> {
    let fitted: Vec<f64> = recording.filtered.iter().map(|row| recording.law.fitted(row)).collect();
    let (centre, sd) = match &recording.driven {
        Some(driven) => (driven.as_slice(), recording.law.model_error()),
        None => (fitted.as_slice(), recording.law.reading_noise()),
    };
    let bounds = || centre.iter().flat_map(|value| [value - 2.0 * sd, value + 2.0 * sd]);
    let recorded = recording.reading.iter().copied();
    let y =
        Axis::around(recording.reading_label(), recorded.clone(), fitted.iter().copied().chain(bounds()), HIGH_TICKS);
    let mut chart = Chart::new(WIDE, time_axis(recording), y);
    mark_test(&mut chart, recording);
    let band = recording.time_s.iter().zip(centre).map(|(time, value)| (*time, value - 2.0 * sd, value + 2.0 * sd));
    let note = if recording.driven.is_some() {
        chart.band(Ink::LAW_BAND, "law ± 2 sd of the model error that the filter allows for", band);
        chart.curve(Ink::LAW, "law, driven by the reference", against_time(recording, centre.iter().copied()));
        "The filter's fit is its own estimate put back through the law, baseline included; where its strain is \
         corrected the fit need not meet the readings. The dashed line is the law alone, driven by the \
         reference from rest: where readings leave its band, the law is wrong and not the filter."
    } else {
        chart.band(Ink::FILTER_BAND, "fit ± 2 sd of a reading's noise", band);
        "The filter's fit is its own estimate put back through the law, baseline included; where its strain is \
         corrected the fit need not meet the readings."
    };
    chart.curve(Ink::FILTER_BELOW, "filter's fit", against_time(recording, fitted.iter().copied()));
    chart.line(Ink::RECORDED, "recorded", against_time(recording, recorded));
    Figure::new(chart, "Readings and fit", note, false)
}

/// Draws the reference, the filter with its band, and the smoother.
pub fn strain(recording: &PlottedRecording) -> Result<Figure, ReportError> {
    let mut chart = strain_chart(recording, 0..recording.time_s.len(), WIDE);
    mark_test(&mut chart, recording);
    draw_strain(&mut chart, recording, 0..recording.time_s.len());
    let note = if recording.truth.is_some() {
        "The filter knows the readings up to each moment, the smoother all of them. The reference should lie in the band \
         95 % of the time; the band ends at the limits of the output."
    } else {
        "The filter knows the readings up to each moment, the smoother all of them. The band ends at the limits of the \
         output."
    };
    Figure::new(chart, &format!("{} against time", recording.quantity_name()), note, false)
}

/// Creates an empty plot for the strain of some rows, on the scale of all rows.
pub fn strain_chart(recording: &PlottedRecording, rows: Range<usize>, size_px: (f64, f64)) -> Chart {
    let mean = |row: &Estimate| recording.shown(row.strain);
    let (filtered, smoothed) = (recording.filtered.iter(), recording.smoothed.iter());
    let truth = recording.truth.unwrap_or(&[]).iter().map(|x| recording.shown(*x));
    let core = truth.chain(filtered.clone().map(mean)).chain(smoothed.map(mean));
    let rest = filtered.flat_map(|row| <[f64; 2]>::from(recording.interval(row))).map(|x| recording.shown(x));
    let ticks = if size_px.1 < WIDE.1 { HIGH_TICKS - 2 } else { HIGH_TICKS };
    let y = Axis::around(recording.quantity_label(), core, rest, ticks);
    let times = recording.time_s.get(rows).unwrap_or(&[]);
    let (first, last) = extent(times.iter().copied()).unwrap_or((0.0, 1.0));
    Chart::new(size_px, Axis::linear("Time, s", first, last, WIDE_TICKS), y)
}

/// Draws the strain of some rows.
pub fn draw_strain(chart: &mut Chart, recording: &PlottedRecording, rows: Range<usize>) {
    let (skipped, count) = (rows.start, rows.len());
    let times = || recording.time_s.iter().copied().skip(skipped).take(count);
    let filtered = || recording.filtered.iter().skip(skipped).take(count);
    let smoothed = recording.smoothed.iter().skip(skipped).take(count);
    let mean = |row: &Estimate| recording.shown(row.strain);
    let band = times().zip(filtered()).map(|(time, row)| {
        let (lower, upper) = recording.interval(row);
        (time, recording.shown(lower), recording.shown(upper))
    });
    chart.band(Ink::FILTER_BAND, "filter, 95 % interval", band);
    if recording.truth.is_some() {
        let fixed = recording.reading.iter().skip(skipped).map(|reading| recording.static_strain(*reading));
        chart.line(Ink::STATIC_STRAIN, "static cubic", times().zip(fixed.map(|x| recording.shown(x))));
    }
    let truth = recording.truth.unwrap_or(&[]).iter().skip(skipped);
    chart.line(Ink::TRUTH, "reference", times().zip(truth.map(|x| recording.shown(*x))));
    chart.line(Ink::FILTER, "filter", times().zip(filtered().map(mean)));
    chart.line(Ink::SMOOTHER, "smoother", times().zip(smoothed.map(mean)));
}
