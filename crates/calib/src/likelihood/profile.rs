use std::cell::RefCell;

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentRoot;

use super::{Likelihood, LikelihoodFit, ModelFamily};
use crate::CalibrationError;

/// Half the 95 % quantile of χ² with one degree of freedom: how far the profile may fall.
pub(super) const FALL: f64 = 1.920_729_410_347_062;
/// Accuracy of the ends, in the logarithm of the parameter.
const TOLERANCE: f64 = 1e-9;
/// Each step away from the maximum is this much longer than the one before.
const GROWTH: f64 = 1.6;

/// A 95 % interval from the profile likelihood: the values for which the other parameters can make the readings likely
/// enough. It follows the likelihood where that is no parabola, and does not pass through zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileInterval {
    /// Lower end; `None` where the likelihood does not fall far enough before the parameter's bound.
    pub lower: Option<f64>,
    /// Upper end, likewise.
    pub upper: Option<f64>,
}

impl<F: ModelFamily<N, L>, const N: usize, const L: usize> Likelihood<'_, F, N, L> {
    /// The profile interval of parameter `index` around the maximum `fit`. Every point of a profile is a maximum over the
    /// other parameters, ten to twenty of them in all.
    ///
    /// # Errors
    /// As [`Self::fit`]; an index without a parameter is unsupported.
    pub fn profile_interval(&self, fit: &LikelihoodFit, index: usize) -> Result<ProfileInterval, CalibrationError> {
        let Some(parameter) = fit.parameters.get(index) else {
            return Err(CalibrationError::Unsupported(format!("there is no parameter {index}")));
        };
        let bounds = self.ln_bounds()[index];
        let first = parameter.ln_standard_error.unwrap_or(1.0);
        let end = |bound: f64, step: f64| {
            // Each maximum starts from the one before.
            let at: Vec<f64> = fit.parameters.iter().map(|parameter| parameter.value.ln()).collect();
            let profile = Profile { likelihood: self, index, target: fit.log_likelihood.value - FALL, at: at.into() };
            profile.crossing(parameter.value.ln(), bound, step)
        };
        Ok(ProfileInterval { lower: end(bounds.0, -first)?, upper: end(bounds.1, first)? })
    }
}

struct Profile<'a, F, const N: usize, const L: usize> {
    likelihood: &'a Likelihood<'a, F, N, L>,
    index: usize,
    target: f64,
    at: RefCell<Vec<f64>>,
}

impl<F: ModelFamily<N, L>, const N: usize, const L: usize> Profile<'_, F, N, L> {
    /// The profile above its target.
    fn excess(&self, ln_value: f64) -> Result<f64, CalibrationError> {
        let mut start = self.at.borrow().clone();
        start[self.index] = ln_value;
        let optimum = self.likelihood.maximise_others(&start, self.index)?;
        self.at.replace(optimum.point);
        Ok(optimum.derivatives.log_likelihood.value - self.target)
    }

    /// Where the profile falls to its target, from the maximum on in the direction of `step`.
    fn crossing(self, from: f64, bound: f64, step: f64) -> Result<Option<f64>, CalibrationError> {
        let (mut inner, mut step) = (from, step);
        let outer = loop {
            let outer = if step < 0.0 { (inner + step).max(bound) } else { (inner + step).min(bound) };
            if self.excess(outer)? < 0.0 {
                break outer;
            }
            if outer == bound {
                return Ok(None);
            }
            (inner, step) = (outer, step * GROWTH);
        };
        let failed = |error: Error| CalibrationError::Optimiser(error.to_string());
        let solver = BrentRoot::new(inner, outer, TOLERANCE);
        let result = Executor::new(self, solver).configure(|state| state.max_iters(100)).run().map_err(failed)?;
        Ok(result.state().get_best_param().map(|ln| ln.exp()))
    }
}

impl<F: ModelFamily<N, L>, const N: usize, const L: usize> CostFunction for Profile<'_, F, N, L> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, ln_value: &f64) -> Result<f64, Error> {
        Ok(self.excess(*ln_value)?)
    }
}
