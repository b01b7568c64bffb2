use ohmstrain_ekf::{
    Advanced, Belief, Dwell, Ekf, Estimator, Evidence, Hypotheses, Innovation, Logistic, Mixture, MixtureResidual,
    Reading, SignSplit, SparseEkf, SparseHypotheses, SparseMixture, SparseSignSplit, StepError,
};
use ohmstrain_model::{SwitchedModel, SwitchedStep};

use crate::build_filter::{HISTORIES, HYPOTHESES};

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
    /// `None` for a step of no length.
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

/// A filter of hypotheses, with and without the multiplications by zero.
pub(crate) trait Pair<const N: usize, const L: usize, const K: usize>: Copy {
    /// Steps of one length.
    type Sparse: Copy;
    type Dense: Estimator<f64, N, L, State = Mixture<f64, N, L, K>>;

    fn dense(&self) -> Self::Dense;

    /// # Errors
    /// If a step of this length does not move.
    fn sparse(&self, dt_s: f64) -> Result<Self::Sparse, StepError>;

    fn step(
        sparse: &Self::Sparse,
        state: &SparseMixture<f64, N, L, K>,
        reading: Option<Reading<f64>>,
        next: &mut SparseMixture<f64, N, L, K>,
    ) -> Result<Option<MixtureResidual<f64>>, StepError>;

    /// One step backwards along what [`Self::step`] did.
    fn smooth_back(
        &self,
        sparse: &Self::Sparse,
        step: &<Self::Dense as Estimator<f64, N, L>>::Prepared,
        filtered: &SparseMixture<f64, N, L, K>,
        reading: Option<Reading<f64>>,
        next: &SparseMixture<f64, N, L, K>,
    ) -> Result<SparseMixture<f64, N, L, K>, StepError>;
}

/// Phase histories of a sensor on Ornstein-Uhlenbeck motion.
#[derive(Clone, Copy)]
pub(crate) struct Histories<const B: usize, const N: usize> {
    pub model: SwitchedModel<f64, B, N>,
    pub dwell: Dwell<f64>,
    pub evidence: Evidence<f64>,
}

impl<const B: usize, const N: usize, const L: usize> Pair<N, L, HISTORIES> for Histories<B, N> {
    type Sparse = SparseHypotheses<f64, B, N, HISTORIES>;
    type Dense = Hypotheses<f64, SwitchedModel<f64, B, N>, HISTORIES>;

    fn dense(&self) -> Self::Dense {
        Hypotheses::new(self.model, self.dwell, self.evidence)
    }

    fn sparse(&self, dt_s: f64) -> Result<Self::Sparse, StepError> {
        SparseHypotheses::new(self.model, dt_s, self.dwell, self.evidence)
    }

    fn step(
        sparse: &Self::Sparse,
        state: &SparseMixture<f64, N, L, HISTORIES>,
        reading: Option<Reading<f64>>,
        next: &mut SparseMixture<f64, N, L, HISTORIES>,
    ) -> Result<Option<MixtureResidual<f64>>, StepError> {
        sparse.step_into(state, reading, next)
    }

    fn smooth_back(
        &self,
        sparse: &Self::Sparse,
        step: &<Self::Dense as Estimator<f64, N, L>>::Prepared,
        filtered: &SparseMixture<f64, N, L, HISTORIES>,
        reading: Option<Reading<f64>>,
        next: &SparseMixture<f64, N, L, HISTORIES>,
    ) -> Result<SparseMixture<f64, N, L, HISTORIES>, StepError> {
        sparse.smooth_back(&Pair::<N, L, HISTORIES>::dense(self), step, filtered, reading, next)
    }
}

/// The sign-split filter of the same.
#[derive(Clone, Copy)]
pub(crate) struct Splits<const B: usize, const N: usize> {
    pub model: SwitchedModel<f64, B, N>,
    pub hold: Option<Dwell<f64>>,
    pub evidence: Evidence<f64>,
}

impl<const B: usize, const N: usize, const L: usize> Pair<N, L, HYPOTHESES> for Splits<B, N> {
    type Sparse = SparseSignSplit<f64, B, N, HYPOTHESES>;
    type Dense = SignSplit<f64, SwitchedModel<f64, B, N>, HYPOTHESES>;

