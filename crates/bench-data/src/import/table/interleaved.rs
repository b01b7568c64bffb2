//! Values of several quantities in turn, one on each line, as a board prints with a separate call for each of them.

use crate::import::bytes::{Cell, Rows};
use crate::import::words::{DecimalMark, number};

/// Largest number of quantities in turn, and least number of rows of each.
const MOST_QUANTITIES: usize = 4;
const FEWEST_ROWS: usize = 10;
/// Ratio of the differences between neighbours to those between successive values of one quantity.
const APART: f64 = 5.0;

/// Returns the rows of lines with a number each, of several quantities in turn; `None` if they are of one quantity.
pub(crate) fn rows<'a>(lines: &[(u64, &'a str)], decimal: DecimalMark) -> Option<Rows<'a>> {
    let values: Vec<f64> = lines.iter().map(|(_, line)| number(line, decimal, 0)).collect::<Option<_>>()?;
    let width = (2..=MOST_QUANTITIES).find(|width| are_in_turn(&values, *width))?;
    let cells = |row: &[(u64, &'a str)]| row.iter().map(|(_, line)| Cell::text(line)).collect();
    Some(lines.chunks_exact(width).map(|row| (row[0].0, cells(row))).collect())
}

fn are_in_turn(values: &[f64], width: usize) -> bool {
    let typical = |apart: usize| {
        let mut steps: Vec<f64> = values.windows(apart + 1).map(|part| (part[apart] - part[0]).abs()).collect();
        steps.sort_by(f64::total_cmp);
        // With few exceptions, neighbours are of different quantities and no value jumps.
        (steps.get(steps.len() / 20).copied(), steps.get(steps.len() * 19 / 20).copied())
    };
    let ((Some(least), _), (_, Some(largest))) = (typical(1), typical(width)) else { return false };
    values.len() >= FEWEST_ROWS * width && least > APART * largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_in_turn_are_rows() {
        let texts: Vec<String> =
            (0..30).flat_map(|k| [format!("{}", 700 + k % 4), format!("{}", 20 + k % 3)]).collect();
        let lines: Vec<(u64, &str)> = (1..).zip(texts.iter().map(String::as_str)).collect();
        let rows = rows(&lines, DecimalMark::Point).unwrap();
        assert_eq!((rows.len(), rows[1].0, rows[1].1.len()), (30, 3, 2));
        assert_eq!(rows[1].1, [Cell::text("701"), Cell::text("21")]);
    }

    #[test]
    fn a_motion_is_one_quantity() {
        let texts: Vec<String> = (0..60).map(|k| format!("{:.3}", 700.0 + 90.0 * (0.8 * f64::from(k)).sin())).collect();
        let lines: Vec<(u64, &str)> = (1..).zip(texts.iter().map(String::as_str)).collect();
        assert!(rows(&lines, DecimalMark::Point).is_none());
        assert!(rows(&lines[..8], DecimalMark::Point).is_none());
    }
}
