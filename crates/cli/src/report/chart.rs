//! One plot: axes, and layers that are drawn in the order in which they were added.

use std::collections::HashSet;

use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, DrawingBackend, FontFamily, IntoDrawingArea, PathElement, Polygon, Rectangle,
    SVGBackend, ShapeStyle,
};
use plotters::style::{Color, RGBColor, TRANSPARENT, TextStyle};

use super::ReportError;
use super::axis::Axis;
use super::ink::{Ink, Key, dashes};
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

/// Space to the left of a drawing by itself, px: letters of the axis' label begin where it begins.
const MARGIN_PX: f64 = 6.0;

/// Size of a plot across the page, px.
pub const WIDE: (f64, f64) = (940.0, 320.0);
/// Size of a plot that shares its line with another one, px.
pub const HALF: (f64, f64) = (460.0, 320.0);

/// Side of the cells in which one dot stands for all, px.
const DOT_CELL_PX: f64 = 3.0;
/// Radius of a dot and size of an arrow's head, px.
const DOT_PX: f64 = 1.6;
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

/// In shares of the plot's width and height.
#[derive(Debug)]
enum Shape {
    Lines(Vec<Vec<Point>>),
    Areas(Vec<Vec<Point>>),
    Boxes(Vec<(Point, Point)>),
    Dots(Vec<Point>),
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

    /// Single points, one for all that could not be told apart.
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

    /// Heads of arrows, each at its second point, coming from the first one.
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
            Shape::Dots(dots) => dots.is_empty(),
        };
        if empty {
            return;
        }
        if !name.is_empty() {
            self.legend.push(Key::new(ink, name));
        }
        self.layers.push(Layer { ink, name: name.into(), shape });
    }

    /// Size of the plot without its labels, px.
    fn area_px(&self) -> (f64, f64) {
        ((self.size_px.0 - LEFT_PX - RIGHT_PX).max(1.0), (self.size_px.1 - ABOVE_PX - BELOW_PX).max(1.0))
    }

    /// One column per pixel of the page.
    fn columns(&self) -> usize {
        self.area_px().0 as usize
    }

    /// What is drawn as `series,part,x,y`: points of lines and dots, corners of areas, opposite corners of boxes.
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

    /// The drawing by itself, with its legend, in the colours of paper, `width_mm` wide.
    ///
    /// # Errors
    /// If the plotting library cannot draw it.
    pub fn standalone(&self, title: &str, width_mm: f64) -> Result<String, ReportError> {
        let drawing = self.svg(title)?;
        let inside = drawing.split_once('>').map_or("", |(_, inside)| inside);
        let units = f64::from(UNITS_PER_PX);
        let (width, height) = (units * self.size_px.0, units * self.size_px.1);
        let (legend, legend_height) = self.drawn_legend();
        let (margin, whole) = (units * MARGIN_PX, height + legend_height);
        let height_mm = width_mm * whole / (width + margin);
        let (dashes, label) = (dashes(UNITS_PER_PX), minijinja::HtmlEscape(title));
        Ok(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{label}\" width=\"{width_mm}mm\" \
             height=\"{height_mm:.1}mm\" viewBox=\"-{margin} 0 {} {whole}\">\n<style>{dashes}polyline{{stroke-linejoin:round}}\
             text{{font-family:Arial,Helvetica,sans-serif}}</style>\n<rect x=\"-{margin}\" width=\"{}\" height=\"{whole}\" \
             fill=\"#fff\"/>\n{legend}<g transform=\"translate(0 {legend_height})\">{}</g>\n</svg>\n",
            width + margin,
            width + margin,
            inside.trim_end().trim_end_matches("</svg>")
        ))
    }

    /// The legend in drawing units, and its height.
    fn drawn_legend(&self) -> (String, f64) {
        let units = f64::from(UNITS_PER_PX);
        let (sample, gap, row, size) = (26.0 * units, 8.0 * units, 19.0 * units, TEXT_PX * units);
        let (mut x, mut y) = (LEFT_PX * units, row);
        let mut drawn = String::new();
        for key in &self.legend {
            // Letters are half as wide as high, on average.
            let width = sample + 2.0 * gap + 0.52 * size * key.name.chars().count() as f64;
            if x > LEFT_PX * units && x + width > (self.size_px.0 - RIGHT_PX) * units {
                (x, y) = (LEFT_PX * units, y + row);
            }
            let (line, text) = (y - 0.35 * size, x + sample + gap);
            drawn += &format!(
                "<line x1=\"{x}\" x2=\"{}\" y1=\"{line}\" y2=\"{line}\" stroke=\"{}\" stroke-width=\"{}\" opacity=\"{}\"/>\
                 <text x=\"{text}\" y=\"{y}\" font-size=\"{size}\" fill=\"#404040\">{}</text>\n",
                x + sample,
                key.hex,
                key.width * units,
                key.opacity,
                minijinja::HtmlEscape(&key.name)
            );
            x += width + gap;
        }
        (drawn, if self.legend.is_empty() { 0.0 } else { y + 0.5 * row })
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
        let inside = self.with_data_apart(inside);
        let label = minijinja::HtmlEscape(description);
        let (width, area, axes) = (self.size_px.0, self.area_units(), [&self.x, &self.y].map(Axis::as_attribute));
        Ok(format!(
            "<svg role=\"img\" aria-label=\"{label}\" style=\"--width: {width}px\" data-area=\"{area}\" data-x=\"{}\" \
             data-y=\"{}\" viewBox{inside}",
            axes[0], axes[1]
        ))
    }

    /// Left, top, width and height of the plot without its labels, in drawing units.
    fn area_units(&self) -> String {
        let (width, height) = self.area_px();
        [LEFT_PX, ABOVE_PX, width, height].map(|px| fine(px).to_string()).join(" ")
    }

    /// The layers in a group of their own, which a script can move without the axes.
    fn with_data_apart(&self, inside: &str) -> String {
        let Some(layers) = self.layers.first() else { return inside.into() };
        let hex = layers.ink.hex();
        // Each ink has a colour of its own, and axes come first.
        let first = inside.find(&format!("\"{hex}\"")).and_then(|at| inside[..at].rfind('<'));
        match (first, inside.rfind("</svg>")) {
            (Some(first), Some(end)) if first < end => {
                format!("{}<g class=\"data\">\n{}</g>\n{}", &inside[..first], &inside[first..end], &inside[end..])
            }
            _ => inside.into(),
        }
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
            Shape::Dots(dots) => {
                let radius = fine(DOT_PX.max(0.5 * self.ink.width));
                dots.iter().try_for_each(|dot| area.draw(&Circle::new(place(*dot), radius, style.filled())))
            }
            Shape::Areas(outlines) => outlines.iter().try_for_each(|outline| {
                area.draw(&Polygon::new(outline.iter().copied().map(place).collect::<Vec<_>>(), style))
            }),
            Shape::Boxes(boxes) => boxes
                .iter()
                .try_for_each(|(from, to)| area.draw(&Rectangle::new([place(*from), place(*to)], style.filled()))),
        }
    }
}

/// With as many digits as a drawing shows, and more.
fn rounded(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
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
