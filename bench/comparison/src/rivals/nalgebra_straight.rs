use nalgebra::{SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, LinearModel};

/// Textbook filter with nalgebra's matrices: full matrices, a scalar reading, no checks.
pub struct Straight {
    transition: SMatrix<f64, 3, 3>,
    noise: SMatrix<f64, 3, 3>,
    gradient: SVector<f64, 3>,
    variance: f64,
    mean: SVector<f64, 3>,
    covariance: SMatrix<f64, 3, 3>,
}

impl Straight {
    pub fn new(model: &LinearModel) -> Self {
        Self {
            transition: SMatrix::from_fn(|i, j| model.transition[i][j]),
            noise: SMatrix::from_fn(|i, j| model.noise[i][j]),
            gradient: model.gradient.into(),
            variance: model.variance,
            mean: SVector::zeros(),
            covariance: SMatrix::from_diagonal(&model.start.into()),
        }
    }
}

impl Filter for Straight {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let mean = self.transition * self.mean;
        let covariance = self.transition * self.covariance * self.transition.transpose() + self.noise;
        let spread = covariance * self.gradient;
        let gain = spread / (self.gradient.dot(&spread) + self.variance);
        self.mean = mean + gain * (reading - self.gradient.dot(&mean));
        self.covariance = covariance - gain * spread.transpose();
        true
    }

    fn strain(&self) -> f64 {
        self.mean[0]
    }
}
