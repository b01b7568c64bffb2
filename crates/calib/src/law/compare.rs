use crate::CalibrationError;
use crate::law::fit::{LawOptions, fit_structure};
use crate::law::regression::LawRegression;
use crate::law::robust_loss::robust;
use crate::law::structure::GaugeFamily;
use crate::law::structure::LawStructure;
use crate::samples::Samples;

/// Fit of a structure of the law to recordings, with criteria that penalise its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureScore {
    /// The structure.
    pub options: LawOptions,
    /// Parameters that were fitted, R₀ of each recording included.
    pub parameters: usize,
    /// Root mean squared residual, relative to R₀.
    pub error: f64,
    /// Root mean squared residual on held-out blocks, relative to R₀.
    pub cross_validated_error: f64,
    /// Akaike's criterion; smaller is better.
    pub aic: f64,
    /// Schwarz's criterion; smaller is better.
    pub bic: f64,
}

/// Largest number of branches compared.
const MOST_BRANCHES: usize = 3;

/// Fits every structure with up to three branches, with the least ridge, and compares them. Structures that cannot be fitted are omitted.
///
/// Residuals of such laws are correlated over seconds. The criteria count rows as if they were independent, so the rows
/// are first reduced to the number of independent ones, `n (1 - r)/(1 + r)` with the residuals' correlation r from row to
/// row under the structure that leaves the least error.
///
/// # Errors
/// If the recordings are too short, the strain is constant or no structure fits.
pub fn compare_structures(recordings: &[Samples]) -> Result<Vec<StructureScore>, CalibrationError> {
    let regression = robust(LawRegression::new(recordings)?);
    let mut fitted = Vec::new();
    for gauge in GaugeFamily::ALL {
        for branches in 0..=MOST_BRANCHES {
            let options = LawOptions { branches, gauge };
            let Ok((structure, fit)) = fit_structure(&regression, options) else { continue };
            let residuals: Vec<f64> = fit.residuals.into_iter().flatten().filter(|r| r.is_finite()).collect();
            let parameters = count(&structure, &regression);
            fitted.push((options, parameters, residuals, fit.cross_validated_error));
        }
    }
    let squares = |residuals: &[f64]| residuals.iter().map(|r| r * r).sum::<f64>();
    let richest = fitted.iter().min_by(|a, b| squares(&a.2).total_cmp(&squares(&b.2)));
    let Some((_, _, residuals, _)) = richest else { return Err(CalibrationError::Singular) };
    let independent = independent_rows(residuals);
    let score = |(options, parameters, residuals, cross_validated_error): (LawOptions, usize, Vec<f64>, f64)| {
        let mean_square = squares(&residuals) / residuals.len() as f64;
        let misfit = independent * mean_square.ln();
        StructureScore {
            options,
            parameters,
            error: mean_square.sqrt(),
            cross_validated_error,
            aic: misfit + 2.0 * parameters as f64,
            bic: misfit + parameters as f64 * independent.ln(),
        }
    };
    Ok(fitted.into_iter().map(score).collect())
}

fn count(structure: &LawStructure, regression: &LawRegression) -> usize {
    structure.design(regression).columns.len() + structure.nonlinear.len()
}

fn independent_rows(residuals: &[f64]) -> f64 {
    let power: f64 = residuals.iter().map(|r| r * r).sum();
    let product: f64 = residuals.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = (product / power.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (residuals.len() as f64 * (1.0 - correlation) / (1.0 + correlation)).max(1.0)
}
