use rmpfit::{MPConfig, MPError, MPFitter, MPPar, MPResult, MPSide, MPSuccess};

use super::datum::Datum;
use super::law::{ClosedFormError, SeparableLaw};
use super::projection::{Projection, least_squares};
use super::search::{Extent, Search, starts};
use super::statistics::ClosedFormFit;

/// Number of starts that are followed to their minimum.
const FOLLOWED: usize = 12;
/// Largest number of final Gauss-Newton steps.
const MOST_POLISHES: usize = 20;
/// Largest of those steps, in units of the residual's norm.
const SMALL_STEP: f64 = 1e-3;

/// Fits a law to readings by least squares. Starts lie on a grid of the nonlinear parameters; of several minima the best is returned.
///
/// The weights are eliminated at every step (variable projection); the nonlinear parameters are found by Levenberg-Marquardt.
///
/// # Errors
/// Too few readings, or a law that is not finite at any start.
pub fn fit_closed_form(law: &dyn SeparableLaw, data: &[Datum]) -> Result<ClosedFormFit, ClosedFormError> {
    let searches = law.search(&Extent::of(data));
    let problem = Problem::new(law, data, searches)?;
    let costed = starts(&problem.searches).into_iter().filter_map(|start| Some((problem.at(&start)?.cost(), start)));
    let mut ranked: Vec<(f64, Vec<f64>)> = costed.collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.truncate(FOLLOWED);
    problem.best_of(ranked.into_iter().map(|(_, start)| start))
}

/// A law, its data and the search ranges.
struct Problem<'a> {
    law: &'a dyn SeparableLaw,
    data: &'a [Datum],
    searches: Vec<Search>,
    linear: usize,
}

/// End point of a descent.
struct End {
    cost: f64,
    theta: Vec<f64>,
    converged: bool,
}

impl<'a> Problem<'a> {
    fn new(law: &'a dyn SeparableLaw, data: &'a [Datum], searches: Vec<Search>) -> Result<Self, ClosedFormError> {
        let linear = law.linear().len();
        let needed = linear + searches.len() + 2;
        if data.len() < needed {
            return Err(ClosedFormError::TooFewRows { found: data.len(), needed });
        }
        Ok(Self { law, data, searches, linear })
    }

    fn at(&self, theta: &[f64]) -> Option<Projection> {
        Projection::new(self.law, self.data, self.linear, theta)
    }

    fn best_of(&self, starts: impl Iterator<Item = Vec<f64>>) -> Result<ClosedFormFit, ClosedFormError> {
        let mut best: Option<End> = None;
        let mut failure = ClosedFormError::NotFinite;
        for start in starts {
            match self.descend(&start) {
                Ok(end) if best.as_ref().is_none_or(|best| end.cost < best.cost) => best = Some(end),
                Ok(_) => {}
                Err(error) => failure = error,
            }
        }
        let End { mut theta, converged, .. } = best.ok_or(failure)?;
        let mut weights = self.at(&theta).ok_or(ClosedFormError::NotFinite)?.weights;
        self.law.order(weights.as_mut_slice(), &mut theta);
        let projection = self.at(&theta).ok_or(ClosedFormError::NotFinite)?;
        Ok(ClosedFormFit::new(self.law, self.data, &projection, &theta, &self.searches, converged))
    }

    /// Runs Levenberg-Marquardt from a start.
    fn descend(&self, start: &[f64]) -> Result<End, ClosedFormError> {
        let mut point: Vec<f64> = start.iter().zip(&self.searches).map(|(x, search)| search.coordinate(*x)).collect();
        let mut descent = Descent::new(self);
        let status = descent.mpfit(&mut point).map_err(|error| ClosedFormError::Optimiser(reason(&error)))?;
        let converged = !matches!(status.success, MPSuccess::NotDone | MPSuccess::MaxIter);
        self.polish(&mut point);
        let theta = self.theta(&point);
        let cost = self.at(&theta).ok_or(ClosedFormError::NotFinite)?.cost();
        Ok(End { cost, theta, converged })
    }

