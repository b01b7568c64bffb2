use kfilter::measurement::{LinearisableMeasurement, Measurement};
use kfilter::system::{LinearisableSystem, NoInputSystem, System};
use kfilter::{Kalman, KalmanFilter, KalmanPredict, KalmanUpdate};
use nalgebra_0_34::{SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, NonlinearModel};
use ohmstrain_ekf::Belief;

/// The sensor as kfilter's system, which provides F and Q after the step.
struct Sensor {
    model: NonlinearModel,
    state: SVector<f64, 3>,
    /// Covariances of strain and rate before the step; kfilter does not pass them to a system.
    motion: [f64; 3],
    transition: SMatrix<f64, 3, 3>,
    transition_transposed: SMatrix<f64, 3, 3>,
    noise: SMatrix<f64, 3, 3>,
    rate_variance: f64,
}

impl System<f64, 3, 0> for Sensor {
    fn covariance(&self) -> &SMatrix<f64, 3, 3> {
        &self.noise
    }

    fn state(&self) -> &SVector<f64, 3> {
        &self.state
    }

    fn state_mut(&mut self) -> &mut SVector<f64, 3> {
        &mut self.state
    }
}

impl LinearisableSystem<f64, 3, 0> for Sensor {
    fn transition(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition
    }

    fn transition_transpose(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition_transposed
    }
}

impl NoInputSystem<f64, 3> for Sensor {
    #[inline]
    fn step(&mut self) -> &SVector<f64, 3> {
        let ahead = self.model.ahead(self.state.into(), self.motion);
        self.transition = SMatrix::from_fn(|i, j| ahead.transition[i][j]);
        self.transition_transposed = self.transition.transpose();
        self.noise = SMatrix::from_fn(|i, j| ahead.noise[i][j]);
        self.rate_variance = ahead.rate_variance;
        self.state = ahead.mean.into();
        &self.state
    }

    fn predict(&self, state: &SVector<f64, 3>) -> SVector<f64, 3> {
        self.model.ahead((*state).into(), self.motion).mean.into()
    }
}

struct Expected {
    value: f64,
    reading: SVector<f64, 1>,
    gradient: SMatrix<f64, 1, 3>,
    gradient_transposed: SMatrix<f64, 3, 1>,
    variance: SMatrix<f64, 1, 1>,
}

impl Measurement<f64, 3, 1> for Expected {
    fn covariance(&self) -> &SMatrix<f64, 1, 1> {
        &self.variance
    }

    fn measurement(&self) -> &SVector<f64, 1> {
        &self.reading
    }

    fn set_measurement(&mut self, reading: SVector<f64, 1>) {
        self.reading = reading;
    }

    fn predict(&self, _: &SVector<f64, 3>) -> SVector<f64, 1> {
        SVector::from([self.value])
    }
}

impl LinearisableMeasurement<f64, 3, 1> for Expected {
    fn observation(&self) -> &SMatrix<f64, 1, 3> {
        &self.gradient
    }

    fn observation_transpose(&self) -> &SMatrix<f64, 3, 1> {
        &self.gradient_transposed
    }
}

/// kfilter, with the covariance (I - K H) P, made symmetric.
pub struct Kfilter(Kalman<f64, 3, 0, Sensor>);

impl Kfilter {
    pub fn new(start: &Belief<f64, 3, 6>) -> Self {
        let sensor = Sensor {
            model: NonlinearModel::new(),
            state: SVector::from_fn(|i, _| start.mean[i]),
            motion: [0.0; 3],
            transition: SMatrix::zeros(),
            transition_transposed: SMatrix::zeros(),
            noise: SMatrix::zeros(),
            rate_variance: 0.0,
        };
        Self(Kalman::new_custom(sensor, SMatrix::from_fn(|i, j| start.covariance[(i, j)])))
    }
}

impl Filter for Kfilter {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let p = self.0.covariance();
        self.0.system.motion = [p[(0, 0)], p[(1, 0)], p[(1, 1)]];
        if self.0.predict().is_err() {
            return false;
        }
        let Sensor { model, state, rate_variance, .. } = &self.0.system;
        let expected = model.expected((*state).into(), *rate_variance);
        let gradient = SMatrix::<f64, 1, 3>::from(expected.gradient);
        let measurement = Expected {
            value: expected.value,
            reading: SVector::from([reading]),
            gradient,
            gradient_transposed: gradient.transpose(),
            variance: SMatrix::from([[expected.variance]]),
        };
        self.0.update(&measurement).is_ok()
    }

    fn strain(&self) -> f64 {
        self.0.state()[0]
    }
}
