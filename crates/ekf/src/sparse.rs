//! The sensor's own filter as an [`Estimator`], with a smoother.

use ohmstrain_model::Scalar;

use crate::{Advanced, Belief, Curve, Estimator, Reading, SparseEkf, StepError, Switch, rts_step};

/// The prepared step is the filter itself for steps of that length.
impl<T, S, const B: usize, const N: usize, G, const L: usize> Estimator<T, N, L> for SparseEkf<T, S, B, N, G>
where
    T: Scalar,
    S: Switch<T>,
    G: Curve<T>,
{
    type State = Belief<T, N, L>;
    type Prepared = Self;

    fn prepare(&self, dt_s: T) -> Self {
        let mut other = *self;
        other.set_length(dt_s);
        other
    }

    fn longest_step_s(&self) -> T {
        self.model().longest_step_s()
    }

    fn advance(
        &self,
        state: &Belief<T, N, L>,
        prepared: &Self,
        reading: Option<Reading<T>>,
    ) -> Result<Advanced<Belief<T, N, L>, T>, StepError> {
        let mut next = *state;
        let residual = prepared.step(&mut next, reading)?;
        let innovation =
            residual.map(|residual| residual.with_log_likelihood(residual.log_likelihood())).transpose()?;
        Ok(Advanced { state: next, innovation })
    }

    fn smooth_back(
        &self,
        filtered: &Belief<T, N, L>,
        prepared: &Self,
        _: Option<Reading<T>>,
        next: &Belief<T, N, L>,
    ) -> Result<Belief<T, N, L>, StepError> {
        let (transition, prior) = prepared.transition(filtered);
        Ok(rts_step(filtered, &transition, &prior, next))
    }
}
