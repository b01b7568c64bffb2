//! One plot: axes, and layers that are drawn in the order in which they were added.

use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, DrawingBackend, FontFamily, IntoDrawingArea, PathElement, Polygon, Rectangle,
    SVGBackend, ShapeStyle,
};
use plotters::style::{Color, RGBColor, TRANSPARENT, TextStyle};

use super::ReportError;
use super::axis::Axis;
use super::ink::{Ink, Key};
use super::thin::{self, Point};

/// Drawing units per pixel of the page: the plotting library knows whole units only, and lines need a finer grid.
pub const UNITS_PER_PX: u32 = 4;
/// Size of the text, px.
const TEXT_PX: f64 = 13.0;
/// The plotting library's sizes of text are this much larger than the font sizes it writes.
const FONT_SIZE_FACTOR: f64 = 1.24;
/// Space around the plot, px; at the left and below for labels.
const LEFT_PX: f64 = 74.0;
const BELOW_PX: f64 = 46.0;
const ABOVE_PX: f64 = 10.0;
/// Half of a long tick label.
const RIGHT_PX: f64 = 24.0;

/// Size of a plot across the page, px.
pub const WIDE: (f64, f64) = (940.0, 320.0);
/// Size of a plot that shares its line with another one, px.
pub const HALF: (f64, f64) = (460.0, 320.0);

/// A plot.
pub struct Chart {
    size_px: (f64, f64),
    x: Axis,
    y: Axis,
    layers: Vec<Layer>,
    legend: Vec<Key>,
}

struct Layer {
    ink: Ink,
    shape: Shape,
}

/// In shares of the plot's width and height.
enum Shape {
    Lines(Vec<Vec<Point>>),
    Areas(Vec<Vec<Point>>),
    Boxes(Vec<(Point, Point)>),
}

impl Chart {
    /// An empty plot.
    pub fn new(size_px: (f64, f64), x: Axis, y: Axis) -> Self {
        Self { size_px, x, y, layers: vec![], legend: vec![] }
    }

    /// What the layers are, in their order.
    pub fn legend(&self) -> Vec<Key> {
        self.legend.clone()
    }

    /// A line through points; one that is not finite breaks it. An empty `name` keeps it out of the legend.
    pub fn line(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = Point>) {
        let columns = self.columns();
        let pieces = thin::line(points.into_iter().map(|(x, y)| (self.x.unit(x), self.y.unit(y))), columns);
        self.add(ink, name, Shape::Lines(pieces));
    }

    /// A line through points, broken where it leaves the plot: for what is computed and not measured.
    pub fn curve(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = Point>) {
        let ((left, right), (low, high)) = (self.x.ends(), self.y.ends());
        let inside = |(x, y): Point| {
            let seen = (left..=right).contains(&x) && (low..=high).contains(&y);
            (x, if seen { y } else { f64::NAN })
        };
        self.line(ink, name, points.into_iter().map(inside));
    }

    /// The area between two lines, from `(x, lower, upper)`.
    pub fn band(&mut self, ink: Ink, name: &str, points: impl IntoIterator<Item = (f64, f64, f64)>) {
        let columns = self.columns();
        let unit = |(x, lower, upper)| (self.x.unit(x), self.y.unit(lower), self.y.unit(upper));
        let outlines = thin::band(points.into_iter().map(unit), columns);
        self.add(ink, name, Shape::Areas(outlines));
    }

    /// A line that crosses itself, from `(x, y, place of its ink)`.
    pub fn loops(&mut self, inks: &[(Ink, &str)], points: impl IntoIterator<Item = (f64, f64, usize)>) {
        let unit: Vec<_> = points.into_iter().map(|(x, y, ink)| (self.x.unit(x), self.y.unit(y), ink)).collect();
        let pieces = thin::loops(&unit);
        for (place, (ink, name)) in inks.iter().enumerate() {
            let own = pieces.iter().filter(|(colour, _)| *colour == place).map(|(_, piece)| piece.clone()).collect();
            self.add(*ink, name, Shape::Lines(own));
        }
    }

    /// A part of the x axis.
    pub fn shade(&mut self, ink: Ink, name: &str, from: f64, until: f64) {
        let (from, until) = (self.x.unit(from), self.x.unit(until));
        if until > from {
            self.add(ink, name, Shape::Boxes(vec![((from, 0.0), (until, 1.0))]));
        }
    }

    /// A line across the plot at `x`, unless it lies outside.
    pub fn vertical(&mut self, ink: Ink, name: &str, x: f64) {
        let (low, high) = self.x.ends();
        if (low..=high).contains(&x) {
            let share = self.x.unit(x);
            self.add(ink, name, Shape::Lines(vec![vec![(share, 0.0), (share, 1.0)]]));
        }
    }

