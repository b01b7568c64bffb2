use nalgebra::DVector;

use crate::law::regression::{Design, LawRegression};
use crate::law::structure::{GaugeFamily, LawStructure};
use crate::order::median;

/// Residual, in robust standard deviations, beyond which the loss is linear instead of quadratic. Such laws are wrong by several deviations
/// for seconds, from which fits should learn; a contact that fails for a row is off by far more.
pub(crate) const HUBER: f64 = 5.0;
/// Number of fits of the preliminary law, each with weights from the one before.
const PASSES: usize = 4;
/// Ridge of the preliminary law, strong enough that no outlier has a regressor to itself.
const RIDGE: f64 = 0.03;
/// Standard deviation of a normal variable over the median of its absolute value.
const PER_MEDIAN: f64 = 1.482_602_218_505_602;

/// Returns a cubic gauge with two branches, which divide the range of time constants into thirds.
pub(crate) fn preliminary(regression: &LawRegression) -> LawStructure {
    let (low, high) = (regression.tau_bounds.0.ln(), regression.tau_bounds.1.ln());
    let third = (high - low) / 3.0;
    let nonlinear = vec![low + third, high - third];
    LawStructure { family: GaugeFamily::Polynomial, nonlinear, taus: 2, ridge: RIDGE }
}

/// Returns the residuals of the preliminary law over the median reading of each recording; `None` if there is no such law.
pub(crate) fn misfits(regression: &LawRegression) -> Option<DVector<f64>> {
    let (residual, rest_readings) = residuals(regression, &preliminary(regression).design(regression))?;
    Some(regression.in_readings(&residual, &rest_readings))
}

/// Returns the residuals of the preliminary law over R₀ of each recording, and those R₀.
fn residuals(regression: &LawRegression, design: &Design) -> Option<(DVector<f64>, Vec<f64>)> {
    let solution = regression.solve(design, RIDGE, None)?;
    let residual = regression.response(&solution.rest_readings) - design.fitted(&solution.weights);
    Some((residual, solution.rest_readings))
}

/// Returns the regression with Huber's weights, from the residuals of a preliminary law of two branches. All later fits to the recordings
/// use the same weights, so that they can be compared.
///
/// Source: Huber, *Ann. Math. Statist.* 35 (1964) 73.
pub(crate) fn robust(mut regression: LawRegression) -> LawRegression {
    let design = preliminary(&regression).design(&regression);
    for _ in 0..PASSES {
        // Without a preliminary law all rows have equal weight; later stages check that a law exists.
        let Some((residual, _)) = residuals(&regression, &design) else { return regression };
        let most = HUBER * PER_MEDIAN * median(residual.iter().map(|r| r.abs())).unwrap_or(0.0);
        if !(most > 0.0) {
            return regression;
        }
        regression.set_weights(residual.iter().map(|r| if r.abs() > most { most / r.abs() } else { 1.0 }));
    }
    regression
}
