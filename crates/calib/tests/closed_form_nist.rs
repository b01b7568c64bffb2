//! Certified regressions: parameters and standard deviations as published by NIST, from our own starts instead of the published ones.

use ohmstrain_calib::closed_form::{
    ClosedForm, ClosedFormFit, Datum, Extent, ModulusShape, Moment, Parameter, Search, SeparableLaw, Unit,
    fit_closed_form,
};

fn exponentials(of: ClosedForm) -> Box<dyn SeparableLaw> {
    of.law(ModulusShape::SINGLE, false, f64::NAN)
}

/// A dataset: rows of start 1, start 2, certified value and standard deviation, and the data.
struct Dataset {
    parameters: Vec<[f64; 4]>,
    residual_sum: f64,
    data: Vec<Datum>,
}

/// Reads a file in NIST's format.
fn read(text: &str) -> Dataset {
    let numbers = |text: &str| -> Vec<f64> { text.split_whitespace().map(|cell| cell.parse().unwrap()).collect() };
    let mut out = Dataset { parameters: Vec::new(), residual_sum: f64::NAN, data: Vec::new() };
    let mut in_data = false;
    for line in text.lines() {
        if let Some((name, values)) = line.split_once('=')
            && name.trim().strip_prefix('b').is_some_and(|index| index.parse::<u32>().is_ok())
        {
            out.parameters.push(numbers(values).try_into().unwrap());
        } else if let Some(sum) = line.strip_prefix("Residual Sum of Squares:") {
            out.residual_sum = sum.trim().parse().unwrap();
        } else if line.starts_with("Data:") && line.ends_with('x') {
            in_data = true;
        } else if in_data && !line.trim().is_empty() {
            let pair = numbers(line);
            let at = Moment { elapsed_s: pair[1], ..Moment::default() };
            out.data.push(Datum { at, reading: pair[0] });
        }
    }
    out
}

/// `b1 (1 - exp(-b2 x))`, the model of Misra1a and BoxBOD.
struct Saturation;

impl SeparableLaw for Saturation {
    fn linear(&self) -> Vec<Parameter> {
        vec![Parameter::new("b1", Unit::Reading)]
    }

    fn nonlinear(&self) -> Vec<Parameter> {
        vec![Parameter::new("b2", Unit::PerSecond)]
    }

    fn search(&self, extent: &Extent) -> Vec<Search> {
        extent.rates(1)
    }

    fn basis(&self, theta: &[f64], at: &Moment, values: &mut [f64], slopes: &mut [f64]) {
        values[0] = -(-theta[0] * at.elapsed_s).exp_m1();
        slopes[0] = at.elapsed_s * (-theta[0] * at.elapsed_s).exp();
    }
}

/// Converts a parameter to NIST's terms, with value and standard deviation. A time constant τ is a rate 1/τ there, with sd sd(τ)/τ².
fn rate(tau: (f64, f64)) -> (f64, f64) {
    (1.0 / tau.0, tau.1 / (tau.0 * tau.0))
}

fn parameter(fit: &ClosedFormFit, name: &str) -> (f64, f64) {
    let found = fit.get(name).unwrap();
    (found.value, found.standard_error.unwrap())
}

/// Compares `found` (values and standard deviations by NIST's number of the parameter) with the certified ones.
#[track_caller]
fn certified(dataset: &Dataset, residual_sum: f64, found: &[(f64, f64)], tolerance: f64, sum_tolerance: f64) {
    let close = |found: f64, certified: f64, tolerance: f64| {
        assert!((found - certified).abs() <= tolerance * certified.abs(), "{found:e} for {certified:e}");
    };
    assert_eq!(found.len(), dataset.parameters.len());
    for (found, certified) in found.iter().zip(&dataset.parameters) {
        close(found.0, certified[2], tolerance);
        close(found.1, certified[3], sum_tolerance);
    }
    close(residual_sum, dataset.residual_sum, sum_tolerance);
}

/// Half a unit in the eleventh digit, to which parameters and standard deviations are certified, and the same again for the optimiser.
const DIGITS: f64 = 1e-10;

/// Rounding of the readings, a fraction of 2.2e-16, is 1e-11 of Lanczos3's residuals and 1e-9 of Lanczos2's, and thus of the standard
/// deviations; parameters move by that fraction of their own. The tolerance is ten times that, for all sets.
const PARAMETER: f64 = 1e-8;

#[test]
fn saturations_are_certified() {
    for (text, rows) in [(include_str!("fixtures/nist/Misra1a.dat"), 14), (include_str!("fixtures/nist/BoxBOD.dat"), 6)]
    {
        let dataset = read(text);
        assert_eq!(dataset.data.len(), rows);
        let fit = fit_closed_form(&Saturation, &dataset.data).unwrap();
        let found = [parameter(&fit, "b1"), parameter(&fit, "b2")];
        certified(&dataset, fit.residual_sum, &found, PARAMETER, PARAMETER);
        assert!(fit.converged);
    }
}

#[test]
fn mgh17_is_certified() {
    let dataset = read(include_str!("fixtures/nist/MGH17.dat"));
    assert_eq!(dataset.data.len(), 33);
    let fit = fit_closed_form(exponentials(ClosedForm::Eq7 { terms: 2 }).as_ref(), &dataset.data).unwrap();
    // b4 < b5: the slow term is NIST's first.
    let found = [
        parameter(&fit, "e_inf"),
        parameter(&fit, "e2"),
        parameter(&fit, "e1"),
        rate(parameter(&fit, "tau2_s")),
        rate(parameter(&fit, "tau1_s")),
    ];
    certified(&dataset, fit.residual_sum, &found, PARAMETER, PARAMETER);
}

fn lanczos(text: &str, tolerance: f64, sum_tolerance: f64) {
    let dataset = read(text);
    assert_eq!(dataset.data.len(), 24);
    let fit = fit_closed_form(exponentials(ClosedForm::Eq5 { terms: 3 }).as_ref(), &dataset.data).unwrap();
    let term = |i: usize| [parameter(&fit, &format!("a{i}")), rate(parameter(&fit, &format!("tau{i}_s")))];
    // NIST's first term is the slowest.
    let found = [3, 2, 1].map(term).concat();
    certified(&dataset, fit.residual_sum, &found, tolerance, sum_tolerance);
}

#[test]
fn lanczos_3_is_certified() {
    lanczos(include_str!("fixtures/nist/Lanczos3.dat"), PARAMETER, PARAMETER);
}

#[test]
fn lanczos_2_is_certified() {
    lanczos(include_str!("fixtures/nist/Lanczos2.dat"), PARAMETER, PARAMETER);
}

/// Its residuals are 1e-13 of the readings, a few hundred units of rounding: parameters have all their digits, standard deviations about
/// two.
#[test]
fn lanczos_1_is_certified_as_far_as_doubles_go() {
    lanczos(include_str!("fixtures/nist/Lanczos1.dat"), DIGITS, 0.03);
}
