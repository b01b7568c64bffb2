use nalgebra::{SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, LinearModel};
use typed_kalman::smoother::smooth;
use typed_kalman::{Estimate, LinearKf, MeasurementModel, ProcessModel, RtsStep, Ukf};

#[derive(Clone, Copy)]
struct Matrices {
    transition: SMatrix<f64, 3, 3>,
    noise: SMatrix<f64, 3, 3>,
    gradient: SMatrix<f64, 1, 3>,
    variance: SMatrix<f64, 1, 1>,
}

impl Matrices {
    fn new(model: &LinearModel) -> Self {
        Self {
            transition: SMatrix::from_fn(|i, j| model.transition[i][j]),
            noise: SMatrix::from_fn(|i, j| model.noise[i][j]),
            gradient: SMatrix::from_fn(|_, j| model.gradient[j]),
            variance: SMatrix::from([[model.variance]]),
        }
    }
}

impl ProcessModel<3> for Matrices {
    #[inline]
    fn predict(&self, x: &SVector<f64, 3>, _: f64) -> SVector<f64, 3> {
        self.transition * x
    }
}

impl MeasurementModel<3, 1> for Matrices {
    #[inline]
    fn measure(&self, x: &SVector<f64, 3>) -> SVector<f64, 1> {
        self.gradient * x
    }
}

fn start(model: &LinearModel) -> (SVector<f64, 3>, SMatrix<f64, 3, 3>) {
    (SVector::zeros(), SMatrix::from_diagonal(&model.start.into()))
}

/// typed-kalman's linear filter, with its checks and the normalised innovation squared.
pub struct Linear {
    matrices: Matrices,
    filter: LinearKf<3>,
}

impl Linear {
    pub fn new(model: &LinearModel) -> Self {
        let (mean, covariance) = start(model);
        Self { matrices: Matrices::new(model), filter: LinearKf::new(mean, covariance) }
    }
}

impl Filter for Linear {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let Matrices { transition, noise, gradient, variance } = &self.matrices;
        self.filter.predict(transition, noise);
        self.filter.update(gradient, &SVector::from([reading]), variance).is_ok()
    }

    fn strain(&self) -> f64 {
        self.filter.state()[0]
    }
}

/// typed-kalman's unscented filter with its own parameters, α = 1, β = 2, κ = 0.
pub struct Unscented {
    matrices: Matrices,
    filter: Ukf<3>,
}

impl Unscented {
    pub fn new(model: &LinearModel) -> Self {
        let (mean, covariance) = start(model);
        Self { matrices: Matrices::new(model), filter: Ukf::new(mean, covariance) }
    }
}

impl Filter for Unscented {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        // The model already contains the step's length.
        self.filter.predict(&self.matrices, &self.matrices.noise, 0.0).is_ok()
            && self.filter.update(&self.matrices, &SVector::from([reading]), &self.matrices.variance).is_ok()
    }

    fn strain(&self) -> f64 {
        self.filter.state()[0]
    }
}

/// Returns typed-kalman's smoother, which gives `None` if it fails.
pub fn smoother(model: &LinearModel) -> impl Fn(&[f64]) -> Option<Vec<Estimate<3>>> + use<> {
    let (matrices, (mean, covariance)) = (Matrices::new(model), start(model));
    move |readings| {
        let mut filter = LinearKf::new(mean, covariance);
        let now = |filter: &LinearKf<3>| Estimate { x: *filter.state(), p: *filter.covariance() };
        let mut steps = Vec::with_capacity(readings.len());
        for reading in readings {
            filter.predict(&matrices.transition, &matrices.noise);
            let predicted = now(&filter);
            filter.update(&matrices.gradient, &SVector::from([*reading]), &matrices.variance).ok()?;
            steps.push(RtsStep { f: matrices.transition, predicted, filtered: now(&filter) });
        }
        let mut smoothed = vec![now(&filter); readings.len()];
        smooth(&steps, &mut smoothed).ok()?;
        Some(smoothed)
    }
}
