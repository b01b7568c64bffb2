//! Hysteresis loops at several speeds side by side.

use super::ReportError;
use super::axis::{Axis, extent};
use super::chart::{Chart, HIGH};
use super::figures::{Figure, HIGH_TICKS};
use super::ink::Ink;
use super::motion;
use super::recording::PlottedRecording;
use ohmstrain::number::significant;

/// Largest number of classes of speed.
const CLASSES: usize = 3;
/// Ratio of speeds from which they count as different.
const SEVERAL: f64 = 1.5;
/// Largest number of speeds that are classified; the work grows with their square.
const MOST_SPEEDS: usize = 300;
/// Share of a movement's travel at either end that does not count towards its speed.
const ENDS: f64 = 0.1;
/// Smallest travel of a movement, as a share of the strain's range; holds contain smaller ones.
const LEAST_WAY: f64 = 0.1;

/// A movement: rows, both included, and its mean speed.
struct Movement {
    first: usize,
    last: usize,
    speed: f64,
}

/// Draws readings against strain, coloured by the speed of each movement; `None` if all speeds are alike.
pub fn loops(recording: &PlottedRecording) -> Result<Option<Figure>, ReportError> {
    let movements = movements(recording);
    let mut speeds: Vec<f64> = movements.iter().map(|movement| movement.speed).collect();
    speeds.sort_by(f64::total_cmp);
    let (Some(slowest), Some(fastest)) = (speeds.first(), speeds.last()) else { return Ok(None) };
    if *fastest < SEVERAL * slowest {
        return Ok(None);
    }
    let fastest = *fastest;
    let thinned: Vec<f64> =
        speeds.iter().copied().step_by(speeds.len().div_ceil(MOST_SPEEDS)).chain([fastest]).collect();
    let classes_of_speed = natural_classes(&thinned);
    let class = |speed: f64| classes_of_speed.iter().position(|(_, fastest)| speed <= *fastest).unwrap_or(0);
    let (strain, unit) = (recording.known_strain(), recording.quantity_label().trim_start_matches(|c| c != ','));
    let shown = |x: f64| recording.shown(x);
    let x = Axis::holding(&recording.known_strain_label(), strain.iter().map(|x| shown(*x)), HIGH_TICKS + 2);
    let y = Axis::holding(recording.reading_label(), recording.reading.iter().copied(), HIGH_TICKS + 1);
    let mut chart = Chart::new(HIGH, x, y);
    let name = |(slowest, fastest): &(f64, f64)| {
        let (low, high) = (significant(shown(*slowest), 2), significant(shown(*fastest), 2));
        let speeds = if low == high { low } else { format!("{low} to {high}") };
        format!("{speeds}{}/s", unit.trim_start_matches(','))
    };
    let names: Vec<String> = classes_of_speed.iter().map(name).collect();
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
    let note = "Each movement has the colour of its mean speed; holds and small movements are left out. Loops that widen with speed show how much of \
                the reading is rate and relaxation.";
    Figure::new(chart, "Loops by speed", note, false).map(Some)
}

/// Splits sorted speeds into classes with the smallest variation of their logarithms (Fisher, *J. Am. Stat. Assoc.* 53 (1958)
/// 789). Returns the slowest and the fastest of each class.
fn natural_classes(speeds: &[f64]) -> Vec<(f64, f64)> {
    let logarithms: Vec<f64> = speeds.iter().map(|speed| speed.ln()).collect();
    let sums = |power: i32| -> Vec<f64> {
        let sum = |sum: &mut f64, x: &f64| {
            *sum += x.powi(power);
            Some(*sum)
        };
        std::iter::once(0.0).chain(logarithms.iter().scan(0.0, sum)).collect()
    };
    let (first, second) = (sums(1), sums(2));
    let within = |from: usize, to: usize| {
        let count = (to - from) as f64;
        if to > from { second[to] - second[from] - (first[to] - first[from]).powi(2) / count } else { 0.0 }
    };
    let n = speeds.len();
    let cuts = (0..=n).flat_map(|a| (a..=n).map(move |b| [0, a, b, n]));
    let cost = |cuts: &[usize; CLASSES + 1]| cuts.windows(2).map(|pair| within(pair[0], pair[1])).sum::<f64>();
    let best = cuts.min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or([0, 0, 0, n]);
    best.windows(2).filter(|pair| pair[1] > pair[0]).map(|pair| (speeds[pair[0]], speeds[pair[1] - 1])).collect()
}

fn movements(recording: &PlottedRecording) -> Vec<Movement> {
    let (strain, time_s) = (recording.known_strain(), recording.time_s);
    let Some((low, high)) = extent(strain.iter().copied()) else { return vec![] };
    let mut found = vec![];
    for (begin, last) in motion::movements(&recording.motions).into_iter().filter(|(begin, last)| begin < last) {
        let known = |row: &usize| time_s.get(*row).zip(strain.get(*row)).is_some_and(|(_, x)| x.is_finite());
        let (Some(from), Some(to)) = ((begin..=last).find(known), (begin..=last).rfind(known)) else { continue };
        let way = (strain[to] - strain[from]).abs();
        // Without the ends, at which the body may have stood still.
        let at = |share: f64| (from..=to).find(|row| (strain[*row] - strain[from]).abs() >= share * way);
        let (Some(from), Some(to)) = (at(ENDS), at(1.0 - ENDS)) else { continue };
        let speed = (strain[to] - strain[from]).abs() / (time_s[to] - time_s[from]);
        if speed.is_finite() && speed > 0.0 && way >= LEAST_WAY * (high - low) {
            found.push(Movement { first: begin, last, speed });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_that_are_alike_are_one_class() {
        let speeds = [1.65, 1.67, 1.69, 3.2, 3.21, 4.7, 4.8, 6.3, 6.4];
        assert_eq!(natural_classes(&speeds), [(1.65, 1.69), (3.2, 3.21), (4.7, 6.4)]);
        assert_eq!(natural_classes(&[1.0, 4.0]), [(1.0, 1.0), (4.0, 4.0)]);
        assert_eq!(natural_classes(&[]), []);
    }
}
