use nalgebra::{SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, NonlinearModel};
use ohmstrain_ekf::Belief;

/// Textbook filter with nalgebra's matrices: full matrices, a scalar reading, no checks.
pub struct Straight {
    model: NonlinearModel,
    mean: SVector<f64, 3>,
    covariance: SMatrix<f64, 3, 3>,
}

impl Straight {
    pub fn new(start: &Belief<f64, 3, 6>) -> Self {
        Self { model: NonlinearModel::new(), mean: start.mean, covariance: start.covariance.to_matrix() }
    }
}

impl Filter for Straight {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let p = &self.covariance;
        let ahead = self.model.ahead(self.mean.into(), [p[(0, 0)], p[(1, 0)], p[(1, 1)]]);
        let transition = SMatrix::<f64, 3, 3>::from_fn(|i, j| ahead.transition[i][j]);
        let covariance = transition * p * transition.transpose() + SMatrix::from_fn(|i, j| ahead.noise[i][j]);
        let expected = self.model.expected(ahead.mean, ahead.rate_variance);
        let gradient = SVector::from(expected.gradient);
        let spread = covariance * gradient;
        let gain = spread / (gradient.dot(&spread) + expected.variance);
        self.mean = SVector::from(ahead.mean) + gain * (reading - expected.value);
        self.covariance = covariance - gain * spread.transpose();
        true
    }

    fn strain(&self) -> f64 {
        self.mean[0]
    }
}
