use nalgebra::DVector;

use crate::law::regression::{Design, LawRegression};
use crate::law::structure::{GaugeFamily, LawStructure};
use crate::order::median;

/// Residuals beyond this many robust deviations count by their size instead of its square. Laws of this kind are wrong by
/// several deviations for seconds, which they are to learn from; a contact that fails for a row is off by far more.
pub(crate) const HUBER: f64 = 5.0;
/// Fits of the preliminary law, each with the weights of the one before.
const PASSES: usize = 4;
/// Its ridge: strong, so that no outlier has a regressor to itself.
const RIDGE: f64 = 0.03;
/// A normal deviation over the median of absolute deviations.
const PER_MEDIAN: f64 = 1.482_602_218_505_602;

/// A cubic gauge and two branches that divide the time constants there can be into three.
pub(crate) fn preliminary(regression: &LawRegression) -> LawStructure {
    let (low, high) = (regression.tau_bounds.0.ln(), regression.tau_bounds.1.ln());
    let third = (high - low) / 3.0;
    let nonlinear = vec![low + third, high - third];
    LawStructure { family: GaugeFamily::Polynomial, nonlinear, taus: 2, ridge: RIDGE }
}

/// Residuals of the preliminary law over the median reading of each recording; `None` if there is none.
pub(crate) fn misfits(regression: &LawRegression) -> Option<DVector<f64>> {
    let (residual, rest_readings) = residuals(regression, &preliminary(regression).design(regression))?;
    Some(regression.in_readings(&residual, &rest_readings))
}

/// Residuals of the preliminary law over R₀ of each recording, and those R₀.
fn residuals(regression: &LawRegression, design: &Design) -> Option<(DVector<f64>, Vec<f64>)> {
    let solution = regression.solve(design, RIDGE, None)?;
    let residual = regression.response(&solution.rest_readings) - design.fitted(&solution.weights);
    Some((residual, solution.rest_readings))
}

/// The regression with Huber's weights, from the residuals of a preliminary law of two branches: the same for whatever is fitted to the
/// recordings then, so that fits can be compared.
///
/// Source: Huber, *Ann. Math. Statist.* 35 (1964) 73.
pub(crate) fn robust(mut regression: LawRegression) -> LawRegression {
    let design = preliminary(&regression).design(&regression);
    for _ in 0..PASSES {
        // Without a preliminary law every row counts the same; whether there is a law at all is for others to say.
        let Some((residual, _)) = residuals(&regression, &design) else { return regression };
        let most = HUBER * PER_MEDIAN * median(residual.iter().map(|r| r.abs())).unwrap_or(0.0);
        if !(most > 0.0) {
            return regression;
        }
        regression.set_weights(residual.iter().map(|r| if r.abs() > most { most / r.abs() } else { 1.0 }));
    }
    regression
}
