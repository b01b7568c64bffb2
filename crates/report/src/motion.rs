//! Parts of a recording in which the strain rises, falls or is constant.

use std::collections::VecDeque;

use super::axis::extent;

/// Motion of the strain at a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionKind {
    /// Rising strain.
    Extend,
    /// Falling strain.
    Retract,
    /// Constant strain.
    Hold,
}

/// A period of constant strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// First row.
    pub first: usize,
    /// Last row.
    pub last: usize,
    /// Strain of the hold.
    pub strain: f64,
    /// Its duration, s.
    pub duration_s: f64,
}

/// Smallest distance of two levels, as a share of the range of all holds.
const LEVELS_APART: f64 = 0.1;
/// Tolerance of a hold's strain, as a share of the recording's range.
const TOLERANCE: f64 = 0.005;
/// Factor on the tolerance for the check of a hold, which then grows at its edges only, by at most `MOST_GROWTH`; the turning
/// point of a sine grows by 1.7, the tip of a triangle threefold.
const WIDER: f64 = 3.0;
const MOST_GROWTH: f64 = 1.35;
/// Largest number of holds that are searched for.
const MOST_HOLDS: usize = 200;
/// Share of its range by which the strain must go back for a turning point.
const TURN: f64 = 0.02;

/// A row with known time and strain.
#[derive(Clone, Copy)]
struct Sample {
    row: usize,
    time_s: f64,
    strain: f64,
}

fn known(time_s: &[f64], strain: &[f64]) -> (Vec<Sample>, f64) {
    let samples: Vec<Sample> = time_s
        .iter()
        .zip(strain)
        .enumerate()
        .map(|(row, (time_s, strain))| Sample { row, time_s: *time_s, strain: *strain })
        .filter(|sample| sample.time_s.is_finite() && sample.strain.is_finite())
        .collect();
    let range = super::axis::extent(samples.iter().map(|sample| sample.strain));
    (samples, range.map_or(0.0, |(low, high)| high - low))
}

/// Returns the holds of at least `shortest_s` seconds, longest first, without overlap.
///
/// A hold at the start of the recording is left out, since its beginning is unknown.
pub fn holds(time_s: &[f64], strain: &[f64], shortest_s: f64) -> Vec<Hold> {
    let (samples, range) = known(time_s, strain);
    if !(range > 0.0) {
        return vec![];
    }
    let mut windows = still_windows(&samples, TOLERANCE * range);
    windows.retain(|window| window.0 > 0 && length(&samples, *window) >= shortest_s);
    windows.sort_by(|a, b| length(&samples, *b).total_cmp(&length(&samples, *a)));
    let mut chosen: Vec<(usize, usize)> = vec![];
    for window in windows {
        if chosen.len() < MOST_HOLDS && chosen.iter().all(|other| window.1 < other.0 || other.1 < window.0) {
            chosen.push(window);
        }
    }
    let wider = still_windows(&samples, WIDER * TOLERANCE * range);
    chosen.retain(|window| length(&samples, *window) * MOST_GROWTH >= longest_around(&samples, &wider, *window));
    chosen
        .into_iter()
        .filter_map(|window| hold(&samples, window))
        .filter(|hold| hold.duration_s >= shortest_s)
        .collect()
}

/// Sorts holds so that the first of each level precedes all others; levels differ by a tenth of the range of all holds.
pub fn levels_first(held: Vec<Hold>) -> Vec<Hold> {
    let Some((low, high)) = extent(held.iter().map(|hold| hold.strain)) else { return held };
    let mut levels: Vec<f64> = vec![];
    let (mut first, others): (Vec<Hold>, Vec<Hold>) = held.into_iter().partition(|hold| {
        let is_new = levels.iter().all(|level| (level - hold.strain).abs() > LEVELS_APART * (high - low));
        levels.extend(is_new.then_some(hold.strain));
        is_new
    });
    first.extend(others);
    first
}

