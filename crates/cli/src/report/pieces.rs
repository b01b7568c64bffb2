//! A long recording piece by piece, so that every movement can be seen.

use super::ReportError;
use super::chart::WIDE;
use super::figures::{Figure, draw_strain, strain_chart};
use super::recording::Recording;
use ohmstrain::number::significant;

/// Movements that one plot shows well, and most plots.
const MOVEMENTS: usize = 14;
const MOST_PIECES: usize = 12;
/// Height of a piece, px.
const HEIGHT_PX: f64 = 220.0;

/// The strain in pieces of equal numbers of rows; none if one plot shows all movements.
pub fn strain(recording: &Recording) -> Result<Vec<Figure>, ReportError> {
    let movements = recording.motions.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let pieces = movements.div_ceil(MOVEMENTS).min(MOST_PIECES);
    if pieces < 2 {
        return Ok(vec![]);
    }
    let rows = recording.time_s.len();
    let piece = |i: usize| {
        let own = i * rows / pieces..(i + 1) * rows / pieces;
        let at = |row: usize| recording.time_s.get(row).copied().unwrap_or(f64::NAN);
        let title = format!("{} to {} s", significant(at(own.start), 4), significant(at(own.end.saturating_sub(1)), 4));
        let mut chart = strain_chart(recording, own.clone(), (WIDE.0, HEIGHT_PX));
        draw_strain(&mut chart, recording, own);
        Figure::new(chart, &title, "", false)
    };
    (0..pieces).map(piece).collect()
}
