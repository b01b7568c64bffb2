//! Joint fit of motion and law: the most probable motion given the readings, with its covariance.

use nalgebra::{Cholesky, DMatrix, DVector};
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::law::design::StrainScale;
use crate::law::fit::{LawOptions, structure_on_grid};
use crate::law::regression::LawRegression;
use crate::law::structure::LawStructure;
use crate::marks::motion::MarkedMotion;
use crate::order::median;
use crate::samples::Samples;

/// Largest number of rows in the fit.
const MOST_ROWS: usize = 1000;
/// Number of independent readings to which the rows of a move amount: a law's errors last as long as a move and recur in similar moves.
/// With 1 to 4 the stated deviations held on four recordings of six, with 16 on none.
const READINGS_OF_MOVE: f64 = 2.0;
/// Multiple of the median move's mean squared misfit above which a move is irregular.
const IRREGULAR: f64 = 4.0;
/// Ridge of the law, which keeps any regressor from serving a single move.
const RIDGE: f64 = 0.01;
/// Largest number of Gauss-Newton steps, and number of steps after which time constants are fitted again.
const STEPS: usize = 8;
const TAUS_EVERY: usize = 4;
/// Longest step of a parameter, in standard deviations of its prior, and smallest fraction of a step that is tried.
const LONGEST: f64 = 1.5;
const LEAST_FRACTION: f64 = 0.02;
/// Decrease of the cost below which the descent ends.
const TOLERANCE: f64 = 0.05;
/// Step of finite differences, in standard deviations of the prior.
const DIFFERENCE: f64 = 1e-3;

/// A fitted motion, with the covariance of its parameters.
pub(crate) struct Fitted {
    pub motion: MarkedMotion,
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// A recording with an unknown motion.
struct Problem<'a> {
    time_s: &'a [f64],
    reading: &'a [f64],
    /// Range of the marks' strains, by which the law is scaled.
    range: StrainRange<f64>,
    /// Readings over their median in the complete rows.
    response: DVector<f64>,
    /// Index of the move of each complete row. Such rows have a reading and lie between the first mark and the last.
    of_move: Vec<usize>,
    /// Number of complete rows in each move.
    rows_of_move: Vec<f64>,
}

/// Fits `motion`. Moves that the law does not explain as regular ones become irregular.
pub(crate) fn fit(
    samples: &Samples,
    mut motion: MarkedMotion,
    range: StrainRange<f64>,
) -> Result<Fitted, CalibrationError> {
    let stride = samples.len().div_ceil(MOST_ROWS).max(1);
    let thinned = |values: &[f64]| values.iter().copied().step_by(stride).collect::<Vec<f64>>();
    let (time_s, reading) = (thinned(samples.time_s), thinned(samples.reading));
    let problem = Problem::new(&time_s, &reading, &motion, range)?;
    let none = DVector::zeros(motion.parameters());
    let structure = problem.structure(&motion, &none)?;
    let misfits = problem.misfits_of_moves(&problem.design(&structure, &motion, &none)?, structure.ridge)?;
    let typical = typical(&misfits);
    let irregular: Vec<usize> = (0..misfits.len()).filter(|&k| misfits[k] > IRREGULAR * typical).collect();
    motion.make_irregular(&irregular, samples);
    let (parameters, covariance) = problem.descend(&motion, structure, typical)?;
    Ok(Fitted { motion, parameters, covariance })
}

impl Fitted {
    /// Returns strains and their standard deviations at these times; NaN before the first mark and after the last.
    pub(crate) fn strains(&self, time_s: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut strains, mut sds) = (Vec::with_capacity(time_s.len()), Vec::with_capacity(time_s.len()));
        // In chunks, because derivatives of all rows with respect to all parameters would take gigabytes.
        for time_s in time_s.chunks(MOST_ROWS) {
            let here = self.motion.strains(&self.parameters, time_s);
            let slopes = slopes(&self.parameters, &here, |z| self.motion.strains(z, time_s));
            let spread = &slopes * &self.covariance;
            let variance = |k: usize| spread.row(k).dot(&slopes.row(k)).max(0.0);
            let sd = |(k, t): (usize, &f64)| self.motion.shape_sd(*t).hypot(variance(k).sqrt());
            // Keeps NaN: the maximum of zero and NaN is zero.
            let known = |(sd, strain): (f64, &f64)| if strain.is_finite() { sd } else { f64::NAN };
            sds.extend(time_s.iter().enumerate().map(sd).zip(&here).map(known));
            strains.extend(here);
        }
        (strains, sds)
    }
}

/// Returns the derivatives of `of` with respect to each parameter, by finite differences.
fn slopes(parameters: &DVector<f64>, here: &[f64], of: impl Fn(&DVector<f64>) -> Vec<f64>) -> DMatrix<f64> {
    let mut slopes = DMatrix::zeros(here.len(), parameters.len());
    for j in 0..parameters.len() {
        let mut moved = parameters.clone();
        moved[j] += DIFFERENCE;
        for (k, (there, here)) in of(&moved).iter().zip(here).enumerate() {
            slopes[(k, j)] = (there - here) / DIFFERENCE;
        }
    }
    slopes
}

