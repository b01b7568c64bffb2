//! The plot of the longest holds.

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, WIDE};
use super::figures::{Figure, HIGH_TICKS};
use super::ink::Ink;
use super::motion::Hold;
use super::recording::Recording;
use ohmstrain::number::plain;

/// Share of a hold that is plotted.
const LAST: f64 = 0.99;

/// The longest holds on a logarithmic time axis, or nothing if there is none.
pub fn relaxation(recording: &Recording) -> Result<Option<Figure>, ReportError> {
    let held: Vec<(Curve, &Hold)> =
        recording.longest_holds().iter().filter_map(|hold| Some((Curve::new(recording, hold)?, hold))).collect();
    let points = || held.iter().flat_map(|(curve, _)| &curve.recorded);
    let Some((first, last)) = extent(points().map(|(time, _)| *time)) else { return Ok(None) };
    let predicted = held.iter().flat_map(|(curve, _)| curve.predicted.iter().map(|(_, ratio)| *ratio));
    let y = Axis::around("R / R at the hold's start", points().map(|(_, ratio)| *ratio), predicted, HIGH_TICKS);
    let mut chart =
        Chart::new((WIDE.0 * 0.8, 340.0), Axis::logarithmic("Time since the hold began, s", first, last), y);
    let inks = Ink::HOLDS.into_iter().zip(Ink::HELD_LAWS);
    for (place, ((curve, hold), (ink, law))) in held.iter().zip(inks).enumerate() {
        let name = format!("{} held from {} s", recording.with_unit(hold.strain), plain(curve.start_s));
        chart.line(ink, &name, curve.recorded.iter().copied());
        chart.curve(law, if place == 0 { "law, in the same colours" } else { "" }, curve.predicted.iter().copied());
    }
    let note = if recording.truth.is_some() {
        "Solid: recorded. Dashed: the law, which knows the strain up to the hold and nothing of the readings in it."
    } else {
        "Solid: recorded. Dashed: the law, driven by the estimated strain up to the hold. The holds are those of the \
         estimate."
    };
    Figure::new(chart, "Relaxation while held", note, false).map(Some)
}

/// A hold's readings and the law's, relative to their first.
struct Curve {
    start_s: f64,
    recorded: Vec<(f64, f64)>,
    predicted: Vec<(f64, f64)>,
}

impl Curve {
    fn new(recording: &Recording, hold: &Hold) -> Option<Self> {
        let start_s = *recording.time_s.get(hold.first)?;
        // The next movement begins in the readings before the reference has left the hold's tolerance.
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
