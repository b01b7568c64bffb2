//! Jacobians by dual numbers beside those by hand.

use nalgebra::{Matrix2, SVector, Vector1, Vector2, matrix, vector};
use ohmstrain_ekf::kalman::{ByDual, Differentiable, Ekf, Filter, Model, Normal};
use ohmstrain_model::Scalar;

struct Pendulum {
    dt_s: f64,
}

impl<T: Scalar> Model<T, 2, 1> for Pendulum {
    fn transition(&self, x: &SVector<T, 2>) -> SVector<T, 2> {
        let dt_s = T::of(self.dt_s);
        SVector::from([x[0] + x[1] * dt_s, x[1] - T::of(9.81) * x[0].sin() * dt_s])
    }

    fn reading(&self, x: &SVector<T, 2>) -> SVector<T, 1> {
        SVector::from([x[0].sin() * x[1]])
    }
}

#[test]
fn jacobians_are_those_by_hand() {
    let by_hand = |x: &Vector2<f64>| -> (Matrix2<f64>, _) {
        (matrix![1.0, 0.05; -9.81 * x[0].cos() * 0.05, 1.0], matrix![x[0].cos() * x[1], x[0].sin()])
    };
    let model = ByDual(Pendulum { dt_s: 0.05 });
    for x in [vector![0.3, -1.0], vector![-2.0, 0.4]] {
        let (transition, reading) = by_hand(&x);
        // A product or two each.
        assert!((model.transition_jacobian(&x) - transition).amax() < 4.0 * f64::EPSILON);
        assert!((model.reading_jacobian(&x) - reading).amax() < 4.0 * f64::EPSILON);
        let single = x.cast::<f32>();
        assert!((model.reading_jacobian(&single).cast::<f64>() - reading).amax() < 1e-6);
    }
    let state = Normal::independent(vector![0.3, -1.0], &vector![0.1, 0.2]).unwrap();
    let step = Ekf::new(model, matrix![0.0, 0.0; 0.0, 0.1], matrix![0.1]).step(&state, &[Some(0.2)]).unwrap();
    let expected: Vector1<f64> = Pendulum { dt_s: 0.05 }.reading(&step.prior.mean);
    assert!((step.innovation[0] - (0.2 - expected[0])).abs() < f64::EPSILON);
}
