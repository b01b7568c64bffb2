use nalgebra::{SMatrix, SVector};
use ohmstrain_bench_filters::{Ahead, Expected, Filter, NonlinearModel};
use ohmstrain_ekf::Belief;
use typed_kalman::{Ekf, MeasurementJacobian, MeasurementModel, ProcessJacobian, ProcessModel};

struct Process(Ahead);

impl ProcessModel<3> for Process {
    #[inline]
    fn predict(&self, _: &SVector<f64, 3>, _: f64) -> SVector<f64, 3> {
        self.0.mean.into()
    }
}

impl ProcessJacobian<3> for Process {
    #[inline]
    fn jacobian(&self, _: &SVector<f64, 3>, _: f64) -> SMatrix<f64, 3, 3> {
        SMatrix::from_fn(|i, j| self.0.transition[i][j])
    }
}

struct Measurement(Expected);

impl MeasurementModel<3, 1> for Measurement {
    #[inline]
    fn measure(&self, _: &SVector<f64, 3>) -> SVector<f64, 1> {
        SVector::from([self.0.value])
    }
}

impl MeasurementJacobian<3, 1> for Measurement {
    #[inline]
    fn jacobian(&self, _: &SVector<f64, 3>) -> SMatrix<f64, 1, 3> {
        SMatrix::from_fn(|_, j| self.0.gradient[j])
    }
}

/// typed-kalman's EKF, with its checks and the normalised innovation squared.
pub struct TypedKalman {
    model: NonlinearModel,
    filter: Ekf<3>,
}

impl TypedKalman {
    pub fn new(start: &Belief<f64, 3, 6>) -> Self {
        Self { model: NonlinearModel::new(), filter: Ekf::new(start.mean, start.covariance.to_matrix()) }
    }
}

impl Filter for TypedKalman {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let p = self.filter.covariance();
        let ahead = self.model.ahead((*self.filter.state()).into(), [p[(0, 0)], p[(1, 0)], p[(1, 1)]]);
        let expected = self.model.expected(ahead.mean, ahead.rate_variance);
        self.filter.predict(&Process(ahead), &SMatrix::from_fn(|i, j| ahead.noise[i][j]), 0.0);
        let variance = SMatrix::from([[expected.variance]]);
        self.filter.update(&Measurement(expected), &SVector::from([reading]), &variance).is_ok()
    }

    fn strain(&self) -> f64 {
        self.filter.state()[0]
    }
}
