use ohmstrain_ekf::{Hypotheses, Imm, Mixture, MixtureResidual, PhaseMixture, Reading, SignSplit, State, StepError};

use crate::Filter;
use crate::readings::GATE;

/// A filter of hypotheses that steps from one state into another, existing one.
pub(crate) trait StepsInto {
    type State: Copy;

    fn step_into(
        &self,
        from: &Self::State,
        reading: Option<f64>,
        next: &mut Self::State,
    ) -> Result<Option<MixtureResidual<f64>>, StepError>;

    fn strain(state: &Self::State) -> f64;
}

/// Implementation that all filters share.
macro_rules! steps_into {
    ($filter:ty, $state:ty $(, $capacity:ident)?) => {
        impl$(<const $capacity: usize>)? StepsInto for $filter {
            type State = $state;

            #[inline]
            fn step_into(
                &self,
                from: &$state,
                reading: Option<f64>,
                next: &mut $state,
            ) -> Result<Option<MixtureResidual<f64>>, StepError> {
                <$filter>::step_into(self, from, reading.map(Reading::from), next)
            }

            fn strain(state: &$state) -> f64 {
                state.marginal(0).mean
            }
        }
    };
}

steps_into!(Imm<f64, 3, 6>, PhaseMixture<f64, 6, 21>);
steps_into!(SignSplit<f64, 3, 6, K>, Mixture<f64, 6, 21, K>, K);
steps_into!(Hypotheses<f64, 3, 6, K>, Mixture<f64, 6, 21, K>, K);

/// Filter with a gate on the normalised innovation squared and a log-likelihood. Its two states are swapped instead of copied.
pub(crate) struct GatedMixture<F: StepsInto> {
    filter: F,
    states: [F::State; 2],
    /// True if the second state is the current one.
    second: bool,
    log_likelihood: f64,
}

impl<F: StepsInto> GatedMixture<F> {
    pub(crate) fn new(filter: F, state: F::State) -> Self {
        Self { filter, states: [state; 2], second: false, log_likelihood: 0.0 }
    }
}

impl<F: StepsInto> Filter for GatedMixture<F> {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let [a, b] = &mut self.states;
        let (from, next) = if self.second { (b, a) } else { (a, b) };
        let taken = match self.filter.step_into(from, Some(reading), next) {
            Ok(Some(residual)) if residual.residual.nis <= GATE => {
                self.log_likelihood += residual.log_likelihood();
                true
            }
            Ok(_) => self.filter.step_into(from, None, next).is_ok(),
            Err(_) => false,
        };
        self.second ^= taken;
        taken
    }

    fn strain(&self) -> f64 {
        let [a, b] = &self.states;
        F::strain(if self.second { b } else { a })
    }
}
