//! The plots of the report, one function each.

use ohmstrain_calib::Output;
use serde::Serialize;

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, WIDE};
use super::ink::{Ink, Key};
use super::motion::{Hold, Motion};
use super::number::plain;
use super::recording::Recording;

/// A plot with what belongs to it.
#[derive(Debug, Serialize)]
pub struct Figure {
    /// Heading.
    pub title: String,
    /// The drawing; markup, not to be escaped.
    pub svg: String,
    /// What its layers are.
    pub legend: Vec<Key>,
    /// How to read it.
    pub note: String,
    /// Shares its line with the next one.
    pub half: bool,
}

impl Figure {
    /// Draws a chart.
    pub fn new(chart: &Chart, title: &str, note: &str, half: bool) -> Result<Self, ReportError> {
        let svg = chart.svg(&format!("{title}. {note}"))?;
        Ok(Self { title: title.into(), svg, legend: chart.legend(), note: note.into(), half })
    }
}

/// Ticks on an axis.
const WIDE_TICKS: usize = 10;
pub const HALF_TICKS: usize = 6;
pub const HIGH_TICKS: usize = 6;

/// A time axis over the whole recording.
pub fn time_axis(recording: &Recording) -> Axis {
    let (first, last) = extent(recording.time_s.iter().copied()).unwrap_or((0.0, 1.0));
    Axis::linear("Time, s", first, last, WIDE_TICKS)
}

/// Marks the part that is scored.
pub fn mark_test(chart: &mut Chart, recording: &Recording) {
    if let Some(from) = recording.scored_from_s {
        let (_, last) = extent(recording.time_s.iter().copied()).unwrap_or((from, from));
        chart.shade(Ink::TEST, "test part", from, last);
    }
}

fn against_time<'a>(recording: &Recording<'a>, values: impl Iterator<Item = f64> + 'a) -> Vec<(f64, f64)> {
    recording.time_s.iter().copied().zip(values).collect()
}

