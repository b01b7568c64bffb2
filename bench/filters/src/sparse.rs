use ohmstrain_ekf::{Belief, Compact, LogLikelihood, Reading, SparseEkf};
use ohmstrain_model::SwitchedModel;

use crate::estimators::GATE;
use crate::{DT_S, Filter};

/// The EKF without multiplications by zero, with a gate on the normalised innovation squared and a log-likelihood.
#[derive(Clone, Copy, Debug)]
pub struct GatedSparse<const B: usize, const N: usize, const L: usize> {
    ekf: SparseEkf<f64, Compact, B, N>,
    belief: Belief<f64, N, L>,
    log_likelihood: LogLikelihood<f64>,
}

impl<const B: usize, const N: usize, const L: usize> GatedSparse<B, N, L> {
    /// From the long-run distribution of `model`.
    ///
    /// # Panics
    /// Never: the step's length is positive.
    #[must_use]
    pub fn new(model: SwitchedModel<f64, B, N>) -> Self {
        let ekf = SparseEkf::new(model, DT_S).expect("the step's length is positive");
        Self { ekf, belief: Belief::initial(&model), log_likelihood: LogLikelihood::new() }
    }

    /// What is known after the last reading.
    #[must_use]
    pub const fn belief(&self) -> &Belief<f64, N, L> {
        &self.belief
    }
}

impl<const B: usize, const N: usize, const L: usize> Filter for GatedSparse<B, N, L> {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let mut next = self.belief;
        match self.ekf.step(&mut next, Some(Reading::from(reading))) {
            Ok(Some(residual)) if residual.nis <= GATE => {
                self.belief = next;
                self.log_likelihood.add(&residual);
                true
            }
            Ok(_) => self.ekf.step(&mut self.belief, None).is_ok(),
            Err(_) => false,
        }
    }

    fn strain(&self) -> f64 {
        self.belief.mean[0]
    }
}
