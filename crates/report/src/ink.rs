//! Inks: one table for plots, legends and style sheet.
//!
//! The plotting library writes colours into the drawing. The style sheet identifies each ink by its unique colour, and assigns
//! its dashes and its hue in the page's light or dark scheme. Hues follow Okabe and Ito's palette, which stays distinct for
//! colour-blind readers; lines that could still be confused differ in their dashes.

use serde::Serialize;

/// Style of one kind of element in a drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// Colour that identifies it in the drawing; it is visible if style sheets are ignored.
    pub colour: (u8, u8, u8),
    /// Variable of the style sheet that holds its hue.
    pub hue: &'static str,
    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub dashes: &'static [u32],
    /// Width of a line, px.
    pub width: f64,
    /// Opacity, 1 for opaque.
    pub opacity: f64,
}

impl Ink {
    /// Recorded readings.
    pub const RECORDED: Self = Self::line((0x1A, 0x1A, 0x1A), "ink", 1.1);
    /// The reference.
    pub const TRUTH: Self = Self::line((0x1B, 0x1B, 0x1B), "ink", 1.6);
    /// Estimate of the filter.
    pub const FILTER: Self = Self::line((0x00, 0x72, 0xB2), "blue", 1.6);
    /// The filter's line if another line runs on top of it.
    pub const FILTER_BELOW: Self = Self { opacity: 0.6, ..Self::line((0x00, 0x72, 0xB1), "blue", 4.5) };
    /// The filter's uncertainty.
    pub const FILTER_BAND: Self = Self { opacity: 0.25, ..Self::line((0x00, 0x72, 0xB3), "blue", 8.0) };
    /// Estimate of the smoother.
    pub const SMOOTHER: Self = Self::dashed((0xD5, 0x5E, 0x00), "red", 1.6, &[7, 3]);
    /// Prediction of the law.
    pub const LAW: Self = Self::dashed((0x00, 0x7A, 0x59), "green", 1.6, &[7, 3]);
    /// The law's uncertainty.
    pub const LAW_BAND: Self = Self { opacity: 0.22, ..Self::line((0x00, 0x7A, 0x5A), "green", 8.0) };
    /// A curve of the law.
    pub const CURVE: Self = Self::line((0x00, 0x7A, 0x5B), "green", 2.2);
    /// The static calibration.
    pub const STATIC: Self = Self::dashed((0xA3, 0x3B, 0x7A), "purple", 2.2, &[7, 3]);
    /// Strain by the static calibration, against time.
    pub const STATIC_STRAIN: Self = Self::dashed((0xA3, 0x3B, 0x7E), "purple", 1.2, &[3, 3]);
    /// The course of time, from the first fifth to the last.
    pub const TIMES: [Self; 5] = [
        Self::line((0xC9, 0xA2, 0x27), "time-1", 1.1),
        Self::line((0x4D, 0xAF, 0x62), "time-2", 1.1),
        Self::line((0x1F, 0x8A, 0x8C), "time-3", 1.1),
        Self::line((0x35, 0x5F, 0x8D), "time-4", 1.1),
        Self::line((0x48, 0x1B, 0x6D), "time-5", 1.1),
    ];
    /// Movements, from slow to fast.
    pub const SPEEDS: [Self; 3] = [
        Self::line((0x00, 0x7A, 0x5E), "green", 1.2),
        Self::line((0x00, 0x72, 0xB8), "blue", 1.2),
        Self::line((0xD5, 0x5E, 0x04), "red", 1.2),
    ];
    /// Start of a hold.
    pub const BEGUN: Self = Self::line((0xD5, 0x5E, 0x05), "red", 6.0);
    /// End of a hold.
    pub const ENDED: Self = Self::line((0x00, 0x72, 0xB9), "blue", 6.0);
    /// Direction of a line.
    pub const ARROWS: Self = Self::line((0x1D, 0x1D, 0x1D), "ink", 1.0);
    /// A bound.
    pub const BOUND: Self = Self::dashed((0xA3, 0x3B, 0x7B), "purple", 1.6, &[2, 3]);
    /// The part that is scored.
    pub const TEST: Self = Self { opacity: 0.14, ..Self::line((0xB0, 0x80, 0x00), "yellow", 8.0) };
    /// Counts.
    pub const BARS: Self = Self { opacity: 0.45, ..Self::line((0x00, 0x72, 0xB5), "blue", 8.0) };
    /// Single values.
    pub const DOTS: Self = Self { opacity: 0.55, ..Self::line((0x1C, 0x1C, 0x1C), "ink", 1.0) };
    /// Readings recorded during the longest holds.
    pub const HOLDS: [Self; 4] = [
        Self::line((0x00, 0x72, 0xB6), "blue", 1.8),
        Self::line((0xD5, 0x5E, 0x02), "red", 1.8),
        Self::line((0x00, 0x7A, 0x5C), "green", 1.8),
        Self::line((0xA3, 0x3B, 0x7C), "purple", 1.8),
    ];
    /// The law during the same holds.
    pub const HELD_LAWS: [Self; 4] = [
        Self::dashed((0x00, 0x72, 0xB7), "blue", 1.6, &[6, 4]),
        Self::dashed((0xD5, 0x5E, 0x03), "red", 1.6, &[6, 4]),
        Self::dashed((0x00, 0x7A, 0x5D), "green", 1.6, &[6, 4]),
        Self::dashed((0xA3, 0x3B, 0x7D), "purple", 1.6, &[6, 4]),
    ];
    /// Text and ticks.
    pub const TEXT: Self = Self::line((0x40, 0x40, 0x40), "soft", 1.0);
    /// Grid lines.
    pub const GRID: Self = Self::line((0xE2, 0xE2, 0xE2), "grid", 1.0);
    /// Axes.
    pub const FRAME: Self = Self::line((0x8C, 0x8C, 0x8C), "frame", 1.0);

