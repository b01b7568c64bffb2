//! A stand-alone plot for a paper.

use super::{Chart, HALF, LEFT_PX, RIGHT_PX, TEXT_PX, UNITS_PER_PX, WIDE};
use crate::ReportError;
use crate::ink::dashes;

/// Widths of a figure across a page and across a column, mm.
const PAGE_MM: f64 = 170.0;
const COLUMN_MM: f64 = 85.0;
/// Space to the left of a stand-alone drawing across a page, px: letters of the axis label begin at the left edge.
const MARGIN_PX: f64 = 6.0;
/// Common scale, so that letters have the same size everywhere: 13 px are 2.3 mm.
const PX_PER_MM: f64 = (WIDE.0 + MARGIN_PX) / PAGE_MM;

impl Chart {
    /// Returns the width of the stand-alone drawing, mm: a column's or a page's.
    pub const fn width_mm(&self) -> f64 {
        if self.size_px.0 <= HALF.0 { COLUMN_MM } else { PAGE_MM }
    }

    /// Draws the plot on its own, with its legend, in the colours for paper.
    ///
    /// # Errors
    /// If the plotting library cannot draw it.
    pub fn standalone(&self, title: &str) -> Result<String, ReportError> {
        let drawing = self.svg(title)?;
        let inside = drawing.split_once('>').map_or("", |(_, inside)| inside);
        let units = f64::from(UNITS_PER_PX);
        let (width, height) = (units * self.size_px.0, units * self.size_px.1);
        let (legend, legend_height) = self.drawn_legend();
        let width_mm = self.width_mm();
        let (margin, whole) = (units * (width_mm * PX_PER_MM - self.size_px.0), height + legend_height);
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

    /// Returns the legend in drawing units, and its height.
    fn drawn_legend(&self) -> (String, f64) {
        let units = f64::from(UNITS_PER_PX);
        let (sample, gap, row, size) = (26.0 * units, 8.0 * units, 19.0 * units, TEXT_PX * units);
        let (mut x, mut y) = (LEFT_PX * units, row);
        let mut drawn = String::new();
        for key in &self.legend {
            // Letters are on average half as wide as high.
            let width = sample + 2.0 * gap + 0.52 * size * key.name.chars().count() as f64;
            if x > LEFT_PX * units && x + width > (self.size_px.0 - RIGHT_PX) * units {
                (x, y) = (LEFT_PX * units, y + row);
            }
            let (middle, text, hex) = (y - 0.35 * size, x + sample + gap, &key.hex);
            drawn += &if key.is_dot {
                format!("<circle cx=\"{}\" cy=\"{middle}\" r=\"{}\" fill=\"{hex}\"/>", x + 0.5 * sample, 3.0 * units)
            } else {
                format!(
                    "<line x1=\"{x}\" x2=\"{}\" y1=\"{middle}\" y2=\"{middle}\" stroke=\"{hex}\" stroke-width=\"{}\" \
                     opacity=\"{}\"/>",
                    x + sample,
                    key.width * units,
                    key.opacity
                )
            };
            drawn += &format!(
                "<text x=\"{text}\" y=\"{y}\" font-size=\"{size}\" fill=\"#404040\">{}</text>\n",
                minijinja::HtmlEscape(&key.name)
            );
            x += width + gap;
        }
        (drawn, if self.legend.is_empty() { 0.0 } else { y + 0.5 * row })
    }
}
