use nalgebra::{Cholesky, DMatrix, DVector};

use super::derivatives::{derivatives, gradient};
use super::newton::sub_matrix;
use super::{Likelihood, LikelihoodFit, ModelFamily};

/// Half the 95 % quantile of χ² with one degree of freedom: the fall of the profile at an end of the interval.
const FALL: f64 = 1.920_729_410_347_062;
/// Largest number of steps to each end; five to ten are usual.
const MOST_STEPS: usize = 30;
/// Length of a step, in the logarithms, below which it is the last one.
const TOLERANCE: f64 = 1e-6;
/// Longest step, in the logarithm of a parameter.
const LONGEST: f64 = 2.0;
/// Least cosine between the unexplained change of the gradient and the step for a rank-one update of the Hessian; a smaller one is
/// rounding.
const LEAST_COSINE: f64 = 1e-8;

/// A 95 % interval from the profile likelihood: the values at which the other parameters can make the readings sufficiently likely. It
/// follows the likelihood where that is not a parabola, and does not include zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProfileInterval {
    /// Lower end; `None` if it is not found.
    pub lower: Option<f64>,
    /// Upper end; `None` if it is not found.
    pub upper: Option<f64>,
}

impl<F: ModelFamily<N, L>, const N: usize, const L: usize> Likelihood<'_, F, N, L> {
    /// Returns the profile interval of parameter `index` around the maximum `fit`. Newton's method searches for each end itself, with
    /// gradients only, from which the Hessian is kept up to date. An end is `None` if it is beyond a bound of any parameter, if the method
    /// does not reach it, or if the parameter is not free. Both ends are `None` if `fit` is not a maximum.
    ///
    /// Source: Venzon & Moolgavkar, *Appl. Statist.* 37 (1988) 87; the symmetric rank-one update of Nocedal & Wright,
    /// *Numerical Optimization* (2006), section 6.2.
    #[must_use]
    pub fn profile_interval(&self, fit: &LikelihoodFit, index: usize) -> ProfileInterval {
        let end = |sign: f64| Walk::from_maximum(self, fit, index, sign)?.end();
        ProfileInterval { lower: end(-1.0), upper: end(1.0) }
    }
}

/// Search from the maximum to an end of the interval, where the likelihood has fallen to its target and the gradient of the other
/// parameters is zero. All parameters are logarithms.
struct Walk<'a, F, const N: usize, const L: usize> {
    likelihood: &'a Likelihood<'a, F, N, L>,
    /// Parameters that move, and the index among them of the one that the interval is about.
    free: Vec<usize>,
    about: usize,
    /// -1 toward the lower end, 1 toward the upper one.
    sign: f64,
    target: f64,
    point: Vec<f64>,
    value: f64,
    gradient: DVector<f64>,
    /// Hessian of the free parameters.
    hessian: DMatrix<f64>,
}

impl<'a, F: ModelFamily<N, L>, const N: usize, const L: usize> Walk<'a, F, N, L> {
    fn from_maximum(
        likelihood: &'a Likelihood<'a, F, N, L>,
        fit: &LikelihoodFit,
        index: usize,
        sign: f64,
    ) -> Option<Self> {
        if !fit.converged {
            return None;
        }
        let free: Vec<usize> = (0..fit.parameters.len()).filter(|&i| fit.parameters[i].bound.is_none()).collect();
        let covariance = sub_matrix(fit.ln_covariance.as_ref()?, &free);
        Some(Self {
            likelihood,
            about: free.iter().position(|&i| i == index)?,
            sign,
            target: fit.log_likelihood.value - FALL,
            point: fit.parameters.iter().map(|parameter| parameter.value.ln()).collect(),
            value: fit.log_likelihood.value,
            gradient: DVector::zeros(free.len()),
            hessian: -Cholesky::new(covariance)?.inverse(),
            free,
        })
    }

    fn end(mut self) -> Option<f64> {
        let bounds = self.likelihood.ln_bounds();
        let mut longest = LONGEST;
        for _ in 0..MOST_STEPS {
            let step = self.step().or_else(|| self.exact_hessian().and_then(|()| self.step()))?;
            let length = step.amax();
            let step = &step * (longest / length).min(1.0);
            let mut next = self.point.clone();
            for (&i, by) in self.free.iter().zip(step.iter()) {
                next[i] += by;
            }
            if length < TOLERANCE {
                return Some(next[self.free[self.about]].exp());
            }
            if next.iter().zip(&bounds).any(|(x, (lower, upper))| !(lower..=upper).contains(&x)) {
                return None;
            }
            let (value, all) = gradient(self.likelihood.family, &next, self.likelihood.recordings).ok()?;
            let slopes = DVector::from_iterator(self.free.len(), self.free.iter().map(|&i| all[i]));
            // Far below the target the likelihood is no longer a parabola.
            if value < self.target - FALL || !(value + slopes.sum()).is_finite() {
                longest = 0.5 * step.amax();
                // The likelihood jumps instead of falling.
                if longest < TOLERANCE {
                    return None;
                }
                continue;
            }
            longest = LONGEST.min(4.0 * step.amax());
            self.learn(&step, &slopes);
            (self.point, self.value, self.gradient) = (next, value, slopes);
        }
        None
    }

    /// Returns the step to the point where the local quadratic, maximised over the other parameters, has fallen to the target.
    fn step(&self) -> Option<DVector<f64>> {
        let others: Vec<usize> = (0..self.free.len()).filter(|&k| k != self.about).collect();
        let among_others = Cholesky::new(-sub_matrix(&self.hessian, &others))?;
        let with = DVector::from_iterator(others.len(), others.iter().map(|&k| self.hessian[(k, self.about)]));
        let slopes = DVector::from_iterator(others.len(), others.iter().map(|&k| self.gradient[k]));
        // The optimal step of the others is `offset + along · s` for a step s of the parameter itself.
        let (offset, along) = (among_others.solve(&slopes), among_others.solve(&with));
        let above = self.value - self.target + 0.5 * slopes.dot(&offset);
        let slope = self.gradient[self.about] + with.dot(&offset);
        let curvature = self.hessian[(self.about, self.about)] + with.dot(&along);
        let discriminant = slope * slope - 2.0 * curvature * above;
        if !(discriminant > 0.0) {
            return None;
        }
        // The root on the falling side, in the form without cancellation.
        let own = self.sign * 2.0 * above / (discriminant.sqrt() - self.sign * slope);
        let mut step = DVector::zeros(self.free.len());
        step[self.about] = own;
        for (k, &other) in others.iter().enumerate() {
            step[other] = offset[k] + along[k] * own;
        }
        step.iter().all(|by| by.is_finite()).then_some(step)
    }

    /// Updates the Hessian from the change of the gradient over a step.
    fn learn(&mut self, step: &DVector<f64>, slopes: &DVector<f64>) {
        let unexplained = slopes - &self.gradient - &self.hessian * step;
        let along = unexplained.dot(step);
        if along.abs() > LEAST_COSINE * unexplained.norm() * step.norm() {
            self.hessian += &unexplained * unexplained.transpose() / along;
        }
    }

    /// Computes the Hessian anew if the updates have made it unusable.
    fn exact_hessian(&mut self) -> Option<()> {
        let here = derivatives(self.likelihood.family, &self.point, self.likelihood.recordings).ok()?;
        self.hessian = sub_matrix(&here.hessian, &self.free);
        Some(())
    }
}
