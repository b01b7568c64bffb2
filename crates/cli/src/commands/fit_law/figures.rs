//! A figure per fit: readings, law and residuals.

use std::path::Path;

use super::{Fits, Fitted};
use crate::commands::reporting::put_figures;
use crate::error::CliError;
use crate::output::Outputs;
use ohmstrain::MADE_BY;
use ohmstrain_report::{Axis, Chart, Ink, ReportError, WIDE, files, slug};

/// Writes the figures of all fits into a folder.
pub fn put(folder: &Path, recordings: &[Fits], force: bool) -> Result<(), CliError> {
    let mut outputs = Outputs::new(force, &[]);
    outputs.folder(folder)?;
    let fits = recordings.iter().flat_map(|recording| recording.fits.iter().map(move |fitted| (recording, fitted)));
    let drawn: Result<Vec<_>, ReportError> = fits
        .enumerate()
        .map(|(place, (recording, fitted))| {
            let title = format!("{} {}", fitted.piece.law, fitted.piece.label);
            // Pieces of different recordings may have the same name.
            let name = format!("{:02}-{}", place + 1, slug(&title));
            files(&chart(recording, fitted), &title, &name, MADE_BY)
        })
        .collect();
    put_figures(folder, drawn.map_err(|error| CliError::Other(error.to_string()))?, &mut outputs)?;
    outputs.publish()
}

fn chart(recording: &Fits, Fitted { piece, fit }: &Fitted) -> Chart {
    // Times of a hold continue those of its movement.
    let time = |datum: &ohmstrain_calib::closed_form::Datum| {
        let before_s = datum.at.before.filter(|_| piece.phase != Some(ohmstrain_model::Phase::Hold));
        datum.at.elapsed_s + before_s.map_or(0.0, |before| before.duration_s)
    };
    let points: Vec<(f64, f64, f64)> = piece
        .data
        .iter()
        .zip(&fit.residuals)
        .map(|(datum, left)| (time(datum), datum.reading, datum.reading - left))
        .collect();
    let label = if recording.reading_unit == "ohm" { "Resistance, Ω" } else { "Resistance ratio" };
    let x = Axis::holding("Time since the segment began, s", points.iter().map(|point| point.0), 10);
    let y = Axis::holding(label, points.iter().flat_map(|point| [point.1, point.2]), 6);
    let mut chart = Chart::new(WIDE, x, y);
    chart.dots(Ink::DOTS, "recorded", points.iter().map(|point| (point.0, point.1)));
    chart.line(
        Ink::CURVE,
        &format!("{}, R² {:.4}", piece.law, fit.r_squared),
        points.iter().map(|point| (point.0, point.2)),
    );
    chart
}
