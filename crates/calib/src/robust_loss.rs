use crate::law_fit::GaugeFamily;
use crate::law_regression::LawRegression;
use crate::law_structure::LawStructure;

/// Residuals beyond this many robust deviations count by their size instead of its square. Laws of this kind are wrong by
/// several deviations for seconds, which they are to learn from; a contact that fails for a row is off by far more.
const HUBER: f64 = 5.0;
/// Fits of the preliminary law, each with the weights of the one before.
const PASSES: usize = 4;
/// Its ridge: strong, so that no outlier has a regressor to itself.
const RIDGE: f64 = 0.03;
/// A normal deviation over the median of absolute deviations.
const PER_MEDIAN: f64 = 1.482_602_218_505_602;

/// Huber's weights, from the residuals of a preliminary law of two branches: the same for whatever is fitted to the
/// recordings then, so that fits can be compared.
///
/// Source: Huber, *Ann. Math. Statist.* 35 (1964) 73.
pub(crate) fn weigh(regression: &mut LawRegression) {
    let (low, high) = (regression.tau_bounds.0.ln(), regression.tau_bounds.1.ln());
    let third = (high - low) / 3.0;
    let structure = LawStructure {
        family: GaugeFamily::Polynomial,
        nonlinear: vec![low + third, high - third],
        taus: 2,
        ridge: RIDGE,
    };
    let design = structure.design(regression);
    for _ in 0..PASSES {
        // Without a preliminary law every row counts the same; whether there is a law at all is for others to say.
        let Some(solution) = regression.solve(&design, RIDGE, None) else { return };
        let residual = regression.response(&solution.rest_readings) - design.fitted(&solution.weights);
        let mut sizes: Vec<f64> = residual.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let most = HUBER * PER_MEDIAN * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        if !(most > 0.0) {
            return;
        }
        regression.set_weights(residual.iter().map(|r| if r.abs() > most { most / r.abs() } else { 1.0 }));
    }
}