/// Returns the longest windows of samples, both ends included, in which the strain stays within `tolerance`, with starts and
/// ends ascending.
fn still_windows(samples: &[Sample], tolerance: f64) -> Vec<(usize, usize)> {
    let mut windows = vec![];
    let (mut lows, mut highs) = (VecDeque::new(), VecDeque::new());
    let mut first = 0;
    for (place, sample) in samples.iter().enumerate() {
        push_monotone(&mut lows, place, sample.strain, |kept, new| kept >= new);
        push_monotone(&mut highs, place, sample.strain, |kept, new| kept <= new);
        let mut moved = false;
        while let (Some(low), Some(high)) = (lows.front(), highs.front()) {
            if high.1 - low.1 <= tolerance {
                break;
            }
            if !moved {
                windows.push((first, place.saturating_sub(1)));
                moved = true;
            }
            first += 1;
            drop_before(&mut lows, first);
            drop_before(&mut highs, first);
        }
    }
    if let Some(last) = samples.len().checked_sub(1) {
        windows.push((first, last));
    }
    windows
}

fn push_monotone(queue: &mut VecDeque<(usize, f64)>, place: usize, value: f64, beaten: impl Fn(f64, f64) -> bool) {
    while queue.back().is_some_and(|kept| beaten(kept.1, value)) {
        queue.pop_back();
    }
    queue.push_back((place, value));
}

fn drop_before(queue: &mut VecDeque<(usize, f64)>, first: usize) {
    while queue.front().is_some_and(|kept| kept.0 < first) {
        queue.pop_front();
    }
}

fn length(samples: &[Sample], window: (usize, usize)) -> f64 {
    match (samples.get(window.0), samples.get(window.1)) {
        (Some(first), Some(last)) => last.time_s - first.time_s,
        _ => 0.0,
    }
}

/// Returns the duration of the longest of the `wider` windows that contain a window.
fn longest_around(samples: &[Sample], wider: &[(usize, usize)], window: (usize, usize)) -> f64 {
    // Starts and ends both ascend, so that the windows that contain this one are neighbours.
    let until = wider.partition_point(|other| other.0 <= window.0);
    let around = wider.iter().take(until).rev().take_while(|other| other.1 >= window.1);
    around.map(|other| length(samples, *other)).fold(0.0, f64::max)
}

/// Returns the hold in a window: from the first to the last row whose strain matches that of the window's middle half. Because
/// of the tolerance, the window may extend into the movements before and after.
fn hold(samples: &[Sample], window: (usize, usize)) -> Option<Hold> {
    let samples = samples.get(window.0..=window.1)?;
    let quarter = samples.len() / 4;
    let middle = samples.get(quarter..samples.len() - quarter)?;
    let strain = middle.iter().map(|sample| sample.strain).sum::<f64>() / middle.len() as f64;
    let spread = middle.iter().map(|sample| (sample.strain - strain).abs()).fold(0.0, f64::max);
    let close = |sample: &&Sample| (sample.strain - strain).abs() <= spread;
    let (first, last) = (samples.iter().find(close)?, samples.iter().rev().find(close)?);
    Some(Hold { first: first.row, last: last.row, strain, duration_s: last.time_s - first.time_s })
}

/// Returns the motion of the strain at each row: turning points by the distance that the strain goes back, overlaid by `holds`.
pub fn motions(time_s: &[f64], strain: &[f64], holds: &[Hold]) -> Vec<MotionKind> {
    let (samples, range) = known(time_s, strain);
    let mut motions = vec![MotionKind::Extend; time_s.len()];
    let mut begin = 0;
    let (mut motion, mut turn) = (None, samples.first().map_or((0, 0.0), |sample| (sample.row, sample.strain)));
    let (mut low, mut high) = (turn, turn);
    for sample in &samples {
        let here = (sample.row, sample.strain);
        (low, high) = (if here.1 < low.1 { here } else { low }, if here.1 > high.1 { here } else { high });
        let now = match motion {
            None if here.1 - low.1 > TURN * range => Some(MotionKind::Extend),
            None if high.1 - here.1 > TURN * range => Some(MotionKind::Retract),
            Some(MotionKind::Extend) if high.1 - here.1 > TURN * range => Some(MotionKind::Retract),
            Some(MotionKind::Retract) if here.1 - low.1 > TURN * range => Some(MotionKind::Extend),
            _ => continue,
        };
        turn = if now == Some(MotionKind::Extend) { low } else { high };
        fill(&mut motions, begin, turn.0, motion.or(now));
        (motion, begin, low, high) = (now, turn.0, here, here);
    }
    fill(&mut motions, begin, time_s.len(), motion);
    for hold in holds {
        fill(&mut motions, hold.first, hold.last + 1, Some(MotionKind::Hold));
    }
    motions
}

