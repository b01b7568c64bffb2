//! Plots of readings against strain.

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, HIGH, WIDE};
use super::figures::{Figure, HIGH_TICKS};
use super::ink::Ink;
use super::motion::movements;
use super::recording::PlottedRecording;
use super::thin::Point;
use ohmstrain::Quantity;
use ohmstrain::number::{plain, significant};

/// Largest number of arrows on a plot.
const MOST_ARROWS: usize = 24;

/// Draws readings against strain in the course of time, with the gauge curve.
pub fn hysteresis(recording: &PlottedRecording) -> Result<Figure, ReportError> {
    let strain = recording.known_strain();
    let shown = |x: f64| recording.shown(x);
    let x = Axis::holding(&recording.known_strain_label(), strain.iter().map(|x| shown(*x)), HIGH_TICKS + 2);
    let curve = recording.gauge_curve(extent(strain.iter().copied()));
    let settled = curve.iter().map(|(_, change)| recording.rest_reading * (1.0 + change));
    let recorded = recording.reading.iter().copied();
    let y = Axis::around(recording.reading_label(), recorded.clone(), settled.clone(), HIGH_TICKS + 1);
    let mut chart = Chart::new(HIGH, x, y);
    let (first_s, last_s) = extent(recording.time_s.iter().copied()).unwrap_or((0.0, 1.0));
    let parts = Ink::TIMES.len();
    let edge = |i: usize| first_s + (last_s - first_s) * i as f64 / parts as f64;
    let name = |i: usize| format!("{} to {} s", significant(edge(i), 3), significant(edge(i + 1), 3));
    let names: Vec<String> = (0..parts).map(name).collect();
    let inks: Vec<(Ink, &str)> = Ink::TIMES.into_iter().zip(names.iter().map(String::as_str)).collect();
    let place = |time_s: f64| {
        let share = (time_s - first_s) / (last_s - first_s).max(f64::MIN_POSITIVE);
        ((share * parts as f64) as usize).min(parts - 1)
    };
    let points = strain.iter().zip(recorded).zip(recording.time_s);
    chart.loops(&inks, points.map(|((strain, reading), time_s)| (shown(*strain), reading, place(*time_s))));
    chart.arrows(Ink::ARROWS, "", arrows(recording));
    chart.curve(Ink::CURVE, "gauge curve: fully relaxed", curve.iter().map(|(x, _)| shown(*x)).zip(settled));
    let fixed = recording.static_curve();
    chart.curve(Ink::STATIC, "static calibration: cubic", fixed.into_iter().map(|(x, y)| (shown(x), y)));
    if let Some(border) = recording.law.static_border() {
        chart.vertical(Ink::BOUND, "peak of the gauge curve", shown(border));
    }
    let note = "Colours are the course of time, arrows the direction of movement. A static calibration is one line through \
                this figure; how far the loop departs from it sideways is its error.";
    Figure::new(chart, "Hysteresis loop", note, false)
}

/// Returns a step in the middle of each movement, or of some of them if there are many.
fn arrows(recording: &PlottedRecording) -> Vec<(Point, Point)> {
    let (movements, strain) = (movements(&recording.motions), recording.known_strain());
    // An odd stride, so that both directions are included.
    let every = movements.len().div_ceil(MOST_ARROWS) | 1;
    let step = |(first, last): (usize, usize)| {
        let at = |row: usize| Some((recording.shown(*strain.get(row)?), *recording.reading.get(row)?));
        // Over a tenth of the movement, so that noise does not reverse the arrow.
        let (middle, reach) = (first.midpoint(last), ((last - first) / 10).max(1));
        let (from, to) = (at(middle.saturating_sub(reach))?, at(middle)?);
        [from.0, from.1, to.0, to.1].iter().all(|x| x.is_finite()).then_some((from, to))
    };
    movements.into_iter().step_by(every).filter_map(step).collect()
}

/// Draws the gauge curve over the fitted range, with the recording's settled readings, and its slopes.
pub fn gauge(recording: &PlottedRecording) -> Result<Figure, ReportError> {
    let range = recording.params.law.range;
    let curve = recording.gauge_curve(Some((range.lower, range.upper)));
    let settled = settled_readings(recording);
    let x = Axis::holding(recording.quantity_label(), curve.iter().map(|(x, _)| recording.shown(*x)), HIGH_TICKS);
    let heights = settled.iter().map(|(_, g)| *g);
    let y = Axis::around("g, relative change of R", curve.iter().map(|(_, g)| *g), heights, HIGH_TICKS);
    let mut chart = Chart::new(WIDE, x, y);
    let error = recording.law.model_error() / recording.rest_reading.abs();
    let band = curve.iter().map(|(x, g)| (recording.shown(*x), g - 2.0 * error, g + 2.0 * error));
    chart.band(Ink::LAW_BAND, "± 2 sd of the model error", band);
    let points = settled.into_iter().map(|(x, g)| (recording.shown(x), g));
    chart.dots(Ink::DOTS, "readings less what the law says movement and relaxation add", points);
    chart.curve(Ink::CURVE, "gauge curve", curve.iter().map(|(x, g)| (recording.shown(*x), *g)));
    let border = recording.law.static_border();
    let beyond = match border {
        Some(border) => {
            chart.vertical(Ink::BOUND, "peak of the gauge curve", recording.shown(border));
            format!("Beyond {} one relaxed reading belongs to two values.", recording.with_unit(border))
        }
        None => "It has no peak in its range: every relaxed reading belongs to one value only.".into(),
    };
    let (low, high) = (recording.law.gauge(range.lower), recording.law.gauge(range.upper));
    let factor = match recording.params.quantity {
        Quantity::Strain => "Gauge factor dg/dε",
        Quantity::AngleDeg => "Slope dg/dθ, per degree",
    };
    let note = format!(
        "{factor}, fully relaxed: {} at {}, {} at {}, {} on average. {beyond}",
        significant(recording.law.gauge_slope(range.lower), 3),
        recording.with_unit(range.lower),
        significant(recording.law.gauge_slope(range.upper), 3),
        recording.with_unit(range.upper),
        plain_slope((high - low) / range.span()),
    );
    Figure::new(chart, "Gauge curve", &note, false)
}

fn plain_slope(slope: f64) -> String {
    if slope.is_finite() { significant(slope, 3) } else { plain(slope) }
}

/// Returns strain and relative change of every reading, minus the law's contributions of movement and relaxation, with the law
/// driven by the reference; empty without a reference.
fn settled_readings(recording: &PlottedRecording) -> Vec<(f64, f64)> {
    let Some(driven) = &recording.driven else { return vec![] };
    let rows = recording.known_strain().iter().zip(recording.reading).zip(driven);
    let of_row = |((strain, reading), law): ((&f64, &f64), &f64)| {
        (*strain, (reading - law) / recording.rest_reading + recording.law.gauge(*strain))
    };
    rows.map(of_row).filter(|(x, g)| x.is_finite() && g.is_finite()).collect()
}
