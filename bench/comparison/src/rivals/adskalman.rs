use adskalman::{KalmanFilterNoControl, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl};
use nalgebra::{Const, SMatrix, SVector};
use ohmstrain_bench_filters::{Filter, LinearModel};

/// Both models of adskalman.
struct Matrices {
    transition: SMatrix<f64, 3, 3>,
    transition_transposed: SMatrix<f64, 3, 3>,
    noise: SMatrix<f64, 3, 3>,
    gradient: SMatrix<f64, 1, 3>,
    gradient_transposed: SMatrix<f64, 3, 1>,
    variance: SMatrix<f64, 1, 1>,
}

impl Matrices {
    fn new(model: &LinearModel) -> Self {
        let transition = SMatrix::from_fn(|i, j| model.transition[i][j]);
        let gradient = SMatrix::from_fn(|_, j| model.gradient[j]);
        Self {
            transition,
            transition_transposed: transition.transpose(),
            noise: SMatrix::from_fn(|i, j| model.noise[i][j]),
            gradient,
            gradient_transposed: gradient.transpose(),
            variance: SMatrix::from([[model.variance]]),
        }
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl TransitionModelLinearNoControl<f64, Const<3>> for Matrices {
    fn F(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition
    }

    fn FT(&self) -> &SMatrix<f64, 3, 3> {
        &self.transition_transposed
    }

    fn Q(&self) -> &SMatrix<f64, 3, 3> {
        &self.noise
    }
}

#[allow(non_snake_case, reason = "the names are adskalman's")]
impl ObservationModel<f64, Const<3>, Const<1>> for Matrices {
    fn H(&self) -> &SMatrix<f64, 1, 3> {
        &self.gradient
    }

    fn HT(&self) -> &SMatrix<f64, 3, 1> {
        &self.gradient_transposed
    }

    fn R(&self) -> &SMatrix<f64, 1, 1> {
        &self.variance
    }
}

fn start(model: &LinearModel) -> StateAndCovariance<f64, Const<3>> {
    StateAndCovariance::new(SVector::zeros(), SMatrix::from_diagonal(&model.start.into()))
}

/// adskalman, with the covariance in Joseph's form, its default.
pub struct Adskalman {
    matrices: Matrices,
    state: StateAndCovariance<f64, Const<3>>,
}

impl Adskalman {
    pub fn new(model: &LinearModel) -> Self {
        Self { matrices: Matrices::new(model), state: start(model) }
    }
}

impl Filter for Adskalman {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let filter = KalmanFilterNoControl::new(&self.matrices, &self.matrices);
        match filter.step(&self.state, &SVector::from([reading])) {
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

/// Returns adskalman's smoother, which gives `None` if it fails.
pub fn smoother(
    model: &LinearModel,
) -> impl Fn(&[SVector<f64, 1>]) -> Option<Vec<StateAndCovariance<f64, Const<3>>>> + use<> {
    let (matrices, start) = (Matrices::new(model), start(model));
    move |readings| KalmanFilterNoControl::new(&matrices, &matrices).smooth(&start, readings).ok()
}
