//! One plot: axes, and layers that are drawn in the order of their addition.

mod draw;
mod paper;

use std::collections::HashSet;

use super::axis::Axis;
use super::ink::{Ink, Key};
use super::thin::{self, Point};

/// Drawing units per pixel of the page: the plotting library uses integer units, and lines need a finer grid.
pub const UNITS_PER_PX: u32 = 4;
/// Size of the text, px.
const TEXT_PX: f64 = 13.0;
/// Space around the plot, px; on the left and below for labels.
const LEFT_PX: f64 = 74.0;
const BELOW_PX: f64 = 46.0;
const ABOVE_PX: f64 = 10.0;
/// Half of a long tick label.
const RIGHT_PX: f64 = 24.0;

/// Size of a plot across the page, px, and of a high one.
pub const WIDE: (f64, f64) = (940.0, 320.0);
pub const HIGH: (f64, f64) = (WIDE.0, 440.0);
/// Size of a plot that shares its line with another one, px.
pub const HALF: (f64, f64) = (460.0, 320.0);

/// Side of the cells in which one dot represents all, px.
const DOT_CELL_PX: f64 = 3.0;
/// Size of an arrow's head, px.
const ARROW_PX: (f64, f64) = (9.0, 3.5);

/// A plot.
#[derive(Debug)]
pub struct Chart {
    size_px: (f64, f64),
    x: Axis,
    y: Axis,
    layers: Vec<Layer>,
    legend: Vec<Key>,
}

#[derive(Debug)]
struct Layer {
    ink: Ink,
    name: String,
    shape: Shape,
}

/// Shape of a layer, in fractions of the plot's width and height.
#[derive(Debug)]
enum Shape {
    Lines(Vec<Vec<Point>>),
    Areas(Vec<Vec<Point>>),
    Boxes(Vec<(Point, Point)>),
    Dots(Vec<Point>),
}

impl Chart {
    /// Creates an empty plot.
    pub fn new(size_px: (f64, f64), x: Axis, y: Axis) -> Self {
        Self { size_px, x, y, layers: vec![], legend: vec![] }
    }

    /// Returns the keys of the layers, in their order.
    pub fn legend(&self) -> Vec<Key> {
        self.legend.clone()
    }

    /// Adds a line through points, broken at points that are not finite. An empty `name` keeps it out of the legend.
    pub fn line(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = Point>) {
        let columns = self.columns();
        let pieces = thin::line(points.into_iter().map(|(x, y)| (self.x.unit(x), self.y.unit(y))), columns);
        self.add(ink, name, Shape::Lines(pieces));
    }

    /// Adds a line through points, broken where it leaves the plot; used for computed curves.
    pub fn curve(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = Point>) {
        let ((left, right), (low, high)) = (self.x.ends(), self.y.ends());
        let inside = |(x, y): Point| {
            let seen = (left..=right).contains(&x) && (low..=high).contains(&y);
            (x, if seen { y } else { f64::NAN })
        };
        self.line(ink, name, points.into_iter().map(inside));
    }

    /// Adds the area between two lines, from `(x, lower, upper)`.
    pub fn band(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = (f64, f64, f64)>) {
        let columns = self.columns();
        let unit = |(x, lower, upper)| (self.x.unit(x), self.y.unit(lower), self.y.unit(upper));
        let outlines = thin::band(points.into_iter().map(unit), columns);
        self.add(ink, name, Shape::Areas(outlines));
    }

    /// Adds a line that crosses itself, from `(x, y, index of its ink)`.
    pub fn loops(&mut self, inks: &[(Ink, &str)], points: impl IntoIterator<Item = (f64, f64, usize)>) {
        let unit: Vec<_> = points.into_iter().map(|(x, y, ink)| (self.x.unit(x), self.y.unit(y), ink)).collect();
        let pieces = thin::loops(&unit);
        for (place, (ink, name)) in inks.iter().enumerate() {
            let own = pieces.iter().filter(|(colour, _)| *colour == place).map(|(_, piece)| piece.clone()).collect();
            self.add(*ink, name, Shape::Lines(own));
        }
    }

    /// Adds single points, one for each group of points that would look the same.
    pub fn dots(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = Point>) {
        let (width, height) = self.area_px();
        let mut visited = HashSet::new();
        let ((left, right), (low, high)) = (self.x.ends(), self.y.ends());
        let inside = |(x, y): &Point| (left..=right).contains(x) && (low..=high).contains(y);
        let unit = points.into_iter().filter(inside).map(|(x, y)| (self.x.unit(x), self.y.unit(y)));
        let cell = |share: f64, px: f64| (share * px / DOT_CELL_PX) as u32;
        let dots: Vec<Point> = unit.filter(|(x, y)| visited.insert((cell(*x, width), cell(*y, height)))).collect();
        self.add(ink, name, Shape::Dots(dots));
    }

