//! Thinning of points without a visible change of the picture.
//!
//! A million rows on a plot some hundred columns wide cannot be seen one by one, but a single spike among them must be. For
//! each column, a line keeps the first, the lowest, the highest and the last point, in their order; the drawing is
//! indistinguishable from that of the whole line (Jugel, Jerzak, Hackenbroich, Markl, "M4", *Proc. VLDB Endow.* 7, 2014). A
//! loop returns to every column; a point of it is dropped if its cell of the plot has been visited in the same colour.
//!
//! Coordinates are fractions of the plot's width and height; NaN breaks a line.

/// A point of a plot.
pub type Point = (f64, f64);

/// Largest number of points of a loop, unless its cells would have to be coarser than the coarsest grid.
const MOST_LOOP_POINTS: usize = 12_000;
/// Cells per side of the grids for thinning a loop, tried in this order.
const LOOP_GRIDS: [usize; 4] = [600, 300, 150, 75];

/// Returns the pieces of a line, thinned to four points per column. The line is broken at points that are not finite, unless it
/// continues in the same column, where the gap would not be visible.
pub fn line(points: impl IntoIterator<Item = Point>, columns: usize) -> Vec<Vec<Point>> {
    let mut pieces = vec![];
    let mut piece = Piece::new(columns);
    let mut gap = false;
    for point in points {
        if !(point.0.is_finite() && point.1.is_finite()) {
            gap = true;
            continue;
        }
        if gap && !piece.is_in_column_of(point) {
            pieces.extend(piece.take());
        }
        gap = false;
        piece.push(point);
    }
    pieces.extend(piece.take());
    pieces
}

/// A line under construction.
struct Piece {
    columns: f64,
    kept: Vec<Point>,
    open: Option<Column>,
}

/// Points of one column that are kept, each with its index in the column.
struct Column {
    number: f64,
    count: usize,
    first: Point,
    lowest: (usize, Point),
    highest: (usize, Point),
    last: Point,
}

impl Piece {
    fn new(columns: usize) -> Self {
        Self { columns: columns.max(1) as f64, kept: vec![], open: None }
    }

    fn column_of(&self, point: Point) -> f64 {
        (point.0 * self.columns).floor()
    }

    fn is_in_column_of(&self, point: Point) -> bool {
        self.open.as_ref().is_some_and(|column| column.number == self.column_of(point))
    }

    fn push(&mut self, point: Point) {
        let number = self.column_of(point);
        match &mut self.open {
            Some(column) if column.number == number => column.push(point),
            _ => {
                self.close();
                let here = (0, point);
                self.open = Some(Column { number, count: 1, first: point, lowest: here, highest: here, last: point });
            }
        }
    }

    fn close(&mut self) {
        let Some(column) = self.open.take() else { return };
        self.kept.push(column.first);
        let mut between = [column.lowest, column.highest];
        between.sort_by_key(|(place, _)| *place);
        for (_, point) in between {
            self.keep(point);
        }
        self.keep(column.last);
    }

    fn keep(&mut self, point: Point) {
        if self.kept.last() != Some(&point) {
            self.kept.push(point);
        }
    }

    fn take(&mut self) -> Option<Vec<Point>> {
        self.close();
        let kept = std::mem::take(&mut self.kept);
        (!kept.is_empty()).then_some(kept)
    }
}

impl Column {
    fn push(&mut self, point: Point) {
        if point.1 < self.lowest.1.1 {
            self.lowest = (self.count, point);
        }
        if point.1 > self.highest.1.1 {
            self.highest = (self.count, point);
        }
        self.last = point;
        self.count += 1;
    }
}

/// Returns the outlines of a band, one per unbroken piece, from `(x, lower, upper)`: for each column the lowest lower and the
/// highest upper border.
pub fn band(points: impl IntoIterator<Item = (f64, f64, f64)>, columns: usize) -> Vec<Vec<Point>> {
    let columns = columns.max(1) as f64;
    let mut pieces = vec![];
    let mut kept: Vec<(f64, f64, f64, f64)> = vec![];
    let mut gap = false;
    for (x, lower, upper) in points {
        if !(x.is_finite() && lower.is_finite() && upper.is_finite()) {
            gap = true;
            continue;
        }
        let number = (x * columns).floor();
        match kept.last_mut() {
            Some(last) if last.0 == number => *last = (number, last.1, last.2.min(lower), last.3.max(upper)),
            _ if gap => {
                pieces.extend(outline(&mut kept));
                kept.push((number, x, lower, upper));
            }
            _ => kept.push((number, x, lower, upper)),
        }
        gap = false;
    }
    pieces.extend(outline(&mut kept));
    pieces
}

fn outline(kept: &mut Vec<(f64, f64, f64, f64)>) -> Option<Vec<Point>> {
    let columns = std::mem::take(kept);
    let there = columns.iter().map(|&(_, x, lower, _)| (x, lower));
    let back = columns.iter().rev().map(|&(_, x, _, upper)| (x, upper));
    (columns.len() > 1).then(|| there.chain(back).collect())
}

