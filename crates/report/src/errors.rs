//! Plots of the errors of strain and of readings.

use ohmstrain::Estimate;

use super::ReportError;
use super::axis::Axis;
use super::chart::{Chart, WIDE};
use super::figures::{Figure, HIGH_TICKS, against_time, mark_test, time_axis};
use super::ink::Ink;
use super::recording::{PlottedRecording, Z_95};

/// Height of these plots, px.
const HEIGHT_PX: f64 = 240.0;

/// Draws the estimate minus the reference against time; `None` without a reference.
pub fn strain(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let Some(truth) = recording.truth else { return Ok(None) };
    let errors = |rows: &[Estimate]| -> Vec<f64> {
        rows.iter().zip(truth).map(|(row, truth)| recording.shown(row.strain - truth)).collect()
    };
    let (filtered, smoothed) = (errors(recording.filtered), errors(recording.smoothed));
    let half: Vec<f64> = recording.filtered.iter().map(|row| recording.shown(Z_95 * row.strain_sd)).collect();
    let core = filtered.iter().chain(&smoothed).copied().chain([0.0]);
    let y = Axis::around(
        &format!("Error, {}", unit(recording)),
        core,
        half.iter().flat_map(|half| [-half, *half]),
        HIGH_TICKS - 1,
    );
    let mut chart = Chart::new((WIDE.0, HEIGHT_PX), time_axis(recording), y);
    mark_test(&mut chart, recording);
    let band = recording.time_s.iter().zip(&half).map(|(time, half)| (*time, -half, *half));
    chart.band(Ink::FILTER_BAND, "filter, half of the 95 % interval", band);
    chart.horizontal(Ink::FRAME, "", 0.0);
    chart.line(Ink::FILTER, "filter less reference", against_time(recording, filtered.iter().copied()));
    chart.line(Ink::SMOOTHER, "smoother less reference", against_time(recording, smoothed.iter().copied()));
    let note = "Where the filter's line leaves the band, its interval has missed the reference.";
    Figure::new(chart, "Error against time", note, false).map(Some)
}

/// Draws the recorded readings minus those of the law driven by the reference; `None` without a reference.
pub fn reading(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let Some(driven) = &recording.driven else { return Ok(None) };
    let residual: Vec<f64> = recording.reading.iter().zip(driven).map(|(recorded, law)| recorded - law).collect();
    let sd = recording.law.model_error();
    let label = format!("{} less the law", recording.reading_label().replace("Resistance, Ω", "Ω: reading"));
    let y = Axis::around(&label, residual.iter().copied().chain([0.0]), [-2.0 * sd, 2.0 * sd], HIGH_TICKS - 1);
    let mut chart = Chart::new((WIDE.0, HEIGHT_PX), time_axis(recording), y);
    mark_test(&mut chart, recording);
    let band = recording.time_s.iter().map(|time| (*time, -2.0 * sd, 2.0 * sd));
    chart.band(Ink::LAW_BAND, "± 2 sd of the model error that the filter allows for", band);
    chart.horizontal(Ink::FRAME, "", 0.0);
    chart.line(Ink::RECORDED, "recorded less law", against_time(recording, residual.iter().copied()));
    let note = "What is slow is drift or a law that relaxes otherwise, what comes with every movement is the law's form, the rest \
                is noise.";
    Figure::new(chart, "Residual of the law", note, false).map(Some)
}

fn unit(recording: &PlottedRecording) -> &'static str {
    if recording.shown(1.0) > 1.0 { "% strain" } else { "°" }
}
