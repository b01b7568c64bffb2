use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use super::{Derivatives, Likelihood, ModelFamily};
use crate::CalibrationError;

/// End point of the search.
pub(super) struct Optimum {
    pub point: Vec<f64>,
    pub derivatives: Derivatives,
    /// Parameters that were free at the end: not held at a bound.
    pub free: Vec<usize>,
    pub iterations: usize,
    pub converged: bool,
}

/// Largest number of iterations; a dozen is usual.
pub(super) const MOST_ITERATIONS: usize = 200;
/// First and largest length of a step, in the logarithm of a parameter.
const FIRST_RADIUS: f64 = 1.0;
const LARGEST_RADIUS: f64 = 4.0;
/// Length of a step, in standard errors, below which it is the last one.
const TOLERANCE: f64 = 1e-8;
/// Gain, as a fraction of the value, below which it is lost in the value's rounding; such a step is taken without a
/// check.
const ROUNDING: f64 = 1e-11;
/// Smallest curvature, as a fraction of the largest; smaller ones are raised to it.
const FLATTEST: f64 = 1e-10;

/// Maximises a likelihood in the logarithms of its parameters by Newton's method within bounds, with the exact Hessian.
///
/// Negative curvatures change sign, steps are limited to a radius that grows and shrinks with success, and parameters
/// held at a bound are left out of the step. The last steps are pure Newton steps that rely on the gradient alone.
/// argmin's trust-region and Newton solvers support neither bounds nor a stopping rule, hence this implementation.
///
/// Source: Bertsekas, *SIAM J. Control Optim.* 20 (1982) 221 for the bounds.
pub(super) fn maximise<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    likelihood: &Likelihood<F, N, L>,
    start: &[f64],
    bounds: &[(f64, f64)],
    most_iterations: usize,
) -> Result<Optimum, CalibrationError> {
    let inside = |point: &DVector<f64>| -> Vec<f64> {
        point.iter().zip(bounds).map(|(x, (lower, upper))| x.max(*lower).min(*upper)).collect()
    };
    let mut point = inside(&DVector::from_column_slice(start));
    let mut now = likelihood.ln_derivatives(&point)?;
    let (mut radius, mut iterations) = (FIRST_RADIUS, 0);
    loop {
        let free = free(&point, &now.gradient, bounds);
        let step = NewtonStep::new(&now, &free);
        if step.concave && step.decrement <= TOLERANCE * TOLERANCE {
            return Ok(Optimum { point, derivatives: now, free, iterations, converged: true });
        }
        if iterations >= most_iterations || radius < TOLERANCE {
            return Ok(Optimum { point, derivatives: now, free, iterations, converged: false });
        }
        iterations += 1;
        let value = now.log_likelihood.value;
        let length = step.direction.amax();
        let next = inside(&(DVector::from_column_slice(&point) + &step.direction * (radius / length).min(1.0)));
        let tiny = step.concave && step.decrement <= ROUNDING * (1.0 + value.abs());
        if !tiny && !(likelihood.ln_value(&next) > value) {
            radius = 0.25 * radius.min(length);
            continue;
        }
        radius = (2.0 * radius).min(LARGEST_RADIUS);
        match likelihood.ln_derivatives(&next) {
            Ok(derivatives) => (point, now) = (next, derivatives),
            Err(_) => radius *= 0.1,
        }
    }
}

/// Returns the parameters that a step may move: those not held at a bound.
fn free(point: &[f64], gradient: &DVector<f64>, bounds: &[(f64, f64)]) -> Vec<usize> {
    let moves = |i: &usize| {
        let (lower, upper) = bounds[*i];
        let pressed = (point[*i] <= lower && gradient[*i] <= 0.0) || (point[*i] >= upper && gradient[*i] >= 0.0);
        !pressed
    };
    (0..point.len()).filter(moves).collect()
}

/// A Newton step with every curvature made negative, as at a maximum.
struct NewtonStep {
    direction: DVector<f64>,
    /// gᵀ |H|⁻¹ g: twice the gain expected, and the squared length of the step in standard errors.
    decrement: f64,
    /// True if all curvatures were already those of a maximum.
    concave: bool,
}

impl NewtonStep {
    fn new(at: &Derivatives, free: &[usize]) -> Self {
        let mut step = Self { direction: DVector::zeros(at.gradient.len()), decrement: 0.0, concave: true };
        if free.is_empty() {
            return step;
        }
        let gradient = DVector::from_iterator(free.len(), free.iter().map(|&i| at.gradient[i]));
        let eigen = SymmetricEigen::new(-sub_matrix(&at.hessian, free));
        let flattest = eigen.eigenvalues.amax() * FLATTEST;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            step.concave &= *value > 0.0;
            let along = vector.dot(&gradient);
            let length = along / value.abs().max(flattest).max(f64::MIN_POSITIVE);
            step.decrement += along * length;
            for (k, &i) in free.iter().enumerate() {
                step.direction[i] += length * vector[k];
            }
        }
        step
    }
}

/// Returns the kept rows and columns of a symmetric matrix.
pub(super) fn sub_matrix(matrix: &DMatrix<f64>, kept: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(kept.len(), kept.len(), |a, b| matrix[(kept[a], kept[b])])
}

/// Returns the inverse of the negative Hessian among the free parameters; `None` unless the point is a maximum.
pub(super) fn covariance(optimum: &Optimum) -> Option<DMatrix<f64>> {
    Some(Cholesky::new(-sub_matrix(&optimum.derivatives.hessian, &optimum.free))?.inverse())
}
