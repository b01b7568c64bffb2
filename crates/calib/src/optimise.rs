use std::cell::RefCell;

use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;

use crate::CalibrationError;

/// Nelder-Mead from `start` with a first simplex of side `step` in every direction, at most `iterations` steps; the best
/// point.
///
/// A cost that is not finite counts as very bad.
pub(crate) fn polish(
    cost: impl FnMut(&[f64]) -> f64,
    start: &[f64],
    step: f64,
    iterations: u64,
) -> Result<Vec<f64>, CalibrationError> {
    let mut simplex = vec![start.to_vec()];
    for i in 0..start.len() {
        let mut corner = start.to_vec();
        corner[i] += step;
        simplex.push(corner);
    }
    let failed = |error: argmin::core::Error| CalibrationError::Optimiser(error.to_string());
    let solver = NelderMead::new(simplex).with_sd_tolerance(1e-7).map_err(failed)?;
    let result = Executor::new(Problem { cost: RefCell::new(cost) }, solver)
        .configure(|state| state.max_iters(iterations))
        .run()
        .map_err(failed)?;
    Ok(result.state().get_best_param().cloned().unwrap_or_else(|| start.to_vec()))
}

/// Stands for a cost that cannot be computed.
const VERY_BAD: f64 = 1e9;

fn finite(cost: f64) -> f64 {
    if cost.is_finite() { cost } else { VERY_BAD }
}

/// The optimiser wants `&self`; a cost may count its calls.
struct Problem<F> {
    cost: RefCell<F>,
}

impl<F: FnMut(&[f64]) -> f64> CostFunction for Problem<F> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, point: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(finite((self.cost.borrow_mut())(point)))
    }
}
