use nalgebra::{Cholesky, DMatrix, DVector};

use crate::CalibrationError;
use crate::dense::product;
use crate::law::regression::{LawRegression, Solution};
use crate::law::structure::LawStructure;
use ohmstrain_sensor::{LawParameter, LawParams, Uncertainty};

/// Number of contiguous blocks; residuals may be correlated within a block.
const JACKKNIFE_BLOCKS: usize = 40;
/// Step of finite differences, for parameters of order one.
const STEP: f64 = 1e-4;

/// A fitted structure with the derivative of its fit.
pub(crate) struct Linearised<'a> {
    structure: &'a LawStructure,
    regression: &'a LawRegression,
    solution: Solution,
    free: usize,
    pub residual: DVector<f64>,
    /// Columns of the linear parameters, then those of the nonlinear ones.
    pub jacobian: DMatrix<f64>,
}

impl<'a> Linearised<'a> {
    pub(crate) fn new(structure: &'a LawStructure, regression: &'a LawRegression) -> Result<Self, CalibrationError> {
        let design = structure.design(regression);
        let solution = regression.solve(&design, structure.ridge, None).ok_or(CalibrationError::Singular)?;
        let fitted = |structure: &LawStructure| structure.design(regression).fitted(&solution.weights);
        let root_weights = regression.root_weights();
        let residual = (regression.response(&solution.rest_readings) - fitted(structure)).component_mul(&root_weights);
        let (mut columns, free) = (design.columns, design.free);
        for j in 0..structure.nonlinear.len() {
            let at = |step: f64| {
                let mut moved = structure.clone();
                moved.nonlinear[j] += step;
                fitted(&moved)
            };
            columns.push((at(STEP) - at(-STEP)) / (2.0 * STEP));
        }
        let columns: Vec<DVector<f64>> = columns.iter().map(|column| column.component_mul(&root_weights)).collect();
        let jacobian = DMatrix::from_columns(&columns);
        Ok(Self { structure, regression, solution, free, residual, jacobian })
    }

    /// Returns R₀ of each recording.
    pub(crate) fn rest_readings(&self) -> &[f64] {
        &self.solution.rest_readings
    }

    /// Returns JᵀJ, penalised as in the fit.
    pub(crate) fn normal(&self) -> DMatrix<f64> {
        let (rows, size) = self.jacobian.shape();
        let mut normal = self.jacobian.tr_mul(&self.jacobian);
        for j in self.free..size {
            normal[(j, j)] += self.structure.ridge * rows as f64 * self.jacobian.column(j).variance();
            // A column without effect has no meaningful uncertainty.
            if normal[(j, j)] <= 0.0 {
                normal[(j, j)] = 1.0;
            }
        }
        normal
    }

    /// Returns the block sandwich `A⁻¹ (Σ g_b g_bᵀ) A⁻¹`, g_b the gradient summed over a block of rows. Residuals of such laws are neither
    /// white nor of equal variance, which makes the usual `σ² A⁻¹` several times too small.
    ///
    /// Source: Liang & Zeger, *Biometrika* 73 (1986) 13.
    fn sandwich(&self) -> Option<DMatrix<f64>> {
        let size = self.jacobian.ncols();
        let mut spread = DMatrix::zeros(size, size);
        for (_, gradient) in self.blocks() {
            spread += &gradient * gradient.transpose();
        }
        let factor = Cholesky::new(self.normal())?;
        let half = factor.solve(&spread);
        Some(factor.solve(&half.transpose()) * (JACKKNIFE_BLOCKS as f64 / (JACKKNIFE_BLOCKS - 1) as f64))
    }

    /// Returns the block jackknife `(B - 1)/B Σ d_b d_bᵀ`, d_b the change of the fit when block b is left out. The sandwich takes residuals
    /// for errors; with a dozen parameters and forty blocks they are too small, which the jackknife corrects.
    ///
    /// Source: Bell & McCaffrey, *Survey Methodology* 28 (2002) 169.
    fn jackknife(&self) -> Option<DMatrix<f64>> {
        let normal = self.normal();
        let mut out = DMatrix::zeros(normal.nrows(), normal.nrows());
        for (block, gradient) in self.blocks() {
            let change = Cholesky::new(&normal - block)?.solve(&gradient);
            out += &change * change.transpose();
        }
        Some(out * ((JACKKNIFE_BLOCKS - 1) as f64 / JACKKNIFE_BLOCKS as f64))
    }

    /// Returns JᵀJ and Jᵀr of each block.
    fn blocks(&self) -> impl Iterator<Item = (DMatrix<f64>, DVector<f64>)> {
        let rows = self.jacobian.nrows();
        (0..JACKKNIFE_BLOCKS).map(move |block| {
            let (start, end) = (block * rows / JACKKNIFE_BLOCKS, (block + 1) * rows / JACKKNIFE_BLOCKS);
            let jacobian = self.jacobian.rows(start, end - start);
            (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&self.residual.rows(start, end - start)))
        })
    }

    /// Converts a covariance to the law's own units.
    fn uncertainty(&self, covariance: &DMatrix<f64>) -> Uncertainty {
        let linear = self.solution.weights.len();
        let mut point: Vec<f64> = self.solution.weights.iter().copied().collect();
        point.extend(&self.structure.nonlinear);
        let physical = |point: &[f64]| {
            let mut moved = self.structure.clone();
            moved.nonlinear.copy_from_slice(&point[linear..]);
            let law = moved.law(self.regression, &point[..linear]);
            in_own_units(law, point[0] * self.solution.rest_readings[0], point[0])
        };
        carry_over(covariance, &point, physical)
    }

    /// Returns the parameters with standard errors by the block jackknife, or by the sandwich if a fit without some block is singular.
    pub(crate) fn jackknifed(&self) -> Result<Uncertainty, CalibrationError> {
        let covariance = self.jackknife().or_else(|| self.sandwich()).ok_or(CalibrationError::Singular)?;
        Ok(self.uncertainty(&covariance))
    }

    /// Returns the parameters by name, in the law's own units.
    pub(crate) fn named(&self) -> Vec<(String, f64)> {
        let law = self.structure.law(self.regression, self.solution.weights.as_slice());
        in_own_units(law, self.solution.weights[0] * self.solution.rest_readings[0], self.solution.weights[0])
    }
}

/// Returns the covariance of `physical(point)`, given that of `point`, to first order.
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
    let full = product(&product(&slope, covariance), &slope.transpose());
    Uncertainty {
        names,
        standard_errors: (0..values.len()).map(|i| full[(i, i)].max(0.0).sqrt()).collect(),
        covariance: full.row_iter().map(|row| row.iter().copied().collect()).collect(),
        values,
    }
}

/// Returns the law's parameters by name, relative to R₀, which is `share` of the R₀ in the fit.
fn in_own_units(mut law: LawParams, rest_reading: f64, share: f64) -> Vec<(String, f64)> {
    let of_law = law.parameters_mut().into_iter().map(|LawParameter { name, value, is_over_rest }| {
        let value = *value;
        (name, if is_over_rest { value / share } else { value })
    });
    [("rest_reading".to_owned(), rest_reading)].into_iter().chain(of_law).collect()
}
