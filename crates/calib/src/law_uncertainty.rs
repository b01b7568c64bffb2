use nalgebra::{Cholesky, DMatrix, DVector};

use crate::CalibrationError;
use crate::law_params::{GaugeParams, LawParams};
use crate::law_regression::LawRegression;
use crate::law_structure::LawStructure;
use crate::params::Uncertainty;

/// Contiguous blocks over which residuals may be correlated as they like.
const BLOCKS: usize = 40;
/// Step of finite differences in parameters of order one.
const STEP: f64 = 1e-4;

/// Standard errors of the law's parameters: the block sandwich `A⁻¹ (Σ g_b g_bᵀ) A⁻¹` of the penalised least squares, g_b
/// the gradient summed over a block of rows, carried over to the law's own units. Residuals of such laws are neither
/// white nor even, for which the usual `σ² A⁻¹` is several times too small.
///
/// Source: Liang & Zeger, *Biometrika* 73 (1986) 13.
pub(crate) fn law_uncertainty(
    structure: &LawStructure,
    regression: &LawRegression,
) -> Result<Uncertainty, CalibrationError> {
    let design = structure.design(regression);
    let solution = regression.solve(&design, structure.ridge, None).ok_or(CalibrationError::Singular)?;
    let fitted = |structure: &LawStructure| {
        let design = structure.design(regression);
        let weighted = design.columns.iter().zip(solution.weights.iter());
        weighted.fold(design.offset, |sum, (column, weight)| sum + column * *weight)
    };
    let residual = regression.response(&solution.rest_readings) - fitted(structure);
    let mut columns = design.columns;
    for j in 0..structure.nonlinear.len() {
        let at = |step: f64| {
            let mut moved = structure.clone();
            moved.nonlinear[j] += step;
            fitted(&moved)
        };
        columns.push((at(STEP) - at(-STEP)) / (2.0 * STEP));
    }
    let jacobian = DMatrix::from_columns(&columns);
    let covariance = sandwich(&jacobian, &residual, design.free, structure.ridge).ok_or(CalibrationError::Singular)?;
    let mut point: Vec<f64> = solution.weights.iter().copied().collect();
    point.extend(&structure.nonlinear);
    let physical = |point: &[f64]| {
        let mut moved = structure.clone();
        let linear = solution.weights.len();
        moved.nonlinear.copy_from_slice(&point[linear..]);
        in_own_units(&moved.law(regression, &point[..linear]), point[0] * solution.rest_readings[0], point[0])
    };
    Ok(carry_over(&covariance, &point, physical))
}

fn sandwich(jacobian: &DMatrix<f64>, residual: &DVector<f64>, free: usize, ridge: f64) -> Option<DMatrix<f64>> {
    let (rows, size) = jacobian.shape();
    let mut normal = jacobian.tr_mul(jacobian);
    for j in free..size {
        normal[(j, j)] += ridge * rows as f64 * jacobian.column(j).variance();
        // A column that does nothing has no uncertainty to speak of.
        if normal[(j, j)] <= 0.0 {
            normal[(j, j)] = 1.0;
        }
    }
    let mut spread = DMatrix::zeros(size, size);
    for block in 0..BLOCKS {
        let (start, end) = (block * rows / BLOCKS, (block + 1) * rows / BLOCKS);
        let gradient = jacobian.rows(start, end - start).tr_mul(&residual.rows(start, end - start));
        spread += &gradient * gradient.transpose();
    }
    let factor = Cholesky::new(normal)?;
    let half = factor.solve(&spread);
    Some(factor.solve(&half.transpose()) * (BLOCKS as f64 / (BLOCKS - 1) as f64))
}

/// Covariance of `physical(point)` from the covariance of `point`, to first order.
fn carry_over(
    covariance: &DMatrix<f64>,
    point: &[f64],
    physical: impl Fn(&[f64]) -> Vec<(String, f64)>,
) -> Uncertainty {
    let (names, values): (Vec<String>, Vec<f64>) = physical(point).into_iter().unzip();
    let mut slope = DMatrix::zeros(values.len(), point.len());
    for j in 0..point.len() {
        let step = STEP * point[j].abs().max(STEP);
        let at = |sign: f64| {
            let mut moved = point.to_vec();
            moved[j] += sign * step;
            physical(&moved)
        };
        for (i, (up, down)) in at(1.0).iter().zip(at(-1.0)).enumerate() {
            slope[(i, j)] = (up.1 - down.1) / (2.0 * step);
        }
    }
    let full = &slope * covariance * slope.transpose();
    Uncertainty {
        names,
        standard_errors: (0..values.len()).map(|i| full[(i, i)].max(0.0).sqrt()).collect(),
        covariance: full.row_iter().map(|row| row.iter().copied().collect()).collect(),
        values,
    }
}

/// The law's parameters by name; everything is relative to R₀, which is `share` of what the law was fitted with.
fn in_own_units(law: &LawParams, rest_reading: f64, share: f64) -> Vec<(String, f64)> {
    let mut named = vec![("rest_reading".to_string(), rest_reading)];
    let mut push = |name: String, value: f64| named.push((name, value));
    match law.gauge {
        GaugeParams::Polynomial { coefficients } => {
            for (power, coefficient) in coefficients.iter().enumerate() {
                push(format!("gauge.coefficients[{power}]"), coefficient / share);
            }
        }
        GaugeParams::DecayingExponential { slope, decay_strain } => {
            push("gauge.slope".into(), slope / share);
            push("gauge.decay_strain".into(), decay_strain);
        }
        GaugeParams::Tunnelling { gap, barrier, path_loss } => {
            push("gauge.gap".into(), gap);
            push("gauge.barrier".into(), barrier);
            push("gauge.path_loss".into(), path_loss);
        }
    }
    push("extend_viscosity_s".into(), law.extend_viscosity_s / share);
    push("retract_viscosity_s".into(), law.retract_viscosity_s / share);
    for (i, play) in law.plays.iter().enumerate() {
        push(format!("plays[{i}].weight"), play.weight / share);
    }
    for (i, branch) in law.branches.iter().enumerate() {
        push(format!("branches[{i}].tau_s"), branch.tau_s);
        push(format!("branches[{i}].extend_gain"), branch.extend_gain / share);
        push(format!("branches[{i}].retract_gain"), branch.retract_gain / share);
        push(format!("branches[{i}].extend_gain_slope"), branch.extend_gain_slope / share);
        push(format!("branches[{i}].retract_gain_slope"), branch.retract_gain_slope / share);
    }
    named
}
