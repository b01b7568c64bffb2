use std::marker::PhantomData;

use ohmstrain_ekf::{
    Advanced, AnyCurve, Belief, Channel, Curve, Dynamics, Ekf, Estimator, Innovation, Logistic, Reading, SigmaPoints,
    SparseEkf, StepError, Unscented,
};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

/// The EKF of a sensor on Ornstein-Uhlenbeck motion, stepped forward without multiplying zeros: by tangents of the gauge, or by its
/// sigma points `G`. Where it refuses a step, and on the way back, the [`Ekf`] of matrices of model `M` decides.
#[derive(Clone, Copy)]
pub(crate) struct SparseEstimator<M, G, const B: usize, const N: usize> {
    model: SwitchedModel<f64, B, N>,
    dense: Ekf<M>,
    curve: PhantomData<G>,
}

/// A step of one length for both.
#[derive(Clone, Copy)]
pub(crate) struct SparseStep<G, const B: usize, const N: usize> {
    dense: SwitchedStep<f64, B>,
    /// `None` for what is no length of a step.
    sparse: Option<SparseEkf<f64, Logistic, B, N, G>>,
}

impl<const B: usize, const N: usize> SparseEstimator<SwitchedModel<f64, B, N>, AnyCurve<f64>, B, N> {
    /// The extended filter; agrees with [`Ekf`] to rounding.
    pub(crate) const fn extended(model: SwitchedModel<f64, B, N>) -> Self {
        Self { model, dense: Ekf::new(model), curve: PhantomData }
    }
}

impl<const B: usize, const N: usize>
    SparseEstimator<Unscented<SwitchedModel<f64, B, N>>, SigmaPoints<AnyCurve<f64>>, B, N>
{
    /// The unscented filter.
    pub(crate) const fn unscented(model: SwitchedModel<f64, B, N>) -> Self {
        Self { model, dense: Ekf::new(Unscented::new(model)), curve: PhantomData }
    }
}

impl<M, G, const B: usize, const N: usize, const L: usize> Estimator<f64, N, L> for SparseEstimator<M, G, B, N>
where
    M: Dynamics<f64, N, L, Prepared = SwitchedStep<f64, B>> + Channel<f64, N, L>,
    G: Curve<f64>,
{
    type State = Belief<f64, N, L>;
    type Prepared = SparseStep<G, B, N>;

    fn longest_step_s(&self) -> f64 {
        self.model.longest_step_s()
    }

    fn prepare(&self, dt_s: f64) -> SparseStep<G, B, N> {
        SparseStep { dense: self.model.prepare(dt_s), sparse: SparseEkf::new(self.model, dt_s).ok() }
    }

    fn advance(
        &self,
        state: &Belief<f64, N, L>,
        prepared: &SparseStep<G, B, N>,
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
            _ => self.dense.advance(state, &prepared.dense, reading),
        }
    }

    fn smooth_back(
        &self,
        filtered: &Belief<f64, N, L>,
        prepared: &SparseStep<G, B, N>,
        reading: Option<Reading<f64>>,
        next: &Belief<f64, N, L>,
    ) -> Result<Option<Belief<f64, N, L>>, StepError> {
        self.dense.smooth_back(filtered, &prepared.dense, reading, next)
    }
}
