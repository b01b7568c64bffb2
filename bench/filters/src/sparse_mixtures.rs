use ohmstrain_ekf::{
    MixtureResidual, PhaseMixture, Reading, SparseHypotheses, SparseImm, SparseMixture, SparseSignSplit, State,
    StepError,
};

use crate::Filter;
use crate::estimators::GATE;

/// A filter of hypotheses that changes its state in place.
pub(crate) trait InPlace {
    type State: Copy;

    fn take(&self, state: &mut Self::State, reading: Option<f64>) -> Result<Option<MixtureResidual<f64>>, StepError>;

    fn strain(state: &Self::State) -> f64;
}

impl InPlace for SparseImm<f64, 3, 6> {
    type State = PhaseMixture<f64, 6, 21>;

    #[inline]
    fn take(&self, state: &mut Self::State, reading: Option<f64>) -> Result<Option<MixtureResidual<f64>>, StepError> {
        self.step(state, reading.map(Reading::from))
    }

    fn strain(state: &Self::State) -> f64 {
        state.marginal(0).mean
    }
}

/// What the two filters of up to `K` Gaussians do alike.
macro_rules! in_place {
    ($filter:ident) => {
        impl<const K: usize> InPlace for $filter<f64, 3, 6, K> {
            type State = SparseMixture<f64, 6, 21, K>;

            #[inline]
            fn take(
                &self,
                state: &mut Self::State,
                reading: Option<f64>,
            ) -> Result<Option<MixtureResidual<f64>>, StepError> {
                self.step(state, reading.map(Reading::from))
            }

            fn strain(state: &Self::State) -> f64 {
                state.marginal(0).mean
            }
        }
    };
}

in_place!(SparseSignSplit);
in_place!(SparseHypotheses);

/// Such a filter with a gate on the normalised innovation squared and a log-likelihood.
pub(crate) struct GatedMixture<F: InPlace> {
    filter: F,
    state: F::State,
    log_likelihood: f64,
}

impl<F: InPlace> GatedMixture<F> {
    pub(crate) fn new(filter: F, state: F::State) -> Self {
        Self { filter, state, log_likelihood: 0.0 }
    }
}

impl<F: InPlace> Filter for GatedMixture<F> {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let mut next = self.state;
        match self.filter.take(&mut next, Some(reading)) {
            Ok(Some(residual)) if residual.residual.nis <= GATE => {
                self.state = next;
                self.log_likelihood += residual.log_likelihood();
                true
            }
            Ok(_) => self.filter.take(&mut self.state, None).is_ok(),
            Err(_) => false,
        }
    }

    fn strain(&self) -> f64 {
        F::strain(&self.state)
    }
}
