use nalgebra::{DMatrix, DVector};

use super::datum::Datum;
use super::law::{Parameter, SeparableLaw};
use super::projection::Projection;
use super::search::Search;

/// Threshold on a singular value, as a fraction of the largest, below which the data do not determine its direction: the square root of the
/// rounding error. Below it the variance itself is rounding.
const LEAST_SINGULAR: f64 = 1.5e-8;
/// Component of a parameter along an undetermined direction above which it has no standard error.
const INVOLVED: f64 = 1e-3;

/// A parameter, or a quantity derived from parameters, with its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimated {
    /// Name and unit.
    pub parameter: Parameter,
    /// Its value.
    pub value: f64,
    /// Its standard error; `None` if the data do not determine the parameter, or if it is at a limit of its search.
    pub standard_error: Option<f64>,
    /// True if it is at a limit of its search: the best value is beyond.
    pub at_limit: bool,
}

/// A fitted law with its goodness of fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedFormFit {
    /// The parameters, linear ones first.
    pub parameters: Vec<Estimated>,
    /// Derived parameters.
    pub derived: Vec<Estimated>,
    /// Covariance of the parameters, `σ² (JᵀJ)⁻¹`; NaN where a parameter has no standard error.
    pub covariance: DMatrix<f64>,
    /// Number of readings fitted.
    pub readings: usize,
    /// Reading minus law, one per reading.
    pub residuals: Vec<f64>,
    /// Sum of squared residuals.
    pub residual_sum: f64,
    /// Residual standard deviation σ, `√(sum / (n - p))`, in the unit of the reading.
    pub residual_sd: f64,
    /// `1 - residual sum / sum about the mean`; 0 if the readings do not vary.
    pub r_squared: f64,
    /// Akaike's criterion `n (ln(2π sum/n) + 1) + 2 k`, k = p + 1 with the variance.
    pub aic: f64,
    /// Akaike's criterion corrected for short records, `+ 2 k (k + 1) / (n - k - 1)`; infinite where that is not positive.
    pub aicc: f64,
    /// Bayesian criterion, with `k ln n` in place of `2 k`.
    pub bic: f64,
    /// Correlation of neighbouring residuals. Near 0, standard errors are right; near 1, they are too small by a factor of about
    /// `√((1 + ρ) / (1 - ρ))`.
    pub residual_autocorrelation: f64,
    /// Condition number of the Jacobian with columns of unit length.
    pub condition: f64,
    /// True if the optimiser reported convergence.
    pub converged: bool,
}

impl ClosedFormFit {
    /// Returns a parameter or derived quantity by name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Estimated> {
        self.parameters.iter().chain(&self.derived).find(|estimated| estimated.parameter.name == name)
    }

    pub(super) fn new(
        law: &dyn SeparableLaw,
        data: &[Datum],
        projection: &Projection,
        theta: &[f64],
        searches: &[Search],
        converged: bool,
    ) -> Self {
        let weights = projection.weights.as_slice();
        let at_limit: Vec<bool> = weights
            .iter()
            .map(|_| false)
            .chain(theta.iter().zip(searches).map(|(value, search)| search.at_limit(*value)))
            .collect();
        let jacobian = DMatrix::from_fn(data.len(), at_limit.len(), |row, j| match j.checked_sub(weights.len()) {
            None => projection.basis[(row, j)],
            Some(k) => projection.slopes[(row, k)],
        });
        let inverse = Inverse::new(&jacobian, &at_limit);
        let (n, p, residual_sum) = (data.len() as f64, at_limit.len() as f64, projection.cost());
        let variance = residual_sum / (n - p);
        let covariance = inverse.covariance * variance;
        let names = law.linear().into_iter().chain(law.nonlinear());
        let values = weights.iter().chain(theta);
        let parameters = names
            .zip(values)
            .enumerate()
            .map(|(j, (parameter, value))| Estimated {
                parameter,
                value: *value,
                standard_error: known(covariance[(j, j)]),
                at_limit: at_limit[j],
            })
            .collect();
        let derived = law.derived(weights, theta, data).into_iter().map(|derived| Estimated {
            standard_error: known(carried(&covariance, &derived.gradient)),
            parameter: derived.parameter,
            value: derived.value,
            at_limit: false,
        });
        let k = p + 1.0;
        let fit = n * ((2.0 * std::f64::consts::PI * residual_sum / n).ln() + 1.0);
        Self {
            parameters,
            derived: derived.collect(),
            covariance,
            readings: data.len(),
            residuals: projection.residual.as_slice().to_vec(),
            residual_sum,
            residual_sd: variance.sqrt(),
            r_squared: r_squared(data, residual_sum),
            aic: fit + 2.0 * k,
            aicc: if n > k + 1.0 { fit + 2.0 * k * n / (n - k - 1.0) } else { f64::INFINITY },
            bic: fit + k * n.ln(),
            residual_autocorrelation: autocorrelation(&projection.residual),
            condition: inverse.condition,
            converged,
        }
    }
}

