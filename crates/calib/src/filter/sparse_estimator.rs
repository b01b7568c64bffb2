use ohmstrain_ekf::{Advanced, Belief, Ekf, Estimator, Innovation, Logistic, Reading, SparseEkf, StepError};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

/// The EKF of a sensor on Ornstein-Uhlenbeck motion, stepped forward without multiplying zeros. Agrees with
/// [`Ekf`] to rounding; where it refuses a step, and on the way back, `Ekf` decides.
#[derive(Clone, Copy)]
pub(crate) struct SparseEstimator<const B: usize, const N: usize> {
    model: SwitchedModel<f64, B, N>,
}

/// A step of one length for both.
#[derive(Clone, Copy)]
pub(crate) struct SparseStep<const B: usize, const N: usize> {
    dense: SwitchedStep<f64, B>,
    /// `None` for what is no length of a step.
    sparse: Option<SparseEkf<f64, Logistic, B, N>>,
}

impl<const B: usize, const N: usize> SparseEstimator<B, N> {
    pub(crate) const fn new(model: SwitchedModel<f64, B, N>) -> Self {
        Self { model }
    }

    const fn dense(&self) -> Ekf<SwitchedModel<f64, B, N>> {
        Ekf::new(self.model)
    }
}

impl<const B: usize, const N: usize, const L: usize> Estimator<f64, N, L> for SparseEstimator<B, N> {
    type State = Belief<f64, N, L>;
    type Prepared = SparseStep<B, N>;

    fn longest_step_s(&self) -> f64 {
        self.model.longest_step_s()
    }

    fn prepare(&self, dt_s: f64) -> SparseStep<B, N> {
        SparseStep { dense: self.model.prepare(dt_s), sparse: SparseEkf::new(self.model, dt_s).ok() }
    }

    fn advance(
        &self,
        state: &Belief<f64, N, L>,
        prepared: &SparseStep<B, N>,
        reading: Option<Reading<f64>>,
    ) -> Result<Advanced<Belief<f64, N, L>, f64>, StepError> {
        let mut next = *state;
        match prepared.sparse.as_ref().map(|sparse| sparse.step(&mut next, reading)) {
            // What overflows a square is no reading, even where the state can take it.
            Some(Ok(residual)) if residual.is_none_or(|residual| residual.nis.is_finite()) => {
                let innovation = residual.map(|residual| Innovation {
                    value: residual.innovation,
                    variance: residual.variance,
                    nis: residual.nis,
                    log_likelihood: residual.log_likelihood(),
                });
                Ok(Advanced { state: next, innovation })
            }
            _ => self.dense().advance(state, &prepared.dense, reading),
        }
    }

    fn smooth_back(
        &self,
        filtered: &Belief<f64, N, L>,
        prepared: &SparseStep<B, N>,
        reading: Option<Reading<f64>>,
        next: &Belief<f64, N, L>,
    ) -> Result<Option<Belief<f64, N, L>>, StepError> {
        self.dense().smooth_back(filtered, &prepared.dense, reading, next)
    }
}
