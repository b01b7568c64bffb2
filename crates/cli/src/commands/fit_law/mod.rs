//! `fit-law`: closed-form laws fitted to the segments of recordings.

mod compare;
mod figures;
mod output;
mod pieces;
mod published;
mod rows;

use ohmstrain::trace::TraceFile;
use ohmstrain_bench_data::ReadingKind;
use ohmstrain_calib::closed_form::{ClosedForm, ClosedFormFit, ModulusShape, fit_closed_form};

use crate::args::{FitLawArgs, RestResistance, phase_name};
use crate::error::CliError;
use crate::input;
use crate::messages::Messages;
use crate::run::median_of_first;
use pieces::{Piece, pieces};

/// A fitted piece of a recording.
pub struct Fitted {
    /// Piece of the recording that was fitted.
    pub piece: Piece,
    /// The fit.
    pub fit: ClosedFormFit,
}

/// A recording and the laws fitted to it.
pub struct Fits {
    /// Name in messages.
    pub name: String,
    /// Material, from the metadata.
    pub material: Option<String>,
    /// Length of the unstretched sensor, mm, if the metadata contain it.
    pub gauge_length_mm: Option<f64>,
    /// Unit of the readings, `1` for a ratio.
    pub reading_unit: &'static str,
    /// Unit of the reference, `1` for strain.
    pub strain_unit: &'static str,
    /// The fits in the order of their times.
    pub fits: Vec<Fitted>,
}

/// Speeds that differ by more than this share of the largest count as different.
pub const SAME_SPEED: f64 = 0.1;

/// Fits the law to the chosen segments of each recording.
pub fn run(args: &FitLawArgs, messages: &Messages) -> Result<(), CliError> {
    if args.modulus.is_some() && !args.law.has_modulus() {
        return Err(CliError::Arguments(format!("--modulus is for eq8, eq9 and eq8+eq9, not for {}", args.law)));
    }
    let overrides = args.units.metadata();
    let read = |path: &std::path::PathBuf| input::read(path, &overrides);
    let recordings: Vec<TraceFile> = args.traces.iter().map(read).collect::<Result<_, _>>()?;
    if !args.compare.is_empty() {
        return compare::compare(&recordings, args, messages);
    }
    let fits: Vec<Fits> =
        recordings.iter().map(|recording| fit_recording(recording, args, messages)).collect::<Result<_, _>>()?;
    fits.iter().for_each(|fits| output::warn(fits, "", messages));
    if args.table {
        published::warn(&fits, messages);
    }
    args.figures.as_deref().map_or(Ok(()), |folder| figures::put(folder, &fits, args.replace.force))?;
    if args.json {
        output::json(&fits, args)
    } else if args.table {
        published::table(&fits).print(args.format)
    } else {
        output::table(&fits).print(args.format)
    }
}

fn fit_recording(recording: &TraceFile, args: &FitLawArgs, messages: &Messages) -> Result<Fits, CliError> {
    let trace = &recording.trace;
    let rest_reading = match args.rest_resistance {
        RestResistance::Value(value) => value,
        RestResistance::Calibrated => {
            let message = "--rest-resistance: expected a positive number or first:N, as there is no calibration";
            return Err(CliError::Arguments(message.into()));
        }
        RestResistance::First(count) => median_of_first(count, trace.readings.values.iter().copied(), &recording.name)?,
    };
    let mut pieces = pieces(recording, args)?;
    if args.pool {
        pieces = pooled(pieces);
    }
    let modulus = args.modulus.unwrap_or(ModulusShape::SINGLE);
    let mut fits = Vec::new();
    let mut refused = Vec::new();
    for piece in pieces {
        let law = piece.law.law(modulus, has_several_speeds(&piece), rest_reading);
        match fit_closed_form(law.as_ref(), &piece.data) {
            Ok(fit) => fits.push(Fitted { piece, fit }),
            Err(error) => refused.push(format!("{}: {}: {error}", recording.name, piece.label)),
        }
    }
    if fits.is_empty() {
        return Err(CliError::Input(refused.swap_remove(0)));
    }
    for message in refused {
        messages.remark(&format!("{message}: not fitted"));
    }
    Ok(Fits {
        name: recording.name.clone(),
        material: trace.metadata.material.clone(),
        gauge_length_mm: trace.metadata.gauge_length_mm,
        reading_unit: if trace.readings.kind == ReadingKind::Ohm { "ohm" } else { "1" },
        strain_unit: match recording.quantity() {
            Some(ohmstrain_sensor::Quantity::AngleDeg) => "deg",
            _ => "1",
        },
        fits,
    })
}

/// Joins pieces of the same law and phase.
fn pooled(pieces: Vec<Piece>) -> Vec<Piece> {
    let mut out: Vec<Piece> = Vec::new();
    for piece in pieces {
        match out.iter_mut().find(|other| (other.law, other.phase) == (piece.law, piece.phase)) {
            Some(other) => other.join(piece),
            None => out.push(piece),
        }
    }
    out
}

fn has_several_speeds(piece: &Piece) -> bool {
    let speeds = || piece.data.iter().map(|datum| datum.at.rate.abs());
    let (low, high) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
    matches!(piece.law, ClosedForm::Eq8 | ClosedForm::Eq8And9) && high - low > SAME_SPEED * high
}

/// Returns the name of a piece's phase in the output.
fn phase_of(piece: &Piece) -> &'static str {
    piece.phase.map_or("whole", phase_name)
}