/// Returns the first and the last row of each movement.
pub fn movements(motions: &[MotionKind]) -> Vec<(usize, usize)> {
    let mut next = 0;
    let rows = |motions: &[MotionKind]| {
        let first = next;
        next += motions.len();
        (motions[0] != MotionKind::Hold).then_some((first, next - 1))
    };
    motions.chunk_by(|a, b| a == b).filter_map(rows).collect()
}

fn fill(motions: &mut [MotionKind], from: usize, until: usize, motion: Option<MotionKind>) {
    let until = until.min(motions.len());
    if let (Some(rows), Some(motion)) = (motions.get_mut(from..until), motion) {
        rows.fill(motion);
    }
}

#[cfg(test)]
mod tests {
    use super::{Hold, MotionKind, holds, levels_first, motions};

    fn clock(rows: usize) -> Vec<f64> {
        (0..rows).map(|k| 0.1 * k as f64).collect()
    }

    /// Returns rest, ramp up, hold, ramp down, hold; with a little noise and a missing value.
    fn protocol() -> (Vec<f64>, Vec<f64>) {
        let time = clock(1500);
        let mut strain: Vec<f64> = time
            .iter()
            .map(|t| {
                let ramps = (t - 10.0).clamp(0.0, 10.0) - (t - 70.0).clamp(0.0, 5.0);
                0.03 * ramps + 1e-4 * (37.0 * t).sin()
            })
            .collect();
        strain[400] = f64::NAN;
        (time, strain)
    }

    #[test]
    fn finds_holds_and_when_they_began() {
        let (time, strain) = protocol();
        let found = holds(&time, &strain, 5.0);
        assert_eq!(found.len(), 2, "{found:?}");
        let (last, first) = (&found[0], &found[1]);
        assert!((time[last.first] - 75.0).abs() < 0.3 && time[last.last] > 149.0);
        assert!((time[first.first] - 20.0).abs() < 0.3 && (time[first.last] - 70.0).abs() < 0.3);
        assert!((first.strain - 0.3).abs() < 1e-3);
    }

    #[test]
    fn turning_points_are_no_holds() {
        let time = clock(20_000);
        let sine: Vec<f64> = time.iter().map(|t| (t / 200.0).sin()).collect();
        assert_eq!(holds(&time, &sine, 3.0), []);
        let triangle: Vec<f64> = time.iter().map(|t| ((t / 1000.0).fract() - 0.5).abs()).collect();
        assert_eq!(holds(&time, &triangle, 3.0), []);
        assert_eq!(holds(&time, &vec![0.2; time.len()], 3.0), []);
        assert_eq!(holds(&[], &[], 3.0), []);
    }

    #[test]
    fn tells_stretching_from_releasing() {
        let (time, strain) = protocol();
        let found = motions(&time, &strain, &holds(&time, &strain, 5.0));
        let at = |t: f64| found[(10.0 * t) as usize];
        assert_eq!(at(15.0), MotionKind::Extend);
        assert_eq!(at(50.0), MotionKind::Hold);
        assert_eq!(at(72.0), MotionKind::Retract);
        assert_eq!(at(100.0), MotionKind::Hold);
        assert_eq!(motions(&[], &[], &[]), []);
        assert_eq!(motions(&[0.0], &[f64::NAN], &[]).len(), 1);
    }

    /// Tests holds that return to zero after every level, and stay there longest.
    #[test]
    fn a_hold_of_each_level_comes_first() {
        let hold = |strain: f64, duration_s: f64| Hold { first: 0, last: 1, strain, duration_s };
        let held = [(0.0, 90.0), (0.001, 80.0), (0.0, 70.0), (0.1, 60.0), (0.2, 50.0), (0.1, 40.0)];
        let order: Vec<f64> =
            levels_first(held.map(|(x, s)| hold(x, s)).to_vec()).into_iter().map(|hold| hold.duration_s).collect();
        assert_eq!(order, [90.0, 60.0, 50.0, 80.0, 70.0, 40.0]);
        assert!(levels_first(vec![]).is_empty());
    }
}