    /// Adds arrowheads, each at the second point of a step.
    pub fn arrows(&mut self, ink: Ink, name: &str, steps: impl IntoIterator<Item = (Point, Point)>) {
        let (width, height) = self.area_px();
        let head = |((x0, y0), (x1, y1)): (Point, Point)| {
            let tip = (self.x.unit(x1), self.y.unit(y1));
            let (dx, dy) = ((tip.0 - self.x.unit(x0)) * width, (tip.1 - self.y.unit(y0)) * height);
            let length = dx.hypot(dy);
            let (ux, uy) = (dx / length, dy / length);
            let (long, half) = ARROW_PX;
            let corner = |side: f64| {
                let (x, y) = (-long * ux - side * half * uy, -long * uy + side * half * ux);
                (tip.0 + x / width, tip.1 + y / height)
            };
            (length > 0.0).then(|| vec![tip, corner(1.0), corner(-1.0)])
        };
        let heads: Vec<Vec<Point>> = steps.into_iter().filter_map(head).collect();
        self.add(ink, name, Shape::Areas(heads));
    }

    /// Shades a part of the x axis.
    pub fn shade(&mut self, ink: Ink, name: &str, from: f64, until: f64) {
        let (from, until) = (self.x.unit(from), self.x.unit(until));
        if until > from {
            self.add(ink, name, Shape::Boxes(vec![((from, 0.0), (until, 1.0))]));
        }
    }

    /// Adds a vertical line at `x`, unless it lies outside.
    pub fn vertical(&mut self, ink: Ink, name: &str, x: f64) {
        let (low, high) = self.x.ends();
        if (low..=high).contains(&x) {
            let share = self.x.unit(x);
            self.add(ink, name, Shape::Lines(vec![vec![(share, 0.0), (share, 1.0)]]));
        }
    }

    /// Adds a horizontal line at `y`, unless it lies outside.
    pub fn horizontal(&mut self, ink: Ink, name: &str, y: f64) {
        let (low, high) = self.y.ends();
        if (low..=high).contains(&y) {
            let share = self.y.unit(y);
            self.add(ink, name, Shape::Lines(vec![vec![(0.0, share), (1.0, share)]]));
        }
    }

    /// Adds bars that stand on zero, from `(left, right, height)`.
    pub fn bars(&mut self, ink: Ink, name: &str, bars: impl IntoIterator<Item = (f64, f64, f64)>) {
        let ground = self.y.unit(0.0);
        let unit = |(left, right, height)| {
            let height: f64 = self.y.unit(height);
            ((self.x.unit(left), height.min(ground)), (self.x.unit(right), height.max(ground)))
        };
        let boxes = bars.into_iter().filter(|bar| bar.2.is_finite()).map(unit).collect();
        self.add(ink, name, Shape::Boxes(boxes));
    }

    fn add(&mut self, ink: Ink, name: &str, shape: Shape) {
        let empty = match &shape {
            Shape::Lines(pieces) | Shape::Areas(pieces) => pieces.is_empty(),
            Shape::Boxes(boxes) => boxes.is_empty(),
            Shape::Dots(dots) => dots.is_empty(),
        };
        if empty {
            return;
        }
        if !name.is_empty() {
            let key = Key::new(ink, name);
            self.legend.push(Key { is_dot: matches!(shape, Shape::Dots(_)), ..key });
        }
        self.layers.push(Layer { ink, name: name.into(), shape });
    }

    /// Returns the size of the plot without its labels, px.
    fn area_px(&self) -> (f64, f64) {
        ((self.size_px.0 - LEFT_PX - RIGHT_PX).max(1.0), (self.size_px.1 - ABOVE_PX - BELOW_PX).max(1.0))
    }

    /// Returns the number of columns, one per pixel of the page.
    fn columns(&self) -> usize {
        self.area_px().0 as usize
    }

    /// Returns the drawn data as `series,part,x,y`: points of lines and dots, corners of areas, opposite corners of boxes.
    pub fn csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "'"));
        let mut csv = format!("series,part,{},{}\n", quoted(&self.x.label), quoted(&self.y.label));
        for layer in &self.layers {
            let name = quoted(if layer.name.is_empty() { "line" } else { &layer.name });
            let mut put = |part: usize, (x, y): Point| {
                csv += &format!("{name},{part},{},{}\n", rounded(self.x.value(x)), rounded(self.y.value(y)));
            };
            match &layer.shape {
                Shape::Lines(pieces) | Shape::Areas(pieces) => {
                    pieces.iter().enumerate().for_each(|(part, piece)| piece.iter().for_each(|point| put(part, *point)))
                }
                Shape::Boxes(boxes) => boxes.iter().enumerate().for_each(|(part, (from, to))| {
                    put(part, *from);
                    put(part, *to);
                }),
                Shape::Dots(dots) => dots.iter().enumerate().for_each(|(part, point)| put(part, *point)),
            }
        }
        csv
    }
}

/// Rounds to more digits than a drawing can show.
fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
