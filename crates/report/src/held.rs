//! Plots of the longest holds.

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, WIDE};
use super::figures::{Figure, HIGH_TICKS};
use super::ink::Ink;
use super::motion::Hold;
use super::recording::PlottedRecording;
use super::thin::Point;
use ohmstrain::number::plain;

/// Share of a hold that is plotted.
const LAST: f64 = 0.99;

/// Draws the longest holds on a logarithmic time axis; `None` without a hold.
pub fn relaxation(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let Some(chart) = longest(recording, "R / R at the hold's start", <[_]>::to_vec) else { return Ok(None) };
    let note = if recording.truth.is_some() {
        "Solid: recorded. Dashed: the law, which knows the strain up to the hold and nothing of the readings in it."
    } else {
        "Solid: recorded. Dashed: the law, driven by the estimated strain up to the hold. The holds are those of the \
         estimate."
    };
    Figure::new(chart, "Relaxation while held", note, false).map(Some)
}

/// Number of parts of a decade over each of which a rate is computed.
const PER_DECADE: f64 = 8.0;

/// Draws the rate of the readings in the longest holds; `None` if there is no hold.
pub fn rate(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let Some(chart) = longest(recording, "d(R/R at start)/dt, 1/s", slopes) else { return Ok(None) };
    let note = "Slopes of straight lines through an eighth of a decade of readings each.";
    Figure::new(chart, "Rate of relaxation", note, false).map(Some)
}

/// Draws what `of` computes from the points of the longest holds, recorded and by the law.
fn longest(recording: &PlottedRecording, label: &str, of: fn(&[Point]) -> Vec<Point>) -> Option<Chart> {
    let of_hold = |hold: &Hold| {
        let Curve { start_s, recorded, predicted } = Curve::new(recording, hold)?;
        let name = format!("{} held from {} s", recording.with_unit(hold.strain), plain(start_s));
        Some((name, of(&recorded), of(&predicted)))
    };
    let held: Vec<(String, Vec<Point>, Vec<Point>)> = recording.longest_holds().iter().filter_map(of_hold).collect();
    let recorded = || held.iter().flat_map(|(_, recorded, _)| recorded);
    let predicted = held.iter().flat_map(|(.., predicted)| predicted.iter().map(|(_, y)| *y));
    let (first, last) = extent(recorded().map(|(time, _)| *time))?;
    let y = Axis::around(label, recorded().map(|(_, y)| *y), predicted, HIGH_TICKS);
    let mut chart = Chart::new(WIDE, Axis::logarithmic("Time since the hold began, s", first, last), y);
    let inks = Ink::HOLDS.into_iter().zip(Ink::HELD_LAWS);
    for (place, ((name, recorded, predicted), (ink, law))) in held.iter().zip(inks).enumerate() {
        chart.line(ink, name, recorded.iter().copied());
        chart.curve(law, if place == 0 { "law, in the same colours" } else { "" }, predicted.iter().copied());
    }
    Some(chart)
}

/// Returns the slopes of straight lines through parts of a decade, at the middle of their times.
fn slopes(points: &[Point]) -> Vec<Point> {
    let part = |time: f64| (time.log10() * PER_DECADE).floor();
    let known: Vec<Point> = points.iter().copied().filter(|(time, y)| *time > 0.0 && y.is_finite()).collect();
    let of_part = |points: &[Point]| {
        let n = points.len() as f64;
        let (mean_t, mean_y) = points.iter().fold((0.0, 0.0), |sum, (t, y)| (sum.0 + t / n, sum.1 + y / n));
        let (sty, stt) = points
            .iter()
            .fold((0.0, 0.0), |sum, (t, y)| (sum.0 + (t - mean_t) * (y - mean_y), sum.1 + (t - mean_t) * (t - mean_t)));
        (points.len() > 2 && stt > 0.0).then_some((mean_t, sty / stt))
    };
    known.chunk_by(|a, b| part(a.0) == part(b.0)).filter_map(of_part).collect()
}

/// Draws the readings at the beginning and at the end of every hold, level by level; `None` for fewer than three levels.
pub fn levels(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let ends: Vec<(f64, f64, f64)> = recording.holds().iter().filter_map(|hold| ends_of(recording, hold)).collect();
    let mut levels: Vec<f64> = ends.iter().map(|(strain, ..)| *strain).collect();
    levels.sort_by(f64::total_cmp);
    let Some((low, high)) = extent(levels.iter().copied()) else { return Ok(None) };
    levels.dedup_by(|b, a| *b - *a < 0.05 * (high - low));
    if levels.len() < 3 {
        return Ok(None);
    }
    let curve = recording.gauge_curve(Some((low, high)));
    let settled = || curve.iter().map(|(x, g)| (recording.shown(*x), recording.rest_reading * (1.0 + g)));
    let x = Axis::holding(recording.quantity_label(), levels.iter().map(|x| recording.shown(*x)), HIGH_TICKS + 2);
    let readings = ends.iter().flat_map(|(_, begun, ended)| [*begun, *ended]);
    let y = Axis::around(recording.reading_label(), readings, settled().map(|(_, y)| y), HIGH_TICKS);
    let mut chart = Chart::new(WIDE, x, y);
    chart.curve(Ink::CURVE, "gauge curve: fully relaxed", settled());
    chart.dots(Ink::BEGUN, "hold begins", ends.iter().map(|(x, begun, _)| (recording.shown(*x), *begun)));
    chart.dots(Ink::ENDED, "hold ends", ends.iter().map(|(x, _, ended)| (recording.shown(*x), *ended)));
    let note = "What a level reads depends on how it was reached, and for how long it is held.";
    Figure::new(chart, "Held levels", note, false).map(Some)
}

/// Returns the strain of a hold, and its first and last readings.
fn ends_of(recording: &PlottedRecording, hold: &Hold) -> Option<(f64, f64, f64)> {
    let end_s = recording.time_s.get(hold.first)? + LAST * hold.duration_s;
    let rows = recording.time_s.iter().zip(recording.reading).take(hold.last + 1).skip(hold.first);
    let mut known =
        rows.filter(|(time_s, reading)| **time_s <= end_s && reading.is_finite()).map(|(_, reading)| *reading);
    let begun = known.next()?;
    Some((hold.strain, begun, known.next_back()?))
}

/// Readings of a hold and of the law, relative to the first one.
struct Curve {
    start_s: f64,
    recorded: Vec<Point>,
    predicted: Vec<Point>,
}

impl Curve {
    fn new(recording: &PlottedRecording, hold: &Hold) -> Option<Self> {
        let start_s = *recording.time_s.get(hold.first)?;
        // The next movement begins before the reference leaves the hold's tolerance.
        let end_s = start_s + LAST * hold.duration_s;
        let rows = || {
            let rows = recording.time_s.iter().zip(recording.reading).take(hold.last + 1).skip(hold.first);
            rows.take_while(move |(time_s, _)| **time_s <= end_s)
        };
        let (first_time, first_reading) = rows().find(|(_, reading)| reading.is_finite())?;
        let memory = recording.memory_at(hold.first)?;
        let law = |time_s: f64| recording.law.held(hold.strain, memory, time_s - start_s);
        let first_law = law(*first_time);
        let later = || rows().filter(|(time, _)| **time > start_s);
        Some(Self {
            start_s,
            recorded: later().map(|(time, reading)| (time - start_s, reading / first_reading)).collect(),
            predicted: later().map(|(time, _)| (time - start_s, law(*time) / first_law)).collect(),
        })
    }
}
