//! Comparison of several laws on the same segments, by Akaike's and the Bayesian criterion.

use ohmstrain::trace::TraceFile;
use serde::Serialize;

use super::rows::{Cell, LawTable};
use super::{Fits, Fitted, fit_recording, output};
use crate::args::FitLawArgs;
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::{json, print};
use ohmstrain::number::{fixed, significant};

/// Version of the output of `--json`.
const SCHEMA: u32 = 1;

/// Content of the output of `--json`.
#[derive(Serialize)]
struct Json<'a> {
    ranked: &'a [Ranked],
}

/// Criteria of a law on a segment.
#[derive(Serialize)]
struct Ranked {
    recording: String,
    segment: String,
    law: String,
    parameters: usize,
    r2: f64,
    residual_sd: f64,
    unit: &'static str,
    aicc: f64,
    bic: f64,
    /// Difference from the smallest AICc of the segment.
    delta_aicc: f64,
    delta_bic: f64,
    residual_autocorrelation: f64,
}

/// Prints one row per segment and law, the best law of a segment first.
pub fn compare(recordings: &[TraceFile], args: &FitLawArgs, messages: &Messages) -> Result<(), CliError> {
    let mut ranked = Vec::new();
    for recording in recordings {
        let mut tried: Vec<(String, Fits)> = Vec::new();
        for law in &args.compare {
            let own = FitLawArgs { law: *law, compare: vec![], ..args.clone() };
            tried.push((law.to_string(), fit_recording(recording, &own, messages)?));
        }
        tried.iter().for_each(|(law, fits)| output::warn(fits, &format!("{law}: "), messages));
        ranked.extend(rank(&tried)?);
    }
    if args.json {
        print(|out| json(out, SCHEMA, &Json { ranked: &ranked }))
    } else {
        table(&ranked).print(args.format)
    }
}

fn table(ranked: &[Ranked]) -> LawTable {
    let unit = ranked.first().map(|first| first.unit);
    let unit = unit.filter(|unit| *unit != "1" && ranked.iter().all(|one| one.unit == *unit));
    let left = unit.map_or("residual sd".to_owned(), |unit| format!("residual sd, {unit}"));
    let header = ["recording", "segment", "law", "parameters", "R^2", &left, "ΔAICc", "ΔBIC", "neighbours"];
    let number = |value: f64, decimals| Cell::Number(value, fixed(value, decimals));
    let row = |one: &Ranked| -> Vec<Cell> {
        vec![
            one.recording.clone().into(),
            one.segment.clone().into(),
            one.law.clone().into(),
            one.parameters.to_string().into(),
            number(one.r2, 5),
            Cell::Number(one.residual_sd, significant(one.residual_sd, 3)),
            number(one.delta_aicc, 1),
            number(one.delta_bic, 1),
            number(one.residual_autocorrelation, 2),
        ]
    };
    LawTable { keys: 3, header: header.map(String::from).to_vec(), rows: ranked.iter().map(row).collect() }
}

fn rank(tried: &[(String, Fits)]) -> Result<Vec<Ranked>, CliError> {
    let mut labels: Vec<&str> = vec![];
    for fitted in tried.iter().flat_map(|(_, fits)| &fits.fits) {
        if !labels.contains(&fitted.piece.label.as_str()) {
            labels.push(&fitted.piece.label);
        }
    }
    let (mut ranked, mut most) = (Vec::new(), 0);
    for label in &labels {
        let of_law = |(law, fits): &'_ (String, Fits)| {
            let Fitted { fit, .. } = fits.fits.iter().find(|fitted| fitted.piece.label == **label)?;
            let one = Ranked {
                recording: fits.name.clone(),
                segment: (*label).to_owned(),
                law: law.clone(),
                parameters: fit.parameters.len(),
                r2: fit.r_squared,
                residual_sd: fit.residual_sd,
                unit: fits.reading_unit,
                aicc: fit.aicc,
                bic: fit.bic,
                delta_aicc: fit.aicc,
                delta_bic: fit.bic,
                residual_autocorrelation: fit.residual_autocorrelation,
            };
            Some((fit.readings, one))
        };
        let (readings, mut own): (Vec<usize>, Vec<Ranked>) = tried.iter().filter_map(of_law).unzip();
        if readings.iter().any(|count| *count != readings[0]) {
            return Err(of_several_phases(label));
        }
        most = most.max(own.len());
        own.sort_by(|a, b| a.aicc.total_cmp(&b.aicc));
        let least = |of: fn(&Ranked) -> f64| own.iter().map(of).fold(f64::INFINITY, f64::min);
        let (aicc, bic) = (least(|one| one.aicc), least(|one| one.bic));
        for one in &mut own {
            one.delta_aicc -= aicc;
            one.delta_bic -= bic;
        }
        ranked.extend(own);
    }
    if most < tried.len().min(2) {
        return Err(of_several_phases("all segments"));
    }
    Ok(ranked)
}

fn of_several_phases(label: &str) -> CliError {
    CliError::Arguments(format!(
        "--compare: {label}: the laws are about different readings, and their criteria cannot be compared; choose laws of \
         one phase"
    ))
}
