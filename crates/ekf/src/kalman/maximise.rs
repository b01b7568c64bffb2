use nalgebra::{ComplexField, SMatrix, SVector};

/// Maximum-likelihood parameters found by [`maximise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Maximum<const P: usize> {
    /// The parameters θ.
    pub parameters: SVector<f64, P>,
    /// The log-likelihood there.
    pub log_likelihood: f64,
    /// Standard errors of θ, the roots of the diagonal of `covariance`.
    pub standard_errors: SVector<f64, P>,
    /// Inverse of the observed information, (−∂²ℓ/∂θ²)⁻¹.
    pub covariance: SMatrix<f64, P, P>,
    /// Number of steps taken.
    pub iterations: usize,
}

/// Reason why no maximum was found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoMaximum {
    /// The log-likelihood cannot be computed at the start of the search.
    Start,
    /// The log-likelihood still rises at the end of the search: a parameter that the readings do not determine, a
    /// variance whose best value is zero, or a start too far off.
    StillRising {
        /// The largest log-likelihood found.
        log_likelihood: f64,
    },
    /// The log-likelihood does not fall in every direction from the best point, so there are no standard errors.
    Flat {
        /// The largest log-likelihood found.
        log_likelihood: f64,
    },
}

impl core::fmt::Display for NoMaximum {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Start => out.write_str("the log-likelihood cannot be computed where the search starts"),
            Self::StillRising { log_likelihood } => {
                write!(out, "the log-likelihood still rises beyond {log_likelihood}")
            }
            Self::Flat { log_likelihood } => {
                write!(out, "the log-likelihood is not curved in every direction at its largest, {log_likelihood}")
            }
        }
    }
}

impl core::error::Error for NoMaximum {}

/// Maximum number of steps of the search.
const MOST_ITERATIONS: usize = 200;
/// Expected gain in log-likelihood at which the search ends: a step of a hundred-thousandth of a standard error.
const ENOUGH: f64 = 1e-10;
/// The same if rounding hides the gain: a step of a thousandth of a standard error.
const ENOUGH_IN_ROUNDING: f64 = 1e-6;
/// Largest ratio of a parameter's variance to its variance given the other parameters. Curvatures are accurate to six
/// digits.
const MOST_INFLATION: f64 = 1e6;
/// Damping, relative to the curvature of each parameter.
const LEAST_DAMPING: f64 = 1e-12;
const MOST_DAMPING: f64 = 1e12;
/// ∛ε.
const GRADIENT_STEP: f64 = 6e-6;
/// ∜ε.
const CURVATURE_STEP: f64 = 1.2e-4;