    fn dense(&self) -> Self::Dense {
        SignSplit::new(self.model, self.hold, self.evidence)
    }

    fn sparse(&self, dt_s: f64) -> Result<Self::Sparse, StepError> {
        SparseSignSplit::new(self.model, dt_s, self.hold, self.evidence)
    }

    fn step(
        sparse: &Self::Sparse,
        state: &SparseMixture<f64, N, L, HYPOTHESES>,
        reading: Option<Reading<f64>>,
        next: &mut SparseMixture<f64, N, L, HYPOTHESES>,
    ) -> Result<Option<MixtureResidual<f64>>, StepError> {
        sparse.step_into(state, reading, next)
    }

    fn smooth_back(
        &self,
        sparse: &Self::Sparse,
        step: &<Self::Dense as Estimator<f64, N, L>>::Prepared,
        filtered: &SparseMixture<f64, N, L, HYPOTHESES>,
        reading: Option<Reading<f64>>,
        next: &SparseMixture<f64, N, L, HYPOTHESES>,
    ) -> Result<SparseMixture<f64, N, L, HYPOTHESES>, StepError> {
        sparse.smooth_back(&Pair::<N, L, HYPOTHESES>::dense(self), step, filtered, reading, next)
    }
}

/// The sparse filter of a pair forward, and back along what it did; where it refuses a step, the dense one decides.
#[derive(Clone, Copy)]
pub(crate) struct SparsePhases<P, const K: usize>(pub P);

/// A step of one length; without `sparse` it has none.
#[derive(Clone, Copy)]
pub(crate) struct SparsePhasesStep<S> {
    dt_s: f64,
    sparse: Option<S>,
}

impl<P: Pair<N, L, K>, const N: usize, const L: usize, const K: usize> Estimator<f64, N, L> for SparsePhases<P, K> {
    type State = SparseMixture<f64, N, L, K>;
    type Prepared = SparsePhasesStep<P::Sparse>;

    fn longest_step_s(&self) -> f64 {
        self.0.dense().longest_step_s()
    }

    fn prepare(&self, dt_s: f64) -> Self::Prepared {
        SparsePhasesStep { dt_s, sparse: self.0.sparse(dt_s).ok() }
    }

    fn advance(
        &self,
        state: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<f64>>,
    ) -> Result<Advanced<Self::State, f64>, StepError> {
        let mut next = *state;
        let innovation = self.advance_into(state, prepared, reading, &mut next)?;
        Ok(Advanced { state: next, innovation })
    }

    fn advance_into(
        &self,
        state: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<f64>>,
        next: &mut Self::State,
    ) -> Result<Option<Innovation<f64>>, StepError> {
        match prepared.sparse.as_ref().map(|sparse| P::step(sparse, state, reading, next)) {
            Some(Ok(said)) if said.is_none_or(|said| said.residual.nis.is_finite()) => {
                Ok(said.map(|said| Innovation {
                    value: said.residual.innovation,
                    variance: said.residual.variance,
                    log_likelihood: said.log_likelihood(),
                }))
            }
            _ => {
                let dense = self.0.dense();
                let taken = dense.advance(&(*state).into(), &dense.prepare(prepared.dt_s), reading)?;
                *next = (&taken.state).into();
                Ok(taken.innovation)
            }
        }
    }

    fn smooth_back(
        &self,
        filtered: &Self::State,
        prepared: &Self::Prepared,
        reading: Option<Reading<f64>>,
        next: &Self::State,
    ) -> Result<Option<Self::State>, StepError> {
        let dense = self.0.dense();
        let step = dense.prepare(prepared.dt_s);
        let along = |sparse| self.0.smooth_back(sparse, &step, filtered, reading, next).ok();
        if let Some(smoothed) = prepared.sparse.as_ref().and_then(along) {
            return Ok(Some(smoothed));
        }
        let smoothed = dense.smooth_back(&(*filtered).into(), &step, reading, &(*next).into())?;
        Ok(smoothed.as_ref().map(Into::into))
    }
}