/// Returns the median of the moves' mean squared misfits.
fn typical(misfits: &[f64]) -> f64 {
    median(misfits.iter().copied().filter(|m| m.is_finite())).unwrap_or(f64::NAN)
}

impl<'a> Problem<'a> {
    fn new(
        time_s: &'a [f64],
        reading: &'a [f64],
        motion: &MarkedMotion,
        range: StrainRange<f64>,
    ) -> Result<Self, CalibrationError> {
        let place = |k: usize| motion.move_at(time_s[k]).filter(|_| reading[k].is_finite()).map(|of_move| (k, of_move));
        let (complete, of_move): (Vec<usize>, Vec<usize>) = (0..time_s.len()).filter_map(place).unzip();
        let mut rows_of_move = vec![0.0; motion.moves()];
        for &k in &of_move {
            rows_of_move[k] += 1.0;
        }
        let Some(middle) = median(complete.iter().map(|&k| reading[k])) else {
            return Err(CalibrationError::NoRecording);
        };
        let response = DVector::from_iterator(complete.len(), complete.iter().map(|&k| reading[k] / middle));
        Ok(Self { time_s, reading, range, response, of_move, rows_of_move })
    }

    /// Calls `of` with samples whose reference is the motion's strains.
    fn with_samples<T>(&self, motion: &MarkedMotion, z: &DVector<f64>, of: impl FnOnce(&Samples) -> T) -> T {
        let strain = motion.strains(z, self.time_s);
        of(&Samples { time_s: self.time_s, reading: self.reading, strain: &strain, strain_sd: &[] })
    }

    /// Returns the law's structure, with a ridge that keeps any regressor from serving a single move.
    fn structure(&self, motion: &MarkedMotion, z: &DVector<f64>) -> Result<LawStructure, CalibrationError> {
        structure_on_grid(&self.regression(motion, z)?, LawOptions::default(), RIDGE)
    }

    fn regression(&self, motion: &MarkedMotion, z: &DVector<f64>) -> Result<LawRegression, CalibrationError> {
        let scale = StrainScale::of(self.range.lower, self.range.upper);
        self.with_samples(motion, z, |samples| LawRegression::on_scale(&[*samples], scale, self.range))
    }

    /// Returns the columns of the law for a motion, in the complete rows.
    fn design(
        &self,
        structure: &LawStructure,
        motion: &MarkedMotion,
        z: &DVector<f64>,
    ) -> Result<DMatrix<f64>, CalibrationError> {
        Ok(DMatrix::from_columns(&structure.design(&self.regression(motion, z)?).columns))
    }

    /// Returns the mean squared misfit of each move by a law that was fitted without it.
    fn misfits_of_moves(&self, design: &DMatrix<f64>, ridge: f64) -> Result<Vec<f64>, CalibrationError> {
        let without = |left_out: usize| {
            let weight = |of_move: &usize| f64::from(u8::from(*of_move != left_out));
            let weights = DVector::from_iterator(self.of_move.len(), self.of_move.iter().map(weight));
            let law = Weighted::new(design, &weights, ridge).fit(&self.response).ok_or(CalibrationError::Singular)?;
            Ok(self.means_of_moves(&(&self.response - design * law))[left_out])
        };
        (0..self.rows_of_move.len()).map(without).collect()
    }

    /// Returns the mean square of the rows of each move; NaN for a move without a row.
    fn means_of_moves(&self, residual: &DVector<f64>) -> Vec<f64> {
        let mut sums = vec![0.0; self.rows_of_move.len()];
        for (r, &k) in residual.iter().zip(&self.of_move) {
            sums[k] += r * r;
        }
        sums.iter().zip(&self.rows_of_move).map(|(sum, rows)| sum / rows).collect()
    }

    /// Runs Gauss-Newton from the marks as given. Returns the parameters and their covariance, which includes the law's uncertainty.
    /// `variance` is that of the law's error.
    fn descend(
        &self,
        motion: &MarkedMotion,
        mut structure: LawStructure,
        variance: f64,
    ) -> Result<(DVector<f64>, DMatrix<f64>), CalibrationError> {
        let weight = |k: &usize| READINGS_OF_MOVE / (variance * self.rows_of_move[*k]);
        let weights = DVector::from_iterator(self.of_move.len(), self.of_move.iter().map(weight));
        let mut z = DVector::zeros(motion.parameters());
        let mut last = None;
        for step in 0..STEPS {
            if step > 0 && step % TAUS_EVERY == 0 {
                structure = self.structure(motion, &z)?;
            }
            let here = Linear::new(self, (motion, &structure), &z, &weights)?;
            let (direction, covariance) = here.step(&z).ok_or(CalibrationError::Singular)?;
            last = Some(covariance);
            let longest = direction.amax();
            let mut fraction = if longest > LONGEST { LONGEST / longest } else { 1.0 };
            let cost = |z: &DVector<f64>| self.cost((motion, &structure), z, &weights);
            let before = cost(&z)?;
            let mut next = &z + fraction * &direction;
            let mut after = cost(&next)?;
            while after > before && fraction > LEAST_FRACTION {
                fraction *= 0.5;
                next = &z + fraction * &direction;
                after = cost(&next)?;
            }
            if after < before {
                z = next;
            }
            if before - after < TOLERANCE {
                break;
            }
        }
        Ok((z, last.ok_or(CalibrationError::Singular)?))
    }