    /// A line across the plot at `y`, unless it lies outside.
    pub fn horizontal(&mut self, ink: Ink, name: &str, y: f64) {
        let (low, high) = self.y.ends();
        if (low..=high).contains(&y) {
            let share = self.y.unit(y);
            self.add(ink, name, Shape::Lines(vec![vec![(0.0, share), (1.0, share)]]));
        }
    }

    /// Bars that stand on zero, from `(left, right, height)`.
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
        };
        if empty {
            return;
        }
        if !name.is_empty() {
            self.legend.push(Key::new(ink, name));
        }
        self.layers.push(Layer { ink, shape });
    }

    /// One column per pixel of the page.
    fn columns(&self) -> usize {
        (self.size_px.0 - LEFT_PX - RIGHT_PX).max(1.0) as usize
    }

    /// The drawing, with `description` for those who do not see it.
    ///
    /// # Errors
    /// If the plotting library cannot draw it.
    pub fn svg(&self, description: &str) -> Result<String, ReportError> {
        let mut drawing = String::new();
        let size = (fine(self.size_px.0).unsigned_abs(), fine(self.size_px.1).unsigned_abs());
        self.draw(SVGBackend::with_string(&mut drawing, size)).map_err(ReportError::Plot)?;
        // Its size on the page is the style sheet's affair; the view box keeps the proportions.
        let inside = drawing.split_once("viewBox").map_or("", |(_, inside)| inside);
        let label = minijinja::HtmlEscape(description);
        let width = self.size_px.0;
        Ok(format!("<svg role=\"img\" aria-label=\"{label}\" style=\"--width: {width}px\" viewBox{inside}"))
    }

    fn draw(&self, backend: SVGBackend) -> Result<(), String> {
        let root = backend.into_drawing_area();
        let ink = rgb(Ink::TEXT);
        let text =
            TextStyle::from((FontFamily::SansSerif, f64::from(UNITS_PER_PX) * TEXT_PX * FONT_SIZE_FACTOR)).color(&ink);
        let mut chart = ChartBuilder::on(&root)
            .margin_top(fine(ABOVE_PX))
            .margin_right(fine(RIGHT_PX))
            .x_label_area_size(fine(BELOW_PX))
            .y_label_area_size(fine(LEFT_PX))
            .build_cartesian_2d(self.x.clone(), self.y.clone())
            .map_err(|error| error.to_string())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(style(Ink::GRID))
            .axis_style(style(Ink::FRAME))
            .label_style(text.clone())
            .axis_desc_style(text)
            .set_all_tick_mark_size(fine(4.0))
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .draw()
            .map_err(|error| error.to_string())?;
        let area = chart.plotting_area().strip_coord_spec();
        for layer in &self.layers {
            layer.draw(&area).map_err(|error| error.to_string())?;
        }
        root.present().map_err(|error| error.to_string())
    }
}

impl Layer {
    fn draw<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
    ) -> Result<(), plotters::drawing::DrawingAreaErrorKind<B::ErrorType>> {
        let (width, height) = area.dim_in_pixel();
        let place = |(x, y): Point| {
            let (x, y) = (x * f64::from(width), (1.0 - y) * f64::from(height));
            (x.round() as i32, y.round() as i32)
        };
        let style = style(self.ink);
        match &self.shape {
            Shape::Lines(pieces) => pieces.iter().try_for_each(|piece| match piece.as_slice() {
                [only] => area.draw(&Circle::new(place(*only), fine(self.ink.width.max(1.5)), style.filled())),
                piece => area.draw(&PathElement::new(piece.iter().copied().map(place).collect::<Vec<_>>(), style)),
            }),
            Shape::Areas(outlines) => outlines.iter().try_for_each(|outline| {
                area.draw(&Polygon::new(outline.iter().copied().map(place).collect::<Vec<_>>(), style))
            }),
            Shape::Boxes(boxes) => boxes
                .iter()
                .try_for_each(|(from, to)| area.draw(&Rectangle::new([place(*from), place(*to)], style.filled()))),
        }
    }
}

fn rgb(ink: Ink) -> RGBColor {
    let (red, green, blue) = ink.colour;
    RGBColor(red, green, blue)
}

fn style(ink: Ink) -> ShapeStyle {
    ShapeStyle { color: rgb(ink).mix(ink.opacity), filled: false, stroke_width: fine(ink.width).unsigned_abs() }
}

fn fine(px: f64) -> i32 {
    (f64::from(UNITS_PER_PX) * px).round() as i32
}
