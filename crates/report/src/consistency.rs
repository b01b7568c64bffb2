//! Plots of the normalised innovations.

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, HALF, WIDE};
use super::figures::{Figure, HALF_TICKS, HIGH_TICKS, mark_test, time_axis};
use super::ink::Ink;
use super::innovations::{BOUND, Innovations};
use super::recording::PlottedRecording;
use ohmstrain::number::plain;

/// Draws |z| against time.
pub fn size(recording: &PlottedRecording, innovations: &Innovations) -> Result<Figure, ReportError> {
    let top = 1.2 * innovations.usual_largest().max(1.25 * BOUND);
    let y = Axis::linear("|z| = √NIS", 0.0, top, HIGH_TICKS);
    let mut chart = Chart::new(WIDE, time_axis(recording), y);
    mark_test(&mut chart, recording);
    let size = innovations.size.iter().copied();
    chart.line(Ink::DOTS, "|z| of each reading", recording.time_s.iter().copied().zip(size));
    let time = |row: usize| recording.time_s.get(row).copied().unwrap_or(f64::NAN);
    let steps = innovations.moving_rms();
    let steps = steps.iter().flat_map(|(first, last, rms)| [(time(*first), *rms), (time(*last), *rms)]);
    chart.line(Ink::SMOOTHER, "RMS over a sixtieth of the recording, should be 1", steps);
    chart.horizontal(Ink::BOUND, "95 % point, 1.96", BOUND);
    let beyond = match innovations.size.iter().filter(|z| **z > top).count() {
        0 => String::new(),
        1 => format!(" One value is larger than {} and drawn at the edge.", plain(top)),
        more => format!(" {more} values are larger than {} and drawn at the edge.", plain(top)),
    };
    let note = format!("Innovations over their predicted standard deviation; their signs are not known here.{beyond}");
    Figure::new(chart, "Normalised innovations", &note, false)
}

/// Draws the histogram of |z| with its expected density.
pub fn histogram(innovations: &Innovations) -> Result<Figure, ReportError> {
    let bins = innovations.histogram();
    let end = Innovations::histogram_end();
    let heights = bins.iter().map(|bin| bin.2).chain([0.0, Innovations::expected_density(0.0)]);
    let (_, top) = extent(heights).unwrap_or((0.0, 1.0));
    let x = Axis::linear("|z|, the last bin holds all beyond", 0.0, end, HALF_TICKS);
    let mut chart = Chart::new(HALF, x, Axis::linear("Density", 0.0, 1.05 * top, HIGH_TICKS));
    chart.bars(Ink::BARS, "recording", bins);
    let grid = (0..=100).map(|i| 0.01 * f64::from(i) * end);
    chart.line(Ink::TRUTH, "root of χ²(1)", grid.map(|z| (z, Innovations::expected_density(z))));
    let note = "Narrower than the curve: the filter's variances are too large. Wider: they are too small.";
    Figure::new(chart, "Distribution of |z|", note, true)
}

/// Draws the autocorrelation of |z|.
pub fn autocorrelation(innovations: &Innovations) -> Result<Figure, ReportError> {
    let values = innovations.autocorrelation();
    let bound = innovations.autocorrelation_bound();
    let heights = values.iter().map(|(_, value)| *value).chain([0.0, 2.0 * bound, -2.0 * bound]);
    let last = values.last().map_or(1, |(lag, _)| *lag);
    let x = Axis::linear("Lag, rows", 0.0, last as f64 + 1.0, HALF_TICKS);
    let mut chart = Chart::new(HALF, x, Axis::holding("Autocorrelation of |z|", heights, HIGH_TICKS));
    let bar = |(lag, value): (usize, f64)| (lag as f64 - 0.35, lag as f64 + 0.35, value);
    chart.bars(Ink::BARS, "recording", values.into_iter().map(bar));
    chart.horizontal(Ink::BOUND, "95 % of independent ones", bound);
    chart.horizontal(Ink::BOUND, "", -bound);
    let note = "What reaches beyond the lines is structure that the model does not know.";
    Figure::new(chart, "Autocorrelation of |z|", note, true)
}
