use std::collections::BTreeSet;

use ohmstrain_calib::closed_form::{Estimated, ModulusShape};
use serde::Serialize;

use super::rows::{Cell, LawTable};
use super::{Fits, Fitted, phase_of};
use crate::args::FitLawArgs;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::{self, print};
use ohmstrain::number::plain;

/// Version of the output of `--json`.
const SCHEMA: u32 = 1;

/// Content of the output of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    fits: Vec<FitReport<'a>>,
}

#[derive(Serialize)]
struct FitReport<'a> {
    recording: &'a str,
    material: Option<&'a str>,
    segment: &'a str,
    phase: &'static str,
    law: String,
    /// Shape of the modulus in equations 8 and 9.
    modulus: Option<String>,
    from_s: f64,
    until_s: f64,
    speed_per_s: Option<f64>,
    n: usize,
    parameters: Vec<ParameterReport<'a>>,
    derived: Vec<ParameterReport<'a>>,
    r2: f64,
    aic: f64,
    aicc: f64,
    bic: f64,
    residual_sd: f64,
    residual_autocorrelation: f64,
    condition: f64,
    converged: bool,
}

#[derive(Serialize)]
struct ParameterReport<'a> {
    name: &'a str,
    value: f64,
    standard_error: Option<f64>,
    unit: String,
    at_limit: bool,
}

/// Prints all results as JSON.
pub fn json(recordings: &[Fits], args: &FitLawArgs) -> Result<(), CliError> {
    let of = |recording| move |fitted| fit_report(recording, fitted, args);
    let fits = recordings.iter().flat_map(|recording| recording.fits.iter().map(of(recording))).collect();
    print(|out| output::json(out, SCHEMA, &Report { fits }))
}

fn fit_report<'a>(recording: &'a Fits, Fitted { piece, fit }: &'a Fitted, args: &FitLawArgs) -> FitReport<'a> {
    let report = |estimated: &'a Estimated| ParameterReport {
        name: &estimated.parameter.name,
        value: estimated.value,
        standard_error: estimated.standard_error,
        unit: estimated.parameter.unit.text(recording.reading_unit, recording.strain_unit),
        at_limit: estimated.at_limit,
    };
    FitReport {
        recording: &recording.name,
        material: recording.material.as_deref(),
        segment: &piece.label,
        phase: phase_of(piece),
        law: piece.law.to_string(),
        modulus: piece.law.has_modulus().then(|| args.modulus.unwrap_or(ModulusShape::SINGLE).to_string()),
        from_s: piece.from_s,
        until_s: piece.until_s,
        speed_per_s: piece.speed_per_s,
        n: fit.readings,
        parameters: fit.parameters.iter().map(report).collect(),
        derived: fit.derived.iter().map(report).collect(),
        r2: fit.r_squared,
        aic: fit.aic,
        aicc: fit.aicc,
        bic: fit.bic,
        residual_sd: fit.residual_sd,
        residual_autocorrelation: fit.residual_autocorrelation,
        condition: fit.condition,
        converged: fit.converged,
    }
}

/// Returns a table with one row per fit.
pub fn table(recordings: &[Fits]) -> LawTable {
    let fits = || recordings.iter().flat_map(|recording| recording.fits.iter().map(move |fitted| (recording, fitted)));
    let names = names(fits().map(|(_, fitted)| fitted));
    let header = ["recording", "segment", "speed, 1/s"].map(String::from).into_iter();
    let quality = ["R^2", "AIC", "n", "neighbours"].map(String::from);
    let header = header.chain(with_units(&names, fits())).chain(quality).collect();
    let row = |(recording, Fitted { piece, fit }): (&Fits, &Fitted)| {
        let speed = piece.speed_per_s.map_or(Cell::Nothing, |speed| Cell::Number(speed, plain(speed)));
        let mut row: Vec<Cell> = vec![recording.name.clone().into(), piece.label.clone().into(), speed];
        row.extend(names.iter().map(|name| Cell::of(fit.get(name))));
        row.extend([
            Cell::Number(fit.r_squared, format!("{:.5}", fit.r_squared)),
            Cell::Number(fit.aic, format!("{:.1}", fit.aic)),
            Cell::from(fit.readings.to_string()),
            Cell::Number(fit.residual_autocorrelation, format!("{:.2}", fit.residual_autocorrelation)),
        ]);
        row
    };
    let rows = fits().map(row).collect();
    LawTable { keys: 2, header, rows }
}

