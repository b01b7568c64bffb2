//! Doubts about the motion of a reference: it is constant while the readings move, it has the opposite sign, or its clock
//! counts milliseconds.

use ohmstrain_sensor::Quantity;

use crate::calibration_doubt::CalibrationDoubt;
use crate::recording::Recording;
use crate::unit_doubt::quantile;

/// Duration, s, and number of rows from which a constant reference may be frozen.
const FROZEN_S: f64 = 5.0;
const FROZEN_ROWS: usize = 40;
/// Share of a constant part that is skipped at its beginning; after that, readings of a body at rest relax in one direction.
const BEGINS: f64 = 0.2;
/// Share of their range by which readings move both up and down, in the rest of a constant part, only if the body moves.
const SWING: f64 = 0.3;
/// Number of rows that are replaced by their median, so that a spike is not a swing.
const GROUP: usize = 5;
/// Share of the negative range that the positive range stays below if the sign is wrong.
const BEYOND_ZERO: f64 = 0.1;
/// Least magnitude of the correlation of readings that follow a reference.
const FOLLOWS: f64 = 0.5;
/// Limits for a clock in milliseconds: whole numbers, a step of at least this many seconds, longer strokes than this, s, and at
/// least this many of them. Nobody moves a sensor to and fro for hours, with a row every five seconds.
const LEAST_STEP_S: f64 = 5.0;
const LONGEST_STROKE_S: f64 = 600.0;
const FEWEST_STROKES: f64 = 3.0;

/// Returns doubts about the motion in the recordings of one calibration, before rows are left out.
///
/// ```
/// use ohmstrain::{CalibrationDoubt, Recording, motion_doubts};
///
/// let time_s: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
/// let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * t.cos()).collect();
/// let ohm: Vec<f64> = strain.iter().map(|e| 1600.0 * (1.0 + 1.9 * e)).collect();
/// let turned: Vec<f64> = strain.iter().map(|e| -e).collect();
/// assert!(motion_doubts(&[Recording::new(&time_s, &ohm, &strain)?]).is_empty());
/// let [doubt] = motion_doubts(&[Recording::new(&time_s, &ohm, &turned)?])[..] else { panic!() };
/// assert!(matches!(doubt, CalibrationDoubt::Turned { recording: 0, .. }));
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[must_use]
pub fn motion_doubts(recordings: &[Recording]) -> Vec<CalibrationDoubt> {
    let moves: Vec<Moves> = recordings.iter().map(Moves::new).collect();
    let single = moves.iter().enumerate().flat_map(|(recording, moves)| {
        [moves.frozen(recording), moves.turned(recording), moves.milliseconds(recording)]
    });
    single.flatten().chain(turned_apart(&moves)).collect()
}

/// Rows of a recording whose reading and reference are known.
struct Moves {
    /// Time, s, reading and reference.
    rows: Vec<[f64; 3]>,
    may_be_turned: bool,
    knows_clock: bool,
}

impl Moves {
    fn new(recording: &Recording) -> Self {
        let samples = &recording.samples;
        let all = samples.time_s().iter().zip(samples.reading()).zip(samples.strain());
        let known = all.map(|((time_s, reading), strain)| [*time_s, *reading, *strain]);
        Self {
            rows: known.filter(|row| row.iter().all(|value| value.is_finite())).collect(),
            may_be_turned: recording.quantity == Quantity::Strain && !recording.knows_strain_unit,
            knows_clock: recording.knows_clock,
        }
    }

    fn quantile(&self, column: usize, share: f64) -> f64 {
        quantile(self.rows.iter().map(|row| row[column]), share).unwrap_or(f64::NAN)
    }

