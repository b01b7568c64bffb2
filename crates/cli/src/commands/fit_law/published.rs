use ohmstrain_calib::closed_form::{ClosedForm, Datum, Estimated};
use ohmstrain_model::Phase;

use super::rows::{Cell, LawTable};
use super::{Fits, Fitted, SAME_SPEED, output};
use crate::messages::Messages;
use ohmstrain::number::{fixed, plain};

/// Contribution of one phase of one fit.
struct Entry<'a> {
    material: &'a str,
    speed: Option<f64>,
    phase: &'static str,
    fitted: &'a Fitted,
    r_squared: f64,
}

/// Order of the phases in the table.
const PHASES: [&str; 5] = ["extend", "hold", "retract", "rest", "whole"];

/// Returns a table with one row per material, speed and phase.
pub fn table(recordings: &[Fits]) -> LawTable {
    let in_mm = recordings.iter().all(|recording| recording.gauge_length_mm.is_some());
    let mut entries: Vec<Entry> = recordings.iter().flat_map(|recording| entries(recording, in_mm)).collect();
    let order = |entry: &Entry| PHASES.iter().position(|phase| *phase == entry.phase);
    let speed = |entry: &Entry| entry.speed.unwrap_or(f64::INFINITY);
    entries.sort_by(|a, b| a.material.cmp(b.material).then(speed(a).total_cmp(&speed(b))));
    let names = output::names(entries.iter().map(|entry| entry.fitted));
    let unit = if in_mm { "speed, mm/s" } else { "speed, 1/s" };
    let header = ["material", unit, "phase", "segments"].map(String::from).into_iter();
    let fits = recordings.iter().flat_map(|recording| recording.fits.iter().map(move |fitted| (recording, fitted)));
    let header = header.chain(output::with_units(&names, fits)).chain(["R^2".into()]).collect();
    let mut rows = Vec::new();
    for group in entries.chunk_by_mut(|a, b| a.material == b.material && is_same_speed(a.speed, b.speed)) {
        group.sort_by_key(order);
        for phase in group.chunk_by(|a, b| a.phase == b.phase) {
            rows.push(row(phase, &names));
        }
    }
    LawTable { keys: 3, header, rows }
}

/// Warns of a phase that a law does not describe, although it describes both phases together.
pub fn warn(recordings: &[Fits], messages: &Messages) {
    for recording in recordings {
        for entry in entries(recording, false) {
            let (together, alone) = (entry.fitted.fit.r_squared, entry.r_squared);
            if alone < output::POOR && together >= output::POOR {
                let (name, label, phase) = (&recording.name, &entry.fitted.piece.label, entry.phase);
                messages.warning(&format!(
                    "{name}: {label}: R^2 of the {phase} by itself is {alone:.2}: the law hardly describes it"
                ));
            }
        }
    }
}

/// True if two neighbours in the order of speeds count as equally fast.
fn is_same_speed(a: Option<f64>, b: Option<f64>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => b - a <= SAME_SPEED * b,
        (a, b) => a.is_none() && b.is_none(),
    }
}

/// Returns the entries of all fits; a movement and its hold are two entries of one fit.
fn entries(recording: &Fits, in_mm: bool) -> Vec<Entry<'_>> {
    let scale = recording.gauge_length_mm.filter(|_| in_mm).unwrap_or(1.0);
    let mut out = Vec::new();
    for fitted in &recording.fits {
        let piece = &fitted.piece;
        let (moving, held) = match (piece.phase, piece.after) {
            (Some(Phase::Extend), _) => (Some("extend"), "hold"),
            (Some(Phase::Retract), _) => (Some("retract"), "rest"),
            (Some(Phase::Hold), Some(Phase::Retract)) => (None, "rest"),
            (Some(Phase::Hold), _) => (None, "hold"),
            (None, _) => (None, "whole"),
        };
        let is_pair = piece.law == ClosedForm::Eq8And9;
        let mut push = |phase, is_in: &dyn Fn(&Datum) -> bool| {
            out.push(Entry {
                material: recording.material.as_deref().unwrap_or_else(|| file_name(&recording.name)),
                speed: piece.speed_per_s.map(|speed| speed * scale),
                phase,
                fitted,
                r_squared: r_squared(fitted, is_in),
            });
        };
        if let Some(moving) = moving {
            push(moving, &|datum| datum.at.before.is_none());
        }
        if is_pair || moving.is_none() {
            push(held, &|datum| !is_pair || datum.at.before.is_some());
        }
    }
    out
}

/// Returns the name of the file, which replaces the material if that is unknown.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Returns R² of the readings of one phase about their own mean.
fn r_squared(fitted: &Fitted, is_in: impl Fn(&Datum) -> bool) -> f64 {
    let both = || fitted.piece.data.iter().zip(&fitted.fit.residuals).filter(|(datum, _)| is_in(datum));
    let n = both().count() as f64;
    let mean = both().map(|(datum, _)| datum.reading).sum::<f64>() / n;
    let about_mean: f64 = both().map(|(datum, _)| (datum.reading - mean).powi(2)).sum();
    1.0 - both().map(|(_, residual)| residual * residual).sum::<f64>() / about_mean
}

/// True if a parameter is shown for a phase: the hold's own in its row, time constants and shares in both.
fn belongs(name: &str, phase: &str) -> bool {
    let of_hold = ["r0_hold", "r1_hold", "r_start", "r_settled"].iter().any(|start| name.starts_with(start));
    let of_movement = name == "r0"
        || name == "r1"
        || name == "eta"
        || name == "v*eta+r1"
        || ["r0*", "r0/"].iter().any(|start| name.starts_with(start));
    match phase {
        "extend" | "retract" => !of_hold,
        _ => !of_movement,
    }
}

/// Returns the means over the fits of a group, with their standard errors.
fn row(group: &[Entry], names: &[String]) -> Vec<Cell> {
    let first = &group[0];
    let speeds: Vec<f64> = group.iter().filter_map(|entry| entry.speed).collect();
    let mean_speed = speeds.iter().sum::<f64>() / speeds.len() as f64;
    let speed = if speeds.is_empty() { Cell::Nothing } else { Cell::Number(mean_speed, plain(mean_speed)) };
    let text = |text: &str| Cell::from(text.to_owned());
    let mut out = vec![text(first.material), speed, text(first.phase), text(&group.len().to_string())];
    for name in names {
        let is_here = belongs(name, first.phase);
        let own: Vec<&Estimated> =
            group.iter().filter_map(|entry| entry.fitted.fit.get(name).filter(|_| is_here)).collect();
        let determined: Vec<(f64, f64)> =
            own.iter().filter_map(|estimated| Some((estimated.value, estimated.standard_error?))).collect();
        out.push(if determined.is_empty() && !own.is_empty() { Cell::NotIdentified } else { mean(&determined) });
    }
    let worst = group.iter().map(|entry| entry.r_squared).fold(f64::INFINITY, f64::min);
    out.push(Cell::Number(worst, fixed(worst, 4)));
    out
}

/// Returns the mean of values with its standard error: the fit's own for one value, else from the scatter.
fn mean(found: &[(f64, f64)]) -> Cell {
    match found {
        [] => Cell::Nothing,
        [(value, error)] => Cell::Estimate(*value, *error),
        _ => {
            let n = found.len() as f64;
            let mean = found.iter().map(|(value, _)| value).sum::<f64>() / n;
            let squares: f64 = found.iter().map(|(value, _)| (value - mean).powi(2)).sum();
            Cell::Estimate(mean, (squares / (n - 1.0) / n).sqrt())
        }
    }
}
