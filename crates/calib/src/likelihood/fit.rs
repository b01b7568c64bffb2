use nalgebra::DMatrix;

use super::derivatives::derivatives;
use super::log_likelihood::log_likelihood;
use super::newton::{MOST_ITERATIONS, Optimum, covariance, maximise};
use super::{Derivatives, ModelFamily, Parameter, ReadingSeries, ReadingsLikelihood};
use crate::CalibrationError;

/// The likelihood of recordings under a family of models. `L = N (N + 1) / 2`.
#[derive(Clone, Copy, Debug)]
pub struct Likelihood<'a, F, const N: usize, const L: usize> {
    /// The models.
    pub family: &'a F,
    /// Their parameters, in the order in which the family takes them.
    pub parameters: &'a [Parameter],
    /// Recordings; the filter restarts for each.
    pub recordings: &'a [ReadingSeries<'a>],
}

/// A bound of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
    /// The smallest value allowed.
    Lower,
    /// The largest value allowed.
    Upper,
}

impl Bound {
    /// Returns `lower` or `upper`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lower => "lower",
            Self::Upper => "upper",
        }
    }
}

/// A parameter at the maximum of the likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedParameter {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Standard error of its logarithm, from the Hessian; `None` on a bound, or if the point is not a maximum of the
    /// likelihood.
    pub ln_standard_error: Option<f64>,
    /// Standard error on its natural scale. At the maximum the gradient is zero, so the Hessian on that scale gives the
    /// same value.
    pub standard_error: Option<f64>,
    /// Bound on which it ended; the likelihood still rises beyond.
    pub bound: Option<Bound>,
}

/// The maximum of a likelihood.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodFit {
    /// The parameters, in the family's order.
    pub parameters: Vec<FittedParameter>,
    /// The log-likelihood there.
    pub log_likelihood: ReadingsLikelihood<f64>,
    /// Euclidean norm of the gradient with respect to the logarithms of the parameters that are not on a bound.
    pub gradient_norm: f64,
    /// Covariance of the logarithms of the parameters, zero in rows and columns of those on a bound; `None` if the
    /// point is not a maximum of the likelihood.
    pub ln_covariance: Option<DMatrix<f64>>,
    /// Number of steps tried.
    pub iterations: usize,
    /// True if the last step was shorter than 1e-8 standard errors, at a maximum.
    pub converged: bool,
}

impl<F: ModelFamily<N, L>, const N: usize, const L: usize> Likelihood<'_, F, N, L> {
    /// Returns the log-likelihood at `values`, on the parameters' natural scale.
    ///
    /// # Errors
    /// If no model can have one of the parameters, or with the time at which the filter fails.
    pub fn log_likelihood(&self, values: &[f64]) -> Result<ReadingsLikelihood<f64>, CalibrationError> {
        log_likelihood(self.family, values, self.recordings)
    }

    /// Returns the log-likelihood with exact derivatives with respect to the logarithms of `values`.
    ///
    /// # Errors
    /// As [`Self::log_likelihood`], or if a value is not positive or a derivative does not exist.
    pub fn derivatives(&self, values: &[f64]) -> Result<Derivatives, CalibrationError> {
        let ln: Vec<f64> = values.iter().map(|value| value.ln()).collect();
        self.ln_derivatives(&ln)
    }

    /// Returns the log-likelihood as a function of the logarithms of the parameters; NaN where it does not exist.
    pub(super) fn ln_value(&self, ln: &[f64]) -> f64 {
        let values: Vec<f64> = ln.iter().map(|ln| ln.exp()).collect();
        self.log_likelihood(&values).map_or(f64::NAN, |log_likelihood| log_likelihood.value)
    }

    /// Returns [`Self::derivatives`] as a function of the logarithms of the parameters.
    pub(super) fn ln_derivatives(&self, ln: &[f64]) -> Result<Derivatives, CalibrationError> {
        derivatives(self.family, ln, self.recordings)
    }

    /// Finds the parameters that maximise the likelihood of the readings.
    ///
    /// # Errors
    /// If a start is not within positive bounds, or if the filter fails there.
    pub fn fit(&self) -> Result<LikelihoodFit, CalibrationError> {
        self.fit_within(MOST_ITERATIONS)
    }

    /// Runs [`Self::fit`] with another limit on the number of steps.
    pub(super) fn fit_within(&self, most_iterations: usize) -> Result<LikelihoodFit, CalibrationError> {
        for Parameter { name, start, lower, upper } in self.parameters {
            if !(0.0 < *lower && lower <= start && start <= upper && upper.is_finite()) {
                let message = format!("{name} starts at {start}, which is not within positive bounds");
                return Err(CalibrationError::Unsupported(message));
            }
        }
        let start: Vec<f64> = self.parameters.iter().map(|parameter| parameter.start.ln()).collect();
        Ok(self.report(&maximise(self, &start, &self.ln_bounds(), most_iterations)?))
    }

    pub(super) fn ln_bounds(&self) -> Vec<(f64, f64)> {
        self.parameters.iter().map(|parameter| (parameter.lower.ln(), parameter.upper.ln())).collect()
    }

    fn report(&self, optimum: &Optimum) -> LikelihoodFit {
        let size = self.parameters.len();
        let free = &optimum.free;
        let ln_covariance = covariance(optimum).map(|small| {
            let mut full = DMatrix::zeros(size, size);
            for (a, &i) in free.iter().enumerate() {
                for (b, &j) in free.iter().enumerate() {
                    full[(i, j)] = small[(a, b)];
                }
            }
            full
        });
        let fitted = |(i, parameter): (usize, &Parameter)| {
            let value = optimum.point[i].exp();
            let is_free = free.contains(&i);
            let middle = 0.5 * (parameter.lower.ln() + parameter.upper.ln());
            let nearest = if optimum.point[i] < middle { Bound::Lower } else { Bound::Upper };
            let variance = ln_covariance.as_ref().filter(|_| is_free).map(|covariance| covariance[(i, i)]);
            let ln_standard_error = variance.map(f64::sqrt);
            FittedParameter {
                name: parameter.name,
                value,
                ln_standard_error,
                standard_error: ln_standard_error.map(|error| error * value),
                bound: (!is_free).then_some(nearest),
            }
        };
        LikelihoodFit {
            parameters: self.parameters.iter().enumerate().map(fitted).collect(),
            log_likelihood: optimum.derivatives.log_likelihood,
            gradient_norm: free.iter().map(|&i| optimum.derivatives.gradient[i].powi(2)).sum::<f64>().sqrt(),
            ln_covariance,
            iterations: optimum.iterations,
            converged: optimum.converged,
        }
    }
}
