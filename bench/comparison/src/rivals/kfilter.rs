use kfilter::measurement::{LinearMeasurement, Measurement};
use kfilter::system::LinearNoInputSystem;
use kfilter::{
    Kalman1M, Kalman1MLinearNoInput, KalmanFilter, KalmanPredict, KalmanUpdate, UKFLinearNoInput, UKFParameters,
};
use nalgebra_0_34::{SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, LinearModel};

fn system(model: &LinearModel) -> LinearNoInputSystem<f64, 3> {
    LinearNoInputSystem::new(
        SMatrix::from_fn(|i, j| model.transition[i][j]),
        SMatrix::from_fn(|i, j| model.noise[i][j]),
        SVector::zeros(),
    )
}

fn measurement(model: &LinearModel) -> LinearMeasurement<f64, 3, 1> {
    let gradient = SMatrix::from_fn(|_, j| model.gradient[j]);
    LinearMeasurement::new(gradient, SMatrix::from([[model.variance]]), SVector::zeros())
}

fn covariance(model: &LinearModel) -> SMatrix<f64, 3, 3> {
    SMatrix::from_diagonal(&model.start.into())
}

/// kfilter's linear filter, with the covariance (I - K H) P, made symmetric.
pub struct Linear(Kalman1MLinearNoInput<f64, 3, 1>);

impl Linear {
    pub fn new(model: &LinearModel) -> Self {
        Self(Kalman1M::new_custom(system(model), covariance(model), measurement(model)))
    }
}

impl Filter for Linear {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        self.0.predict().is_ok() && self.0.update(SVector::from([reading])).is_ok()
    }

    fn strain(&self) -> f64 {
        self.0.state()[0]
    }
}

/// kfilter's unscented filter with α = 1, β = 2, κ = 0, as in the others; its own α of 10⁻³ loses digits.
pub struct Unscented {
    filter: UKFLinearNoInput<f64, 3, 7>,
    measurement: LinearMeasurement<f64, 3, 1>,
}

impl Unscented {
    pub fn new(model: &LinearModel) -> Self {
        let parameters = UKFParameters::new(1.0, 2.0, 0.0).expect("the parameters are valid");
        let filter = UKFLinearNoInput::new_custom_with_params(system(model), covariance(model), parameters);
        Self { filter, measurement: measurement(model) }
    }
}

impl Filter for Unscented {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        self.measurement.set_measurement(SVector::from([reading]));
        self.filter.predict().is_ok() && self.filter.update(&self.measurement).is_ok()
    }

    fn strain(&self) -> f64 {
        self.filter.state()[0]
    }
}