    /// Takes Gauss-Newton steps for as long as they shrink. The descent stops where the *cost* is flat to rounding, which determines the
    /// parameters to half as many digits as a zero gradient does.
    fn polish(&self, point: &mut [f64]) {
        let mut last = f64::INFINITY;
        for _ in 0..MOST_POLISHES {
            let theta = self.theta(point);
            let inside = theta.iter().zip(&self.searches).all(|(value, search)| !search.at_limit(*value));
            let Some(projection) = self.at(&theta).filter(|_| inside) else { return };
            let mut jacobian = projection.jacobian();
            for ((mut column, search), x) in jacobian.column_iter_mut().zip(&self.searches).zip(point.iter()) {
                column *= search.value_and_slope(*x).1;
            }
            let Some((_, step)) = least_squares(&jacobian, &projection.residual) else { return };
            let size = (jacobian * &step).norm();
            // If the first step is not small relative to the residual, the descent has not ended in a minimum.
            if !(size < 0.5 * last && size <= SMALL_STEP * projection.residual.norm()) {
                return;
            }
            last = size;
            for (x, step) in point.iter_mut().zip(step.iter()) {
                *x -= step;
            }
        }
    }

    fn theta(&self, point: &[f64]) -> Vec<f64> {
        point.iter().zip(&self.searches).map(|(x, search)| search.value_and_slope(*x).0).collect()
    }
}

/// A problem in the form that the optimiser needs.
struct Descent<'a> {
    problem: &'a Problem<'a>,
    config: MPConfig,
    limits: Vec<MPPar>,
}

impl<'a> Descent<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        let limits = problem.searches.iter().map(|search| MPPar {
            limited_low: true,
            limited_up: true,
            limit_low: search.coordinate(search.low),
            limit_up: search.coordinate(search.high),
            side: MPSide::User,
            ..MPPar::new()
        });
        // The tightest tolerance for doubles: the cost is then flat to rounding.
        let tight = 4.0 * f64::EPSILON;
        let config = MPConfig { ftol: tight, xtol: tight, gtol: tight, max_iter: 500, ..MPConfig::new() };
        Self { limits: limits.collect(), problem, config }
    }

    fn projection(&self, point: &[f64]) -> MPResult<Projection> {
        self.problem.at(&self.problem.theta(point)).ok_or(MPError::Nan)
    }
}

impl MPFitter for Descent<'_> {
    fn eval(&mut self, point: &[f64], residual: &mut [f64]) -> MPResult<()> {
        residual.copy_from_slice(self.projection(point)?.residual.as_slice());
        Ok(())
    }

    fn jacobian(&mut self, point: &[f64], residual: &mut [f64], slopes: &mut [Option<Vec<f64>>]) -> MPResult<()> {
        let projection = self.projection(point)?;
        residual.copy_from_slice(projection.residual.as_slice());
        let jacobian = projection.jacobian();
        for (k, column) in slopes.iter_mut().enumerate() {
            let Some(column) = column else { continue };
            let own = self.problem.searches[k].value_and_slope(point[k]).1;
            for (place, value) in column.iter_mut().zip(jacobian.column(k).iter()) {
                *place = value * own;
            }
        }
        Ok(())
    }

    fn number_of_points(&self) -> usize {
        self.problem.data.len()
    }

    fn config(&self) -> &MPConfig {
        &self.config
    }

    fn parameters(&self) -> &[MPPar] {
        &self.limits
    }
}

const fn reason(error: &MPError) -> &'static str {
    match error {
        MPError::Nan => "the law is not finite",
        MPError::InitBounds | MPError::Bounds => "a start lies outside of its limits",
        MPError::DoF => "fewer readings than parameters",
        _ => "the problem was refused",
    }
}