/// `(JᵀJ)⁻¹` by QR and SVD, NaN where it is not determined, and the condition number.
struct Inverse {
    covariance: DMatrix<f64>,
    condition: f64,
}

impl Inverse {
    /// Inverts without the columns at a limit; the variances of the others are conditional on those limits.
    fn new(jacobian: &DMatrix<f64>, left_out: &[bool]) -> Self {
        let size = jacobian.ncols();
        let unknown = DMatrix::from_element(size, size, f64::NAN);
        let kept: Vec<usize> = (0..size).filter(|&j| !left_out[j] && jacobian.column(j).norm() > 0.0).collect();
        let scale: Vec<f64> = kept.iter().map(|&j| jacobian.column(j).norm()).collect();
        let scaled = DMatrix::from_fn(jacobian.nrows(), kept.len(), |row, i| jacobian[(row, kept[i])] / scale[i]);
        let svd = scaled.qr().r().svd(false, true);
        let (Some(right), singular) = (svd.v_t, svd.singular_values) else {
            return Self { covariance: unknown, condition: f64::INFINITY };
        };
        let (largest, smallest) = (singular.max(), singular.min());
        let mut covariance = unknown;
        for a in 0..kept.len() {
            for b in 0..kept.len() {
                let mut sum = 0.0;
                for (i, value) in singular.iter().enumerate() {
                    if *value > LEAST_SINGULAR * largest {
                        sum += right[(i, a)] * right[(i, b)] / (value * value);
                    } else if right[(i, a)].abs().max(right[(i, b)].abs()) > INVOLVED {
                        sum = f64::NAN;
                    }
                }
                covariance[(kept[a], kept[b])] = sum / (scale[a] * scale[b]);
            }
        }
        Self { covariance, condition: largest / smallest }
    }
}

fn known(variance: f64) -> Option<f64> {
    variance.is_finite().then(|| variance.max(0.0).sqrt())
}

/// Returns the variance of a quantity with this gradient. Parameters on which it does not depend may be undetermined.
fn carried(covariance: &DMatrix<f64>, gradient: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (a, slope_a) in gradient.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
        for (b, slope_b) in gradient.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
            sum += slope_a * covariance[(a, b)] * slope_b;
        }
    }
    sum
}

fn r_squared(data: &[Datum], residual_sum: f64) -> f64 {
    let mean = data.iter().map(|datum| datum.reading).sum::<f64>() / data.len() as f64;
    let about_mean: f64 = data.iter().map(|datum| (datum.reading - mean).powi(2)).sum();
    if about_mean > 0.0 { 1.0 - residual_sum / about_mean } else { 0.0 }
}

fn autocorrelation(residual: &DVector<f64>) -> f64 {
    let products: f64 = residual.as_slice().windows(2).map(|pair| pair[0] * pair[1]).sum();
    let squares = residual.norm_squared();
    if squares > 0.0 { products / squares } else { 0.0 }
}