    fn frozen(&self, recording: usize) -> Option<CalibrationDoubt> {
        let range = self.quantile(1, 0.95) - self.quantile(1, 0.05);
        let still = self.rows.chunk_by(|a, b| a[2] == b[2]);
        let is_frozen = |part: &&[[f64; 3]]| {
            let lasts_s = part[part.len() - 1][0] - part[0][0];
            part.len() >= FROZEN_ROWS && lasts_s >= FROZEN_S && swing(part) > SWING * range
        };
        let part = still.filter(is_frozen).max_by(|a, b| a.len().cmp(&b.len()))?;
        let (first, last) = (part.first()?, part.last()?);
        // If readings are unrelated to the reference elsewhere, the problem is another one.
        let elsewhere =
            self.rows.iter().filter(|row| !(first[0]..=last[0]).contains(&row[0])).copied().collect::<Vec<_>>();
        if !(correlation(&elsewhere).abs() > FOLLOWS) {
            return None;
        }
        Some(CalibrationDoubt::Frozen {
            recording,
            from_s: first[0],
            to_s: last[0],
            reference: first[2],
            swing: swing(part),
        })
    }

    fn turned(&self, recording: usize) -> Option<CalibrationDoubt> {
        let (lower, upper) = (self.quantile(2, 0.01), self.quantile(2, 0.99));
        (self.may_be_turned && lower < 0.0 && upper < -BEYOND_ZERO * lower).then_some(CalibrationDoubt::Turned {
            recording,
            lower,
            upper,
        })
    }

    fn milliseconds(&self, recording: usize) -> Option<CalibrationDoubt> {
        let pairs = || self.rows.windows(2).map(|pair| (pair[1][0] - pair[0][0], (pair[1][2] - pair[0][2]).abs()));
        let step = quantile(pairs().map(|(dt_s, _)| dt_s), 0.5)?;
        let is_whole = self.rows.iter().all(|row| row[0].fract() == 0.0);
        let range = self.quantile(2, 0.95) - self.quantile(2, 0.05);
        let strokes = pairs().map(|(_, moved)| moved).sum::<f64>() / range;
        let lasts_s = self.rows.last()?[0] - self.rows.first()?[0];
        let (stroke_s, has_strokes) = (lasts_s / strokes, strokes >= FEWEST_STROKES);
        (!self.knows_clock && is_whole && step >= LEAST_STEP_S && has_strokes && stroke_s > LONGEST_STROKE_S)
            .then_some(CalibrationDoubt::Milliseconds { recording, step, stroke_s })
    }
}

/// Returns the correlation of readings and reference; NaN if either is constant.
fn correlation(rows: &[[f64; 3]]) -> f64 {
    let mean = |column: usize| rows.iter().map(|row| row[column]).sum::<f64>() / rows.len() as f64;
    let means = [mean(1), mean(2)];
    let sum =
        |a: usize, b: usize| rows.iter().map(|row| (row[a] - means[a - 1]) * (row[b] - means[b - 1])).sum::<f64>();
    sum(1, 2) / (sum(1, 1) * sum(2, 2)).sqrt()
}

/// Returns the range of the readings' movement both up and down, without the beginning of a still part.
fn swing(part: &[[f64; 3]]) -> f64 {
    let rest = &part[(BEGINS * part.len() as f64) as usize..];
    let medians = rest.chunks_exact(GROUP).filter_map(|group| quantile(group.iter().map(|row| row[1]), 0.5));
    let (mut lowest, mut highest, mut up, mut down) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64, 0.0_f64);
    for reading in medians {
        (lowest, highest) = (lowest.min(reading), highest.max(reading));
        (up, down) = (up.max(reading - lowest), down.max(highest - reading));
    }
    up.min(down)
}

/// Finds two recordings whose readings follow the reference in opposite directions.
fn turned_apart(moves: &[Moves]) -> Option<CalibrationDoubt> {
    let place = |is: &dyn Fn(f64) -> bool| moves.iter().position(|moves| is(correlation(&moves.rows)));
    let recordings = [place(&|r| r < -FOLLOWS)?, place(&|r| r > FOLLOWS)?];
    Some(CalibrationDoubt::TurnedApart { recordings })
}