/// Returns the single-coloured pieces of a line that crosses itself, with their colours. `points` are `(x, y, colour)`; a step
/// between two points has the colour of the second one.
pub fn loops(points: &[(f64, f64, usize)]) -> Vec<(usize, Vec<Point>)> {
    if points.len() <= MOST_LOOP_POINTS {
        return pieces_of(points, |_| true);
    }
    let mut pieces = vec![];
    for grid in LOOP_GRIDS {
        let mut visited = std::collections::HashSet::new();
        let cell = |share: f64| (share.clamp(0.0, 1.0) * grid as f64) as usize;
        pieces = pieces_of(points, |&(x, y, colour)| visited.insert((cell(x), cell(y), colour)));
        if pieces.iter().map(|(_, piece)| piece.len()).sum::<usize>() <= MOST_LOOP_POINTS {
            break;
        }
    }
    pieces
}

/// Joins the steps that end in a wanted point to pieces of one colour.
fn pieces_of(
    points: &[(f64, f64, usize)],
    mut wanted: impl FnMut(&(f64, f64, usize)) -> bool,
) -> Vec<(usize, Vec<Point>)> {
    let finite = |point: &(f64, f64, usize)| point.0.is_finite() && point.1.is_finite();
    let mut pieces: Vec<(usize, Vec<Point>)> = vec![];
    let mut joined = false;
    let mut before = None;
    for point in points {
        let keep = finite(point) && wanted(point);
        if keep {
            match pieces.last_mut() {
                Some((colour, piece)) if joined && *colour == point.2 => piece.push((point.0, point.1)),
                _ => pieces.push((point.2, before.into_iter().chain([(point.0, point.1)]).collect())),
            }
        }
        joined = keep;
        before = finite(point).then_some((point.0, point.1));
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::{band, line, loops};

    #[test]
    fn a_single_spike_survives() {
        let rows = 1_000_000;
        let value = |k: usize| match k {
            123_457 => 1.0,
            765_431 => 0.0,
            _ => 0.5,
        };
        let pieces = line((0..rows).map(|k| (k as f64 / rows as f64, value(k))), 800);
        assert_eq!(pieces.len(), 1);
        assert!(pieces[0].len() <= 4 * 800);
        assert!(pieces[0].contains(&(0.123_457, 1.0)));
        assert!(pieces[0].contains(&(0.765_431, 0.0)));
        assert!(pieces[0].windows(2).all(|pair| pair[0].0 <= pair[1].0), "points keep their order");
    }

    #[test]
    fn missing_values_break_lines_and_bands() {
        let points = [(0.1, 0.1), (0.2, f64::NAN), (0.3, 0.3), (0.4, 0.4), (f64::NAN, 0.5)];
        assert_eq!(line(points, 100), [vec![(0.1, 0.1)], vec![(0.3, 0.3), (0.4, 0.4)]]);
        assert!(line([(0.1, f64::NAN)], 100).is_empty());
        let outlines = band(points.map(|(x, y)| (x, y - 0.1, y + 0.1)), 100);
        assert_eq!(outlines.len(), 1);
        assert_eq!(outlines[0].len(), 4);
    }

    #[test]
    fn gaps_that_nobody_sees_do_not_break() {
        let every_other = |k: usize| if k.is_multiple_of(2) { 0.5 } else { f64::NAN };
        let pieces = line((0..100_000).map(|k| (k as f64 * 1e-5, every_other(k))), 300);
        assert!(pieces.len() <= 300, "{}", pieces.len());
    }

    #[test]
    fn a_band_keeps_its_widest_place() {
        let wide = |k: usize| if k == 500_000 { 0.4 } else { 0.1 };
        let outlines = band((0..1_000_000).map(|k| (k as f64 * 1e-6, 0.5 - wide(k), 0.5 + wide(k))), 300);
        assert!(outlines[0].len() <= 600);
        assert!(outlines[0].iter().any(|&(_, y)| y == 0.5 - 0.4));
    }

    #[test]
    fn a_long_loop_keeps_its_shape_and_its_spike() {
        let points: Vec<_> = (0..400_000)
            .map(|k| {
                let angle = f64::from(k) * 0.01;
                let spike = if k == 300_001 { 0.5 } else { 0.0 };
                (0.5 + 0.3 * angle.cos() + spike, 0.5 + 0.3 * angle.sin(), usize::from(angle.sin() > 0.0))
            })
            .collect();
        let pieces = loops(&points);
        let kept: usize = pieces.iter().map(|(_, piece)| piece.len()).sum();
        assert!(kept <= super::MOST_LOOP_POINTS && kept > 500, "{kept}");
        assert!(pieces.iter().any(|(_, piece)| piece.contains(&(points[300_001].0, points[300_001].1))));
    }
}
