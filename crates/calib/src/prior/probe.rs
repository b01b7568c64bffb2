use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::dense::product;
use crate::law::regression::LawRegression;
use crate::law::robust_loss::robust;
use crate::law::structure::GaugeFamily;
use crate::law::structure::LawStructure;
use crate::samples::Samples;
use ohmstrain_sensor::{LawParameter, LawParams, Uncertainty};

/// Motion over the whole range at three speeds, with holds and smaller loops. Laws with the same readings for it count as the same.
///
/// By these readings, laws of other structures, and with other time constants, are expressed in one structure.
pub(super) struct Probe {
    regression: LawRegression,
    columns: DMatrix<f64>,
    normal: Cholesky<f64, Dyn>,
}

/// Stations of the motion, as fractions of the range; the same one twice is a hold.
const STATIONS: [f64; 11] = [0.0, 1.0, 1.0, 0.0, 0.0, 0.5, 1.0, 0.5, 0.5, 0.2, 0.0];
/// Speeds, as fractions of the fastest.
const SPEEDS: [f64; 3] = [1.0, 0.3, 0.1];
/// Number of rows from one station to the next.
const LEG_ROWS: usize = 60;
/// Duration of a hold, in movements over the whole range.
const HOLD: f64 = 2.0;
/// Ridge that keeps collinear columns from making the equations singular, relative to their variance.
const RIDGE: f64 = 1e-6;
/// Step of the derivatives, relative to a parameter.
const STEP: f64 = 1e-4;

impl Probe {
    /// Creates the probe for laws with these time constants; `fastest` is in 1/s.
    pub(super) fn new(range: StrainRange<f64>, fastest: f64, tau_s: &[f64]) -> Result<Self, CalibrationError> {
        let (time_s, strain) = motion(range, fastest);
        // The values of the readings do not matter, as long as they vary.
        let reading: Vec<f64> = strain.iter().map(|strain| 1.0 + (strain - range.lower) / range.span()).collect();
        let samples = Samples::new(&time_s, &reading, &strain)?;
        let regression = robust(LawRegression::new(&[samples])?);
        let structure = common(tau_s);
        let design = structure.design(&regression);
        let columns = DMatrix::from_columns(&design.columns[design.free..]);
        let mut normal = columns.tr_mul(&columns);
        for j in 0..normal.nrows() {
            normal[(j, j)] *= 1.0 + RIDGE;
        }
        let normal = Cholesky::new(normal).ok_or(CalibrationError::Singular)?;
        Ok(Self { regression, columns, normal })
    }

    /// Returns the weights of the common structure whose readings are nearest to those of this law.
    pub(super) fn weights(&self, law: &LawParams) -> DVector<f64> {
        let structure = LawStructure::of_law(law, self.regression.scale.span, 0.0);
        let fitted = structure.design(&self.regression).fitted(&structure.weights(law, self.regression.scale));
        self.normal.solve(&self.columns.tr_mul(&fitted))
    }

    /// Returns the covariance of those weights, given that of the law's parameters; undetermined parameters are treated as known.
    pub(super) fn errors(&self, law: &LawParams, uncertainty: &Uncertainty) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(self.columns.ncols(), uncertainty.names.len());
        for (j, name) in uncertainty.names.iter().enumerate() {
            let moved = |sign: f64| {
                let mut law = law.clone();
                let LawParameter { value, .. } = law.parameters_mut().into_iter().find(|own| own.name == *name)?;
                let step = STEP * value.abs().max(STEP);
                *value += sign * step;
                Some((self.weights(&law), step))
            };
            if let (Some((up, step)), Some((down, _))) = (moved(1.0), moved(-1.0)) {
                slopes.set_column(j, &((up - down) / (2.0 * step)));
            }
        }
        let size = uncertainty.names.len();
        let covariance = DMatrix::from_fn(size, size, |i, j| uncertainty.covariance[i][j]);
        product(&product(&slopes, &covariance), &slopes.transpose())
    }
}

/// Returns a cubic gauge with branches that have these time constants.
pub(super) fn common(tau_s: &[f64]) -> LawStructure {
    let nonlinear = tau_s.iter().map(|tau_s| tau_s.ln()).collect();
    LawStructure { family: GaugeFamily::Polynomial, nonlinear, taus: tau_s.len(), ridge: 0.0 }
}

fn motion(range: StrainRange<f64>, fastest: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut time_s, mut strain) = (vec![0.0], vec![range.lower]);
    let mut now_s = 0.0;
    for speed in SPEEDS {
        let whole_s = range.span() / (speed * fastest);
        for leg in STATIONS.windows(2) {
            let way = leg[1] - leg[0];
            let duration_s = whole_s * if way == 0.0 { HOLD } else { way.abs() };
            for k in 1..=LEG_ROWS {
                let share = k as f64 / LEG_ROWS as f64;
                time_s.push(now_s + share * duration_s);
                strain.push(range.lower + range.span() * (leg[0] + share * way));
            }
            now_s += duration_s;
        }
    }
    (time_s, strain)
}