    /// Returns half the weighted squares, penalties included, at the best law for this motion.
    fn cost(
        &self,
        (motion, structure): (&MarkedMotion, &LawStructure),
        z: &DVector<f64>,
        weights: &DVector<f64>,
    ) -> Result<f64, CalibrationError> {
        let design = self.design(structure, motion, z)?;
        let weighted = Weighted::new(&design, weights, structure.ridge);
        let law = weighted.fit(&self.response).ok_or(CalibrationError::Singular)?;
        let residual = &self.response - &design * &law;
        let squares = residual.component_mul(&residual).dot(weights);
        Ok(0.5 * (squares + weighted.penalty.component_mul(&law).dot(&law) + z.norm_squared()))
    }
}

/// Weighted ridge regression on the columns of a law; the constant, which comes first, is free.
struct Weighted<'a> {
    design: &'a DMatrix<f64>,
    weights: &'a DVector<f64>,
    penalty: DVector<f64>,
}

impl<'a> Weighted<'a> {
    /// Prepares the regression; `ridge` is relative to the variance of each column.
    fn new(design: &'a DMatrix<f64>, weights: &'a DVector<f64>, ridge: f64) -> Self {
        let whole = weights.sum();
        let of_column = |(k, column): (usize, nalgebra::DVectorView<f64>)| {
            if k == 0 { 0.0 } else { ridge * whole * column.variance() }
        };
        let penalty = DVector::from_iterator(design.ncols(), design.column_iter().enumerate().map(of_column));
        Self { design, weights, penalty }
    }

    fn fit(&self, response: &DVector<f64>) -> Option<DVector<f64>> {
        let weighted = scaled_rows(self.design, self.weights);
        let normal = self.design.tr_mul(&weighted) + DMatrix::from_diagonal(&self.penalty);
        Some(Cholesky::new(normal)?.solve(&weighted.tr_mul(response)))
    }
}

fn scaled_rows(matrix: &DMatrix<f64>, weights: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = matrix.clone();
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(weights);
    }
    scaled
}

/// Law and motion, linearised together.
struct Linear<'a> {
    /// Derivatives with respect to the law's weights, then the motion's parameters.
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    weights: &'a DVector<f64>,
    penalty: DVector<f64>,
    law: DVector<f64>,
}

impl<'a> Linear<'a> {
    fn new(
        problem: &Problem,
        (motion, structure): (&MarkedMotion, &LawStructure),
        z: &DVector<f64>,
        weights: &'a DVector<f64>,
    ) -> Result<Self, CalibrationError> {
        let design = problem.design(structure, motion, z)?;
        let weighted = Weighted::new(&design, weights, structure.ridge);
        let law = weighted.fit(&problem.response).ok_or(CalibrationError::Singular)?;
        let penalty = weighted.penalty;
        let fitted = &design * &law;
        let residual = &problem.response - &fitted;
        let (rows, of_law) = design.shape();
        let mut jacobian = design.resize_horizontally(of_law + z.len(), 0.0);
        for j in 0..z.len() {
            let mut moved = z.clone();
            moved[j] += DIFFERENCE;
            let change = (problem.design(structure, motion, &moved)? * &law - &fitted) / DIFFERENCE;
            jacobian.view_mut((0, of_law + j), (rows, 1)).copy_from(&change);
        }
        Ok(Self { jacobian, residual, weights, penalty, law })
    }

    /// Returns the step of the motion's parameters, and their covariance.
    fn step(&self, z: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let of_law = self.law.len();
        let weighted = scaled_rows(&self.jacobian, self.weights);
        let mut normal = self.jacobian.tr_mul(&weighted);
        let mut gradient = weighted.tr_mul(&self.residual);
        for k in 0..normal.nrows() {
            let (penalty, at) = if k < of_law { (self.penalty[k], self.law[k]) } else { (1.0, z[k - of_law]) };
            normal[(k, k)] += penalty;
            gradient[k] -= penalty * at;
        }
        let factor = Cholesky::new(normal)?;
        let step = factor.solve(&gradient).rows(of_law, z.len()).into_owned();
        let covariance = factor.inverse().view((of_law, of_law), (z.len(), z.len())).into_owned();
        Some((step, covariance))
    }
}