/// Maximises a log-likelihood over P parameters by Newton's method, with Levenberg-Marquardt damping.
///
/// - `start`: θ at which the search begins. The parameters should be of order one: use logarithms of variances instead
///   of variances, which also keeps variances positive.
/// - `log_likelihood`: ℓ(θ), the sum of [`Step::log_likelihood`](super::Step::log_likelihood) over a recording; an error
///   or a NaN marks a θ that is not allowed.
///
/// Derivatives are central differences, with steps of ∛ε for the gradient and ∜ε for the curvature, times the parameter if
/// it is larger than one. Standard errors are accurate to about six digits. One that is huge marks a parameter that the
/// readings do not determine, such as the logarithm of a variance whose best value is zero. An iteration takes
/// 2 P (P + 1) evaluations, and one per damping tried. The standard error of a function g(θ) is |g′(θ)| times that of θ;
/// for a variance e^θ the factor is e^θ.
///
/// # Errors
/// See [`NoMaximum`].
///
/// Source: Durbin & Koopman, *Time Series Analysis by State Space Methods* (2012), §7.3.
pub fn maximise<E, const P: usize>(
    start: [f64; P],
    mut log_likelihood: impl FnMut(&[f64; P]) -> Result<f64, E>,
) -> Result<Maximum<P>, NoMaximum> {
    let mut value_at = |theta: &SVector<f64, P>| {
        let value = log_likelihood(&(*theta).into()).unwrap_or(f64::NAN);
        if value.is_finite() { value } else { f64::NEG_INFINITY }
    };
    let mut theta = SVector::from(start);
    let mut value = value_at(&theta);
    if value == f64::NEG_INFINITY {
        return Err(NoMaximum::Start);
    }
    let mut damping = 1e-3;
    for iterations in 0..MOST_ITERATIONS {
        let gradient = gradient(&theta, &mut value_at);
        let information = information(&theta, value, &mut value_at);
        // A maximum is found if no remaining step would gain `enough`.
        let found = |enough: f64| {
            let covariance = information.cholesky().map(|root| root.inverse())?;
            let inflation = covariance.diagonal().component_mul(&information.diagonal());
            let gain = 0.5 * gradient.dot(&(covariance * gradient));
            let standard_errors = covariance.diagonal().map(ComplexField::sqrt);
            let found = Maximum { parameters: theta, log_likelihood: value, standard_errors, covariance, iterations };
            (gain < enough && inflation.amax() < MOST_INFLATION).then_some(found)
        };
        if let Some(maximum) = found(ENOUGH) {
            return Ok(maximum);
        }
        let better = loop {
            let step = damped(&information, damping).map(|inverse| theta + inverse * gradient);
            match step.map(|there| (there, value_at(&there))) {
                Some((there, higher)) if higher > value => break Some((there, higher)),
                _ if damping > MOST_DAMPING => break None,
                _ => damping *= 4.0,
            }
        };
        let Some(better) = better else {
            return found(ENOUGH_IN_ROUNDING).ok_or(NoMaximum::Flat { log_likelihood: value });
        };
        (theta, value) = better;
        damping = f64::max(damping / 8.0, LEAST_DAMPING);
    }
    Err(NoMaximum::StillRising { log_likelihood: value })
}

/// ∂ℓ/∂θ.
fn gradient<const P: usize>(
    theta: &SVector<f64, P>,
    value_at: &mut impl FnMut(&SVector<f64, P>) -> f64,
) -> SVector<f64, P> {
    let step = |i: usize| GRADIENT_STEP * f64::max(1.0, theta[i].abs());
    SVector::from_fn(|i, _| {
        let (above, below) = (moved(theta, &[(i, step(i))]), moved(theta, &[(i, -step(i))]));
        (value_at(&above) - value_at(&below)) / (above[i] - below[i])
    })
}

/// −∂²ℓ/∂θ².
fn information<const P: usize>(
    theta: &SVector<f64, P>,
    value: f64,
    value_at: &mut impl FnMut(&SVector<f64, P>) -> f64,
) -> SMatrix<f64, P, P> {
    let step = |i: usize| CURVATURE_STEP * f64::max(1.0, theta[i].abs());
    let mut out = SMatrix::zeros();
    for i in 0..P {
        let (above, below) = (moved(theta, &[(i, step(i))]), moved(theta, &[(i, -step(i))]));
        out[(i, i)] = (2.0 * value - value_at(&above) - value_at(&below)) / (step(i) * step(i));
        for j in 0..i {
            let mut corner = |a: f64, b: f64| a * b * value_at(&moved(theta, &[(i, a * step(i)), (j, b * step(j))]));
            let twist = corner(1.0, 1.0) + corner(1.0, -1.0) + corner(-1.0, 1.0) + corner(-1.0, -1.0);
            out[(i, j)] = -twist / (4.0 * step(i) * step(j));
            out[(j, i)] = out[(i, j)];
        }
    }
    out
}

fn moved<const P: usize>(theta: &SVector<f64, P>, by: &[(usize, f64)]) -> SVector<f64, P> {
    by.iter().fold(*theta, |mut theta, (i, step)| {
        theta[*i] += step;
        theta
    })
}

/// Returns the inverse of the information with a damped diagonal; `None` if that is not positive definite.
fn damped<const P: usize>(information: &SMatrix<f64, P, P>, damping: f64) -> Option<SMatrix<f64, P, P>> {
    let more = information.diagonal().map(|own| damping * f64::max(own.abs(), LEAST_DAMPING));
    (information + SMatrix::from_diagonal(&more)).cholesky().map(|root| root.inverse())
}
