use adskalman::{KalmanFilterNoControl, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{Const, SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, NonlinearModel};
use ohmstrain_ekf::Belief;

type State = StateAndCovariance<f64, Const<3>>;

/// Both models of one step.
struct Step {
    mean: SVector<f64, 3>,
    transition: SMatrix<f64, 3, 3>,
    transition_transposed: SMatrix<f64, 3, 3>,
    noise: SMatrix<f64, 3, 3>,
    expected: f64,
    gradient: SMatrix<f64, 1, 3>,
    gradient_transposed: SMatrix<f64, 3, 1>,
    variance: SMatrix<f64, 1, 1>,
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl TransitionModelLinearNoControl<f64, Const<3>> for Step {
    fn F(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition
    }

    fn FT(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition_transposed
    }

    fn Q(&self) -> &SMatrix<f64, 3, 3> {
        &self.noise
    }

    fn predict(&self, before: &State) -> State {
        let covariance = self.transition * before.covariance() * self.transition_transposed + self.noise;
        StateAndCovariance::new(self.mean, covariance)
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl ObservationModel<f64, Const<3>, Const<1>> for Step {
    fn H(&self) -> &SMatrix<f64, 1, 3> {
        &self.gradient
    }

    fn HT(&self) -> &SMatrix<f64, 3, 1> {
        &self.gradient_transposed
    }

    fn R(&self) -> &SMatrix<f64, 1, 1> {
        &self.variance
    }

    fn predict_observation(&self, _: &SVector<f64, 3>) -> SVector<f64, 1> {
        SVector::from([self.expected])
    }
}

/// adskalman, with the covariance in Joseph's form, its default.
pub struct Adskalman {
    model: NonlinearModel,
    state: State,
}

impl Adskalman {
    pub fn new(start: &Belief<f64, 3, 6>) -> Self {
        let state = StateAndCovariance::new(start.mean, start.covariance.to_matrix());
        Self { model: NonlinearModel::new(), state }
    }
}

impl Filter for Adskalman {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let p = self.state.covariance();
        let ahead = self.model.ahead((*self.state.state()).into(), [p[(0, 0)], p[(1, 0)], p[(1, 1)]]);
        let expected = self.model.expected(ahead.mean, ahead.rate_variance);
        let transition = SMatrix::<f64, 3, 3>::from_fn(|i, j| ahead.transition[i][j]);
        let gradient = SMatrix::<f64, 1, 3>::from(expected.gradient);
        let step = Step {
            mean: ahead.mean.into(),
            transition,
            transition_transposed: transition.transpose(),
            noise: SMatrix::from_fn(|i, j| ahead.noise[i][j]),
            expected: expected.value,
            gradient,
            gradient_transposed: gradient.transpose(),
            variance: SMatrix::from([[expected.variance]]),
        };
        match KalmanFilterNoControl::new(&step, &step).step(&self.state, &SVector::from([reading])) {
            Ok(next) => {
                self.state = next;
                true
            }
            Err(_) => false,
        }
    }

    fn strain(&self) -> f64 {
        self.state.state()[0]
    }
}
