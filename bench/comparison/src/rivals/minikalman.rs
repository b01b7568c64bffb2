use minikalman::prelude::*;
use minikalman::regular::builder::{KalmanFilterBuilder, KalmanFilterObservationType, KalmanFilterType};
use ohmstrain_bench_filters::{Filter, LinearModel};

/// minikalman's regular filter in the buffers of its builder.
pub struct Minikalman {
    filter: KalmanFilterType<3, f64>,
    reading: KalmanFilterObservationType<3, 1, f64>,
}

impl Minikalman {
    pub fn new(model: &LinearModel) -> Self {
        let builder = KalmanFilterBuilder::<3, f64>::default();
        let (mut filter, mut reading) = (builder.build(), builder.observations().build::<1>());
        for i in 0..3 {
            for j in 0..3 {
                filter.state_transition_mut().apply(|f| f.set_at(i, j, model.transition[i][j]));
                filter.direct_process_noise_mut().apply(|q| q.set_at(i, j, model.noise[i][j]));
                let variance = if i == j { model.start[i] } else { 0.0 };
                filter.estimate_covariance_mut().apply(|p| p.set_at(i, j, variance));
            }
            filter.state_vector_mut().apply(|x| x.set_at(i, 0, 0.0));
            reading.observation_matrix_mut().apply(|h| h.set_at(0, i, model.gradient[i]));
        }
        reading.measurement_noise_covariance_mut().apply(|r| r.set_at(0, 0, model.variance));
        Self { filter, reading }
    }
}

impl Filter for Minikalman {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        self.filter.predict();
        self.reading.measurement_vector_mut().apply(|z| z[0] = reading);
        self.filter.correct(&mut self.reading);
        true
    }

    fn strain(&self) -> f64 {
        self.filter.state_vector().as_matrix().get_at(0, 0)
    }
}
