//! A plot as SVG for the page.

use plotters::coord::Shift;
use plotters::prelude::{
    ChartBuilder, Circle, DrawingArea, DrawingBackend, FontFamily, IntoDrawingArea, PathElement, Polygon, Rectangle,
    SVGBackend, ShapeStyle,
};
use plotters::style::{Color, RGBColor, TRANSPARENT, TextStyle};

use super::{ABOVE_PX, BELOW_PX, Chart, LEFT_PX, Layer, RIGHT_PX, Shape, TEXT_PX, UNITS_PER_PX};
use crate::ReportError;
use crate::axis::Axis;
use crate::ink::Ink;
use crate::thin::Point;

/// Ratio of the plotting library's text sizes to the font sizes that it writes.
const FONT_SIZE_FACTOR: f64 = 1.24;
/// Radius of a dot, px.
const DOT_PX: f64 = 1.6;

impl Chart {
    /// Draws the plot as SVG, with `description` as its text alternative.
    ///
    /// # Errors
    /// If the plotting library cannot draw it.
    pub fn svg(&self, description: &str) -> Result<String, ReportError> {
        let mut drawing = String::new();
        let size = (fine(self.size_px.0).unsigned_abs(), fine(self.size_px.1).unsigned_abs());
        self.draw(SVGBackend::with_string(&mut drawing, size)).map_err(ReportError::Plot)?;
        // The style sheet sets its size on the page; the view box keeps the proportions.
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

    /// Returns the area of the plot without its labels, in drawing units: left, top, width and height.
    fn area_units(&self) -> String {
        let (width, height) = self.area_px();
        [LEFT_PX, ABOVE_PX, width, height].map(|px| fine(px).to_string()).join(" ")
    }

    /// Puts the layers into a group of their own, which a script can move without the axes.
    fn with_data_apart(&self, inside: &str) -> String {
        let Some(layers) = self.layers.first() else { return inside.into() };
        let hex = layers.ink.hex();
        // Each ink has a unique colour, and axes come first.
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
