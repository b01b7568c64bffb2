use std::fmt;

use nalgebra::DMatrix;

use crate::CalibrationError;
use crate::law::advice::{OnBound, advice, scaled_normal};
use crate::law::least_squares::without_ridge;
use crate::law::regression::LawRegression;
use crate::law::robust_loss::robust;
use crate::law::uncertainty::Linearised;
use crate::likelihood::Bound;
use crate::motion_stats::MotionStats;
use crate::samples::Samples;
use ohmstrain_sensor::{LawParams, Uncertainty};

/// Identifiability of a law's parameters from recordings, with advice on recordings that would determine them better.
#[derive(Clone, Debug, PartialEq)]
pub struct Identifiability {
    /// Parameters by least squares without a ridge, with standard errors by the block jackknife.
    pub parameters: Uncertainty,
    /// Correlation matrix of the parameters, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Condition number of the normal matrix with columns scaled to unit length; beyond about 1e10 some combination of parameters is not
    /// determined at all.
    pub condition_number: f64,
    /// Time constants that are on a bound.
    pub on_bound: Vec<OnBound>,
    /// Advice on the next recording, in words; empty if nothing stands out.
    pub advice: Vec<String>,
}

/// Distance from a bound, in ln τ, at which a time constant counts as being on it.
const NEAR: f64 = 1e-3;
/// Number of strongest correlations reported in words.
const STRONGEST: usize = 5;

/// Examines the information of `recordings` about the parameters of `law`, which was fitted to them.
///
/// The ridge of the fit hides which parameters a recording leaves undetermined. Here the law is fitted again without it, from its present
/// values.
///
/// # Errors
/// If the recordings are too short, the strain is constant or the equations are singular.
pub fn identifiability(recordings: &[Samples], law: &LawParams) -> Result<Identifiability, CalibrationError> {
    let regression = robust(LawRegression::new(recordings)?);
    let structure = without_ridge(law, &regression)?;
    let fit = Linearised::new(&structure, &regression)?;
    let parameters = fit.jackknifed()?;
    let (low, high) = regression.tau_bounds;
    let on_bound = structure.nonlinear[..structure.taus].iter().enumerate().filter_map(|(i, ln_tau)| {
        let at = |bound: f64| (ln_tau - bound.ln()).abs() < NEAR;
        let bound = if at(low) { Bound::Lower } else { at(high).then_some(Bound::Upper)? };
        Some(OnBound { name: format!("branches[{i}].tau_s"), value: ln_tau.exp(), bound })
    });
    let on_bound: Vec<OnBound> = on_bound.collect();
    Ok(Identifiability {
        correlation: parameters.correlation(),
        condition_number: condition_number(&fit.jacobian),
        advice: advice(&parameters, &on_bound, &MotionStats::new(recordings), regression.range, &fit.jacobian),
        on_bound,
        parameters,
    })
}

fn condition_number(jacobian: &DMatrix<f64>) -> f64 {
    let eigenvalues = scaled_normal(jacobian).symmetric_eigenvalues();
    // Rounding may make a zero eigenvalue negative.
    eigenvalues.max() / eigenvalues.min().max(f64::EPSILON * eigenvalues.max())
}

impl Identifiability {
    /// Returns the parameters without the ridge, except time constants on a bound: a recording does not determine those, and their standard
    /// errors measure how well the bound is known.
    #[must_use]
    pub fn off_bounds(&self) -> Uncertainty {
        let Uncertainty { names, values, standard_errors, covariance } = &self.parameters;
        let is_off_bounds = |i: &usize| self.on_bound.iter().all(|on| on.name != names[*i]);
        let kept: Vec<usize> = (0..names.len()).filter(is_off_bounds).collect();
        let pick = |values: &[f64]| kept.iter().map(|&i| values[i]).collect::<Vec<f64>>();
        Uncertainty {
            names: kept.iter().map(|&i| names[i].clone()).collect(),
            values: pick(values),
            standard_errors: pick(standard_errors),
            covariance: kept.iter().map(|&i| pick(&covariance[i])).collect(),
        }
    }

    /// Returns the most strongly correlated pairs of parameters, strongest first.
    #[must_use]
    pub fn strongest_correlations(&self) -> Vec<(&str, &str, f64)> {
        let names = &self.parameters.names;
        let mut pairs: Vec<(&str, &str, f64)> = Vec::new();
        for (i, row) in self.correlation.iter().enumerate() {
            pairs.extend((0..i).map(|j| (names[j].as_str(), names[i].as_str(), row[j])));
        }
        pairs.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        pairs.truncate(STRONGEST);
        pairs
    }
}

impl fmt::Display for Identifiability {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(f, "parameters without the ridge, standard errors by the block jackknife")?;
        let Uncertainty { names, values, standard_errors, .. } = &self.parameters;
        for (name, (value, error)) in names.iter().zip(values.iter().zip(standard_errors)) {
            let on = self.on_bound.iter().find(|on| on.name == *name);
            let note = on.map_or(String::new(), |on| format!("  on its {} bound", on.bound.name()));
            writeln!(f, "  {name:<32} {value:>12.4e} ± {error:.1e}{note}")?;
        }
        writeln!(f, "condition number of the scaled normal matrix: {:.1e}", self.condition_number)?;
        writeln!(f, "strongest correlations")?;
        for (a, b, correlation) in self.strongest_correlations() {
            writeln!(f, "  {correlation:+.3}  {a}, {b}")?;
        }
        writeln!(f, "what to record next")?;
        if self.advice.is_empty() {
            writeln!(f, "  nothing stands out")?;
        }
        self.advice.iter().try_for_each(|line| writeln!(f, "  {line}"))
    }
}
