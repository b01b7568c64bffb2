use nalgebra::Cholesky;

use crate::CalibrationError;
use crate::law::regression::LawRegression;
use crate::law::structure::LawStructure;
use crate::law::uncertainty::Linearised;
use ohmstrain_sensor::LawParams;

/// Ridge that only keeps indistinguishable columns from making the equations singular: a parameter with a standard error below a thousandth
/// of the response's spread moves by less than a thousandth of it.
const NUMERICAL_RIDGE: f64 = 1e-8;
/// Largest number of Gauss-Newton steps, and the change of a nonlinear parameter below which they stop.
const MOST_STEPS: usize = 30;
const TOLERANCE: f64 = 1e-6;
/// Number of times a step is halved.
const HALVINGS: usize = 12;

/// Fits the structure of `law` by least squares without the ridge, time constants within their bounds.
///
/// The ridge helps the filter but biases the parameters. Only the fit without it shows what the recording says about them, and how
/// certainly.
pub(crate) fn without_ridge(law: &LawParams, regression: &LawRegression) -> Result<LawStructure, CalibrationError> {
    settle(LawStructure::of_law(law, regression.scale.span, NUMERICAL_RIDGE), regression)
}

/// Fits by least squares, starting from a structure.
pub(crate) fn settle(
    mut structure: LawStructure,
    regression: &LawRegression,
) -> Result<LawStructure, CalibrationError> {
    keep_within_bounds(&mut structure, regression);
    for _ in 0..MOST_STEPS {
        let mut fit = Linearised::new(&structure, regression)?;
        let error = regression.in_readings(&fit.residual, fit.rest_readings()).norm_squared();
        let step = step(&mut fit, &structure, regression)?;
        let Some(next) = descend(&structure, regression, &step, error) else { break };
        let moved = |(a, b): (&f64, &f64)| (a - b).abs();
        let change = structure.nonlinear.iter().zip(&next.nonlinear).map(moved).fold(0.0, f64::max);
        structure = next;
        if change < TOLERANCE {
            break;
        }
    }
    structure.sort_branches();
    Ok(structure)
}

/// Returns the Gauss-Newton step of the nonlinear parameters. A time constant that would move beyond its bound is left out, because the
/// step of the others assumes that it moves.
fn step(
    fit: &mut Linearised,
    structure: &LawStructure,
    regression: &LawRegression,
) -> Result<Vec<f64>, CalibrationError> {
    loop {
        let factor = Cholesky::new(fit.normal()).ok_or(CalibrationError::Singular)?;
        let all = factor.solve(&fit.jacobian.tr_mul(&fit.residual));
        let first = all.len() - structure.nonlinear.len();
        let step: Vec<f64> = all.iter().skip(first).copied().collect();
        let mut moved = structure.clone();
        moved.nonlinear.iter_mut().zip(&step).for_each(|(x, step)| *x += step);
        keep_within_bounds(&mut moved, regression);
        let pressed = |j: &usize| step[*j] != 0.0 && moved.nonlinear[*j] == structure.nonlinear[*j];
        let Some(j) = (0..structure.taus).find(pressed) else { return Ok(step) };
        fit.jacobian.column_mut(first + j).fill(0.0);
    }
}

/// Returns the result of the longest halved step that lowers the squared error.
fn descend(structure: &LawStructure, regression: &LawRegression, step: &[f64], error: f64) -> Option<LawStructure> {
    // The linearisation does not hold for steps of more than one in ln τ.
    let longest = step.iter().fold(0.0, |longest: f64, x| longest.max(x.abs()));
    let mut share = if longest > 1.0 { 1.0 / longest } else { 1.0 };
    for _ in 0..HALVINGS {
        let mut next = structure.clone();
        for (x, step) in next.nonlinear.iter_mut().zip(step) {
            *x += share * step;
        }
        keep_within_bounds(&mut next, regression);
        if squared_error(&next, regression).is_some_and(|squares| squares < error) {
            return Some(next);
        }
        share *= 0.5;
    }
    None
}

fn keep_within_bounds(structure: &mut LawStructure, regression: &LawRegression) {
    let (low, high) = (regression.tau_bounds.0.ln(), regression.tau_bounds.1.ln());
    for ln_tau in &mut structure.nonlinear[..structure.taus] {
        *ln_tau = ln_tau.max(low).min(high);
    }
}

/// Returns the squared error in the unit of the readings. Relative to R₀, which is fitted too, the error could shrink simply because R₀
/// rises.
fn squared_error(structure: &LawStructure, regression: &LawRegression) -> Option<f64> {
    let design = structure.design(regression);
    let solution = regression.solve(&design, structure.ridge, None)?;
    let residual = regression.response(&solution.rest_readings) - design.fitted(&solution.weights);
    let residual = residual.component_mul(&regression.root_weights());
    Some(regression.in_readings(&residual, &solution.rest_readings).norm_squared())
}
