//! A long recording piece by piece, with every movement visible.

use super::ReportError;
use super::axis::extent;
use super::chart::WIDE;
use super::figures::{Figure, draw_strain, strain_chart};
use super::motion::MotionKind;
use super::recording::PlottedRecording;
use ohmstrain::number::significant;

/// Number of movements that one plot shows well, and largest number of plots: a piece takes some 30 kB.
const MOVEMENTS: usize = 14;
const MOST_PIECES: usize = 48;
/// Height of a piece, px.
const HEIGHT_PX: f64 = 220.0;
/// Smallest width of a movement of usual length, as a share of the plot's width.
const VISIBLE: f64 = 1.0 / 40.0;

/// Draws the strain in pieces of equal numbers of rows, with a sentence on them; no figure if one plot shows all movements.
pub fn strain(recording: &PlottedRecording) -> Result<(Vec<Figure>, String), ReportError> {
    let wanted = count(&recording.motions, recording.time_s);
    let pieces = wanted.min(MOST_PIECES);
    if pieces < 2 {
        return Ok((vec![], String::new()));
    }
    let note = match wanted {
        0..=MOST_PIECES => String::new(),
        _ => format!(
            "To show every movement at its size would take {wanted} pieces; there are {pieces}. Drag over one to enlarge a part of it."
        ),
    };
    let rows = recording.time_s.len();
    let piece = |i: usize| {
        let own = i * rows / pieces..(i + 1) * rows / pieces;
        let at = |row: usize| recording.time_s.get(row).copied().unwrap_or(f64::NAN);
        let (from, until) = (significant(at(own.start), 4), significant(at(own.end.saturating_sub(1)), 4));
        let title = format!("Piece {} of {pieces}: {from} to {until} s", i + 1);
        let mut chart = strain_chart(recording, own.clone(), (WIDE.0, HEIGHT_PX));
        draw_strain(&mut chart, recording, own);
        let figure = Figure::new(chart, &title, "", false)?;
        Ok(Figure { file: format!("piece-{:02}", i + 1), ..figure })
    };
    Ok(((0..pieces).map(piece).collect::<Result<_, ReportError>>()?, note))
}

/// Returns the number of pieces. It is enough for all movements, and for movements that are short compared with the recording,
/// such as ramps between long holds.
fn count(motions: &[MotionKind], time_s: &[f64]) -> usize {
    let ends: Vec<usize> = (1..motions.len()).filter(|row| motions[*row] != motions[*row - 1]).collect();
    let lasting = |pair: &[usize]| time_s.get(pair[1]).zip(time_s.get(pair[0])).map(|(end, start)| end - start);
    let moving = ends.windows(2).filter(|pair| motions[pair[0]] != MotionKind::Hold);
    let mut lengths: Vec<f64> = moving.filter_map(lasting).filter(|length| *length > 0.0).collect();
    lengths.sort_by(f64::total_cmp);
    let whole = extent(time_s.iter().copied()).map_or(0.0, |(first, last)| last - first);
    let short = lengths.get(lengths.len() / 2).map_or(0.0, |usual| VISIBLE * whole / usual);
    ends.len().div_ceil(MOVEMENTS).max(short.ceil() as usize)
}

#[cfg(test)]
mod tests {
    use super::{MotionKind, count};

    #[test]
    fn short_movements_between_long_holds_make_pieces() {
        // Eight ramps of 10 s in 2400 s are 1/240 of it each; at a fortieth of its width per ramp, a plot shows a sixth of the recording.
        let phase = |k: usize| match k % 600 {
            0..10 => MotionKind::Extend,
            300..310 => MotionKind::Retract,
            _ => MotionKind::Hold,
        };
        let time_s: Vec<f64> = (0..2400).map(|k| k as f64).collect();
        let motions: Vec<MotionKind> = (0..2400).map(phase).collect();
        assert_eq!(count(&motions, &time_s), 6);
        // Ramps without holds, ten in all, fill one plot.
        let ramps: Vec<MotionKind> =
            (0..1000).map(|k| if k / 100 % 2 == 0 { MotionKind::Extend } else { MotionKind::Retract }).collect();
        assert_eq!(count(&ramps, &time_s[..1000]), 1);
        assert_eq!(count(&[], &[]), 0);
        // The number is proportional to the length: a hundred such recordings in a row take a hundred times as many.
        let long_s: Vec<f64> = (0..240_000).map(|k| k as f64).collect();
        let long: Vec<MotionKind> = (0..240_000).map(phase).collect();
        assert_eq!(count(&long, &long_s), 600);
    }
}