/// Recorded readings, the filter's fit, and the law with its band.
pub fn reading(recording: &Recording) -> Result<Figure, ReportError> {
    let fitted: Vec<f64> = recording.filtered.iter().map(|output| recording.law.fitted(output)).collect();
    let (centre, sd) = match &recording.driven {
        Some(driven) => (driven.reading.as_slice(), recording.law.model_error()),
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
    Figure::new(&chart, "Readings and fit", note, false)
}

/// Reference, filter with band, smoother.
pub fn strain(recording: &Recording) -> Result<Figure, ReportError> {
    let bounds = |output: &Output| {
        let strain = &output.estimate.strain;
        (strain.mean - 2.0 * strain.sd(), strain.mean + 2.0 * strain.sd())
    };
    let mean = |output: &Output| output.estimate.strain.mean;
    let (filtered, smoothed) = (recording.filtered.iter(), recording.smoothed.iter());
    let truth = recording.truth.unwrap_or(&[]);
    let core = truth.iter().copied().chain(filtered.clone().map(mean)).chain(smoothed.clone().map(mean));
    let rest = filtered.clone().flat_map(|output| <[f64; 2]>::from(bounds(output)));
    let y = Axis::around(recording.quantity_label(), core, rest, HIGH_TICKS);
    let mut chart = Chart::new(WIDE, time_axis(recording), y);
    mark_test(&mut chart, recording);
    let band = recording.time_s.iter().zip(filtered.clone()).map(|(time, output)| {
        let (lower, upper) = bounds(output);
        (*time, lower, upper)
    });
    chart.band(Ink::FILTER_BAND, "filter ± 2 sd", band);
    chart.line(Ink::TRUTH, "reference", against_time(recording, truth.iter().copied()));
    chart.line(Ink::FILTER, "filter", against_time(recording, filtered.map(mean)));
    chart.line(Ink::SMOOTHER, "smoother", against_time(recording, smoothed.map(mean)));
    let note = if recording.truth.is_some() {
        "The filter knows the readings up to each moment, the smoother all of them. The reference should lie in the band \
         95 % of the time."
    } else {
        "The filter knows the readings up to each moment, the smoother all of them."
    };
    Figure::new(&chart, &format!("{} against time", recording.quantity_name()), note, false)
}

/// Readings against strain, by direction of motion, with the gauge curve.
pub fn hysteresis(recording: &Recording) -> Result<Figure, ReportError> {
    let strain = recording.known_strain();
    let x = Axis::holding(&recording.known_strain_label(), strain.iter().copied(), HIGH_TICKS + 2);
    let curve = recording.gauge_curve(extent(strain.iter().copied()));
    let settled = curve.iter().map(|(_, change)| recording.rest_reading * (1.0 + change));
    let recorded = recording.reading.iter().copied();
    let y = Axis::around(recording.reading_label(), recorded.clone(), settled.clone(), HIGH_TICKS + 1);
    let mut chart = Chart::new((WIDE.0 * 0.8, 420.0), x, y);
    let place = |motion: &Motion| match motion {
        Motion::Extend => 0,
        Motion::Retract => 1,
        Motion::Hold => 2,
    };
    let points = strain.iter().zip(recorded).zip(&recording.motions);
    chart.loops(
        &[(Ink::EXTEND, "rising"), (Ink::RETRACT, "falling"), (Ink::HOLD, "held")],
        points.map(|((strain, reading), motion)| (*strain, reading, place(motion))),
    );
    chart.curve(Ink::CURVE, "gauge curve: fully relaxed", curve.iter().map(|(x, _)| *x).zip(settled));
    chart.curve(Ink::STATIC, "static calibration: cubic", recording.static_curve());
    if let Some(border) = recording.law.static_border() {
        chart.vertical(Ink::BOUND, "static border", border);
    }
    let note = "A static calibration is one line through this figure; how far the loop departs from it sideways is its \
                error.";
    Figure::new(&chart, "Hysteresis loop", note, false)
}

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
    for ((curve, hold), (ink, law)) in held.iter().zip(Ink::HOLDS.into_iter().zip(Ink::HELD_LAWS)) {
        let name = format!("{} held from {} s", recording.with_unit(hold.strain), plain(curve.start_s));
        chart.line(ink, &name, curve.recorded.iter().copied());
        chart.curve(law, "law", curve.predicted.iter().copied());
    }
    let note = if recording.truth.is_some() {
        "Solid: recorded. Dashed: the law, which knows the strain up to the hold and nothing of the readings in it."
    } else {
        "Solid: recorded. Dashed: the law, driven by the estimated strain up to the hold. The holds are those of the \
         estimate."
    };
    Figure::new(&chart, "Relaxation while held", note, false).map(Some)
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
        let rows = || recording.time_s.iter().zip(recording.reading).take(hold.last + 1).skip(hold.first);
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

/// The gauge curve where it was fitted, with its static border.
pub fn gauge(recording: &Recording) -> Result<Figure, ReportError> {
    let range = recording.params.law.range;
    let curve = recording.gauge_curve(Some((range.lower, range.upper)));
    let x = Axis::holding(recording.quantity_label(), curve.iter().map(|(x, _)| *x), HALF_TICKS);
    let y = Axis::holding("g, relative change of R", curve.iter().map(|(_, g)| *g), HIGH_TICKS);
    let mut chart = Chart::new((WIDE.0 * 0.6, 300.0), x, y);
    chart.curve(Ink::CURVE, "gauge curve", curve);
    let border = recording.law.static_border();
    let note = match border {
        Some(border) => {
            chart.vertical(Ink::BOUND, "static border", border);
            format!("Beyond {} one relaxed reading belongs to two strains.", recording.with_unit(border))
        }
        None => "It has no peak in its range: every relaxed reading belongs to one value only.".into(),
    };
    Figure::new(&chart, "Gauge curve", &note, false)
}