/// Returns the names of all parameters and derived quantities, each once.
pub fn names<'a>(fits: impl Iterator<Item = &'a Fitted>) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for fitted in fits {
        for estimated in fitted.fit.parameters.iter().chain(&fitted.fit.derived) {
            if !out.contains(&estimated.parameter.name) {
                out.push(estimated.parameter.name.clone());
            }
        }
    }
    out
}

/// Returns names with the units of their values; no unit if recordings differ in it, or if the name contains it.
pub fn with_units<'a>(names: &[String], fits: impl Iterator<Item = (&'a Fits, &'a Fitted)> + Clone) -> Vec<String> {
    let of = |name: &String| {
        let units: BTreeSet<String> = fits
            .clone()
            .filter_map(|(recording, fitted)| Some((recording, fitted.fit.get(name)?)))
            .map(|(recording, found)| found.parameter.unit.text(recording.reading_unit, recording.strain_unit))
            .collect();
        match units.first() {
            Some(unit) if units.len() == 1 && unit != "1" && !name.ends_with(&format!("_{unit}")) => {
                format!("{name}, {unit}")
            }
            _ => name.clone(),
        }
    };
    names.iter().map(of).collect()
}

/// R² below which a law hardly describes a segment.
pub const POOR: f64 = 0.9;
/// Number of segments with a warning of their own; further ones are only counted.
const MOST_WARNED: usize = 6;

/// Warns of fits that are poor, did not converge, or end at a limit of the search; `law` precedes the text of each.
pub fn warn(recording: &Fits, law: &str, messages: &Messages) {
    let name = &recording.name;
    let doubts: Vec<(&str, Vec<String>)> =
        recording.fits.iter().map(doubts).filter(|(_, doubts)| !doubts.is_empty()).collect();
    if doubts.len() <= MOST_WARNED {
        for (label, doubts) in doubts {
            messages.warning(&format!("{name}: {law}{label}: {}", doubts.join("; ")));
        }
        return;
    }
    let all = recording.fits.len();
    let fits = || recording.fits.iter().map(|fitted| &fitted.fit);
    let poor: Vec<f64> = fits().map(|fit| fit.r_squared).filter(|r_squared| *r_squared < POOR).collect();
    if !poor.is_empty() {
        let (count, worst) = (poor.len(), poor.iter().fold(f64::INFINITY, |worst, found| worst.min(*found)));
        messages.warning(&format!(
            "{name}: {law}R^2 is below {POOR} in {count} of {all} segments, {worst:.2} at worst: the law hardly describes them"
        ));
    }
    let unfinished = fits().filter(|fit| !fit.converged).count();
    if unfinished > 0 {
        messages.warning(&format!("{name}: {law}the search has not converged in {unfinished} of {all} segments"));
    }
    for parameter in names(recording.fits.iter()) {
        let count = fits().filter(|fit| fit.get(&parameter).is_some_and(|found| found.at_limit)).count();
        if count > 0 {
            messages.warning(&format!(
                "{name}: {law}{parameter} at the limit of the search in {count} of {all} segments: their readings ask for more"
            ));
        }
    }
}

/// Returns the name of a fit's segment and the doubts about the fit.
fn doubts(Fitted { piece, fit }: &Fitted) -> (&str, Vec<String>) {
    let mut doubts = Vec::new();
    if fit.r_squared < POOR {
        doubts.push(format!("R^2 is {:.2}: the law hardly describes it", fit.r_squared));
    }
    if !fit.converged {
        doubts.push("the search has not converged".into());
    }
    let at_limit = fit.parameters.iter().filter(|found| found.at_limit);
    let at_limit: Vec<&str> = at_limit.map(|found| found.parameter.name.as_str()).collect();
    if !at_limit.is_empty() {
        doubts.push(format!("{} stopped at the bound of the search", at_limit.join(", ")));
    }
    (&piece.label, doubts)
}
