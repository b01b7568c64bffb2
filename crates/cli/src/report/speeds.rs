//! Loops at several speeds beside each other.

use super::ReportError;
use super::axis::Axis;
use super::chart::{Chart, WIDE};
use super::figures::{Figure, HIGH_TICKS};
use super::ink::Ink;
use super::motion::Motion;
use super::recording::Recording;
use ohmstrain::number::significant;

/// Classes of speed.
const CLASSES: usize = 3;
/// Speeds that differ by less than this factor are one.
const SEVERAL: f64 = 1.5;

/// A movement: rows, both included, and its mean speed.
struct Movement {
    first: usize,
    last: usize,
    speed: f64,
}

/// Readings against strain, coloured by the speed of each movement; nothing where all movements are alike.
pub fn loops(recording: &Recording) -> Result<Option<Figure>, ReportError> {
    let movements = movements(recording);
    let mut speeds: Vec<f64> = movements.iter().map(|movement| movement.speed).collect();
    speeds.sort_by(f64::total_cmp);
    let (Some(slowest), Some(fastest)) = (speeds.first(), speeds.last()) else { return Ok(None) };
    if fastest < &(SEVERAL * slowest) {
        return Ok(None);
    }
    let ratio = fastest / slowest;
    let edge = |class: usize| slowest * ratio.powf(class as f64 / CLASSES as f64);
    let class = |speed: f64| (((speed / slowest).ln() / ratio.ln() * CLASSES as f64) as usize).min(CLASSES - 1);
    let (strain, unit) = (recording.known_strain(), recording.quantity_label().trim_start_matches(|c| c != ','));
    let shown = |x: f64| recording.shown(x);
    let x = Axis::holding(&recording.known_strain_label(), strain.iter().map(|x| shown(*x)), HIGH_TICKS + 2);
    let y = Axis::holding(recording.reading_label(), recording.reading.iter().copied(), HIGH_TICKS + 1);
    let mut chart = Chart::new((WIDE.0 * 0.8, 440.0), x, y);
    let name = |class: usize| {
        let (low, high) = (significant(shown(edge(class)), 2), significant(shown(edge(class + 1)), 2));
        format!("{low} to {high}{}/s", unit.trim_start_matches(','))
    };
    let names: Vec<String> = (0..CLASSES).map(name).collect();
    let inks: Vec<(Ink, &str)> = Ink::SPEEDS.into_iter().zip(names.iter().map(String::as_str)).collect();
    let mut classes: Vec<Option<usize>> = vec![None; strain.len()];
    for movement in &movements {
        let rows = classes.get_mut(movement.first..=movement.last).unwrap_or_default();
        rows.fill(Some(class(movement.speed)));
    }
    let points = strain.iter().zip(recording.reading).zip(&classes).map(|((strain, reading), class)| {
        (shown(*strain), if class.is_some() { *reading } else { f64::NAN }, class.unwrap_or(0))
    });
    chart.loops(&inks, points);
    let note = "Each movement has the colour of its mean speed; holds are left out. Loops that widen with speed show how much of \
                the reading is rate and relaxation.";
    Figure::new(chart, "Loops by speed", note, false).map(Some)
}

fn movements(recording: &Recording) -> Vec<Movement> {
    let (motions, strain, time_s) = (&recording.motions, recording.known_strain(), recording.time_s);
    let mut found = vec![];
    let mut first = 0;
    for row in 1..=motions.len() {
        if motions.get(row) == motions.get(first) {
            continue;
        }
        let (begin, last) = (first, row - 1);
        first = row;
        if motions[begin] == Motion::Hold || last <= begin {
            continue;
        }
        let known = |row: &usize| time_s.get(*row).zip(strain.get(*row)).is_some_and(|(_, x)| x.is_finite());
        let (Some(from), Some(to)) = ((begin..=last).find(known), (begin..=last).rfind(known)) else { continue };
        let speed = ((strain[to] - strain[from]) / (time_s[to] - time_s[from])).abs();
        if speed.is_finite() && speed > 0.0 {
            found.push(Movement { first: begin, last, speed });
        }
    }
    found
}
