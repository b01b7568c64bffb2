//! Several laws on the same segments, by what Akaike's and the Bayesian criterion say of them.

use std::collections::BTreeSet;

use super::rows::{Cell, Rows};
use super::{Fits, fit_recording, output};
use crate::args::FitLawArgs;
use crate::error::CliError;
use crate::input::Recording;
use ohmstrain::number::{fixed, significant};

/// One row per segment and law, the best of a segment first.
pub fn compare(recordings: &[Recording], args: &FitLawArgs) -> Result<(), CliError> {
    let (mut rows, mut units) = (Vec::new(), BTreeSet::new());
    for recording in recordings {
        let mut tried: Vec<(String, Fits)> = Vec::new();
        for law in &args.compare {
            let own = FitLawArgs { law: *law, compare: vec![], ..args.clone() };
            tried.push((law.to_string(), fit_recording(recording, &own)?));
        }
        units.extend(tried.iter().map(|(_, fits)| fits.reading_unit));
        tried.iter().for_each(|(law, fits)| output::warn_of_law(fits, law));
        rows.extend(rows_of(&tried)?);
    }
    let unit = units.first().filter(|unit| units.len() == 1 && **unit != "1");
    let left = unit.map_or("residual sd".to_owned(), |unit| format!("residual sd, {unit}"));
    let header = ["recording", "segment", "law", "parameters", "R^2", &left, "ΔAICc", "ΔBIC", "neighbours"];
    Rows { keys: 3, header: header.map(String::from).to_vec(), rows }.print(args.format)
}

fn rows_of(tried: &[(String, Fits)]) -> Result<Vec<Vec<Cell>>, CliError> {
    let mut labels: Vec<&str> = vec![];
    for fitted in tried.iter().flat_map(|(_, fits)| &fits.fits) {
        if !labels.contains(&fitted.piece.label.as_str()) {
            labels.push(&fitted.piece.label);
        }
    }
    let (mut rows, mut most) = (Vec::new(), 0);
    for label in &labels {
        let of_law = |(law, fits): &'_ (String, Fits)| {
            let found = fits.fits.iter().position(|fitted| fitted.piece.label == **label)?;
            Some((law.clone(), found))
        };
        let mut own: Vec<(String, &Fits, usize)> =
            tried.iter().filter_map(|one| of_law(one).map(|(law, at)| (law, &one.1, at))).collect();
        let fit = |one: &(String, &Fits, usize)| one.1.fits[one.2].fit.clone();
        if own.iter().any(|one| fit(one).readings != fit(&own[0]).readings) {
            return Err(of_several_phases(label));
        }
        most = most.max(own.len());
        own.sort_by(|a, b| fit(a).aicc.total_cmp(&fit(b).aicc));
        let least = |of: fn(&ohmstrain_calib::closed_form::ClosedFormFit) -> f64| {
            own.iter().map(|one| of(&fit(one))).fold(f64::INFINITY, f64::min)
        };
        let (aicc, bic) = (least(|fit| fit.aicc), least(|fit| fit.bic));
        for one in &own {
            let fitted = fit(one);
            let number = |value: f64, decimals| Cell::Number(value, fixed(value, decimals));
            rows.push(vec![
                one.1.name.clone().into(),
                (*label).to_owned().into(),
                one.0.clone().into(),
                fitted.parameters.len().to_string().into(),
                number(fitted.r_squared, 5),
                Cell::Number(fitted.residual_sd, significant(fitted.residual_sd, 3)),
                number(fitted.aicc - aicc, 1),
                number(fitted.bic - bic, 1),
                number(fitted.residual_autocorrelation, 2),
            ]);
        }
    }
    if most < tried.len().min(2) {
        return Err(of_several_phases("all segments"));
    }
    Ok(rows)
}

fn of_several_phases(label: &str) -> CliError {
    CliError::Arguments(format!(
        "--compare: {label}: the laws are about different readings, and their criteria cannot be compared; choose laws of \
         one phase"
    ))
}
