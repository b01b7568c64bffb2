use nalgebra::{Cholesky, DMatrix, DVector};
use ohmstrain_model::StrainRange;
use serde::{Deserialize, Serialize};

use super::probe::common;
use crate::CalibrationError;
use crate::law::design::StrainScale;
use crate::law::fit::CrossFit;
use crate::law::regression::{Design, LawRegression, VALIDATION_BLOCKS};
use crate::law::robust_loss::robust;
use crate::law::structure::{LawFit, LawStructure};
use crate::samples::{Samples, usual_step_s};

/// The law of one more sensor of the make: a cubic gauge and branches with the make's time constants.
///
/// The law is linear in all other parameters, which therefore have a normal posterior in closed form. A sensor that relaxes faster or
/// slower than the make differs in its gains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawPrior {
    /// Strains of the make, by which `mean` is scaled. In powers of the gauge and in dash-pots, x is the strain over the span; in gains
    /// that grow with strain, it is the distance from the middle over the span.
    pub range: StrainRange<f64>,
    /// Time constants, s, fastest first.
    pub tau_s: Vec<f64>,
    /// Spectral density of the law's residual at low frequency, s, one-sided in time: variance, relative to R₀, times twice the correlation
    /// time.
    pub error_density_s: f64,
    /// Mean of: gauge x, x², x³; dash-pots per span and second, stretching and releasing; for every branch the gains, stretching and
    /// releasing, and their growth with strain. Changes of resistance relative to R₀.
    pub mean: Vec<f64>,
    /// Covariance of one more sensor's weights, row by row.
    pub covariance: Vec<Vec<f64>>,
}

impl LawPrior {
    fn scale(&self) -> StrainScale {
        StrainScale::of(self.range.lower, self.range.upper)
    }

    /// Returns the most probable law of recordings, and those without each of their blocks.
    ///
    /// # Errors
    /// If the recordings are too short, or the equations are singular.
    pub(crate) fn posterior(&self, recordings: &[Samples]) -> Result<CrossFit, CalibrationError> {
        let regression = robust(LawRegression::on_scale(recordings, self.scale(), self.range)?);
        let problem = Posterior::new(self, &regression, row_step_s(recordings, &regression))?;
        let without_block = (0..VALIDATION_BLOCKS).map(|block| problem.fit(Some(block))).collect::<Result<_, _>>()?;
        Ok(CrossFit { law: problem.fit(None)?, without_block, blocks: regression.block_rows() })
    }
}

/// Returns the time between rows of the regression, s, which may be thinned.
fn row_step_s(recordings: &[Samples], regression: &LawRegression) -> f64 {
    let all: usize = recordings.iter().map(Samples::len).sum();
    let taken: usize = regression.recordings.iter().map(|recording| recording.complete.len()).sum();
    usual_step_s(recordings.iter().map(|samples| samples.time_s)) * all as f64 / taken.max(1) as f64
}

/// Readings as `R₀ (1 + X μ + X δ)`, with δ normal around zero; R₀ keeps the scale of the mean right in one pass.
struct Posterior<'a> {
    structure: LawStructure,
    regression: &'a LawRegression,
    design: Design,
    mean: DVector<f64>,
    /// Precision of δ relative to that of a row.
    precision: DMatrix<f64>,
}

impl<'a> Posterior<'a> {
    fn new(prior: &LawPrior, regression: &'a LawRegression, step_s: f64) -> Result<Self, CalibrationError> {
        let structure = common(&prior.tau_s);
        let mut design = structure.design(regression);
        let mean = DVector::from_column_slice(&prior.mean);
        let size = mean.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| prior.covariance[i][j]);
        let of_mean = design.columns[design.free..].iter().zip(mean.iter());
        let of_mean = of_mean.fold(DVector::from_element(design.offset.len(), 1.0), |sum, (x, w)| sum + x * *w);
        for column in &mut design.columns[..design.free] {
            column.component_mul_assign(&of_mean);
        }
        // Rows that are closer than the correlation time of their errors count as one.
        let row_variance = prior.error_density_s / step_s;
        let precision = Cholesky::new(covariance).ok_or(CalibrationError::Singular)?.inverse() * row_variance;
        Ok(Self { structure, regression, design, mean, precision })
    }

    fn fit(&self, left_out: Option<usize>) -> Result<LawFit, CalibrationError> {
        let regression = self.regression;
        let blocks = regression.left_out(left_out);
        let fitted = regression.with_own_rests(&self.design, |normal| normal.fit_normal(&self.precision, &blocks));
        let (weights, rest_readings, normal) = fitted.ok_or(CalibrationError::Singular)?;
        let residual = regression.response(&rest_readings) - self.design.fitted(&weights);
        let mut of_law = weights.clone();
        let free = self.design.free;
        of_law.rows_mut(free, self.mean.len()).zip_apply(&self.mean, |own, mean| *own += mean);
        let all: Vec<usize> = (0..self.design.columns.len()).collect();
        let cross_validated = normal.left_out_variance(&all, |block| normal.fit_normal(&self.precision, &[block]));
        Ok(LawFit {
            law: self.structure.law(regression, of_law.as_slice()),
            rest_readings,
            residuals: regression.by_recording(&residual),
            cross_validated_error: cross_validated.ok_or(CalibrationError::Singular)?.sqrt(),
            ridge: 0.0,
        })
    }
}