    const fn line(colour: (u8, u8, u8), hue: &'static str, width: f64) -> Self {
        Self { colour, hue, dashes: &[], width, opacity: 1.0 }
    }

    const fn dashed(colour: (u8, u8, u8), hue: &'static str, width: f64, dashes: &'static [u32]) -> Self {
        Self { colour, hue, dashes, width, opacity: 1.0 }
    }

    /// Returns all of them.
    pub fn all() -> Vec<Self> {
        let single = [
            Self::RECORDED,
            Self::TRUTH,
            Self::FILTER,
            Self::FILTER_BELOW,
            Self::FILTER_BAND,
            Self::SMOOTHER,
            Self::LAW,
            Self::LAW_BAND,
            Self::CURVE,
            Self::STATIC,
            Self::STATIC_STRAIN,
            Self::ARROWS,
            Self::BEGUN,
            Self::ENDED,
            Self::BOUND,
            Self::TEST,
            Self::BARS,
            Self::DOTS,
            Self::TEXT,
            Self::GRID,
            Self::FRAME,
        ];
        single.into_iter().chain(Self::HOLDS).chain(Self::HELD_LAWS).chain(Self::TIMES).chain(Self::SPEEDS).collect()
    }

    /// Returns the colour as it is written in the drawing.
    pub fn hex(self) -> String {
        let (red, green, blue) = self.colour;
        format!("#{red:02X}{green:02X}{blue:02X}")
    }
}

/// An ink as a row of the style sheet.
#[derive(Debug, Serialize)]
pub struct Style {
    hex: String,
    hue: &'static str,
    legend_dashes: String,
    plot_dashes: String,
}

/// Returns rules for the dashes alone, for a drawing without the page's style sheet.
pub fn dashes(units_per_px: u32) -> String {
    let rule = |style: Style| format!("[stroke=\"{}\"]{{stroke-dasharray:{}}}", style.hex, style.plot_dashes);
    styles(units_per_px).into_iter().filter(|style| !style.plot_dashes.is_empty()).map(rule).collect()
}

/// Returns the rows of the style sheet. A plot has `units_per_px` drawing units per pixel, a legend has one.
pub fn styles(units_per_px: u32) -> Vec<Style> {
    let dashes = |ink: Ink, unit: u32| {
        let lengths: Vec<String> = ink.dashes.iter().map(|px| (px * unit).to_string()).collect();
        lengths.join(" ")
    };
    let style = |ink: Ink| Style {
        hex: ink.hex(),
        hue: ink.hue,
        legend_dashes: dashes(ink, 1),
        plot_dashes: dashes(ink, units_per_px),
    };
    Ink::all().into_iter().map(style).collect()
}

/// An entry of a legend.
#[derive(Clone, Debug, Serialize)]
pub struct Key {
    pub hex: String,
    pub opacity: f64,
    pub width: f64,
    /// True for a dot instead of a line.
    pub is_dot: bool,
    /// Name of the series.
    pub name: String,
}

impl Key {
    /// Creates the entry of an ink.
    pub fn new(ink: Ink, name: &str) -> Self {
        Self { hex: ink.hex(), opacity: ink.opacity, width: ink.width.max(1.5), is_dot: false, name: name.into() }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::Ink;

    #[test]
    fn the_style_sheet_can_tell_inks_apart() {
        let all = Ink::all();
        let distinct: BTreeSet<String> = all.iter().map(|ink| ink.hex()).collect();
        assert_eq!(distinct.len(), all.len());
    }
}
