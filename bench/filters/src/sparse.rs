use ohmstrain_ekf::{Belief, Compact, Cubic, Curve, Reading, SigmaPoints, SparseEkf, Switch};
use ohmstrain_model::SwitchedModel;

use crate::readings::GATE;
use crate::{DT_S, Filter};

/// The EKF without multiplications by zero, with a gate on the normalised innovation squared and a log-likelihood.
#[derive(Clone, Copy, Debug)]
pub struct GatedSparse<const B: usize, const N: usize, const L: usize, S = Compact, G = Cubic<f64>> {
    ekf: SparseEkf<f64, S, B, N, G>,
    belief: Belief<f64, N, L>,
    log_likelihood: f64,
}

/// The unscented filter.
pub type GatedUnscented<const B: usize, const N: usize, const L: usize> =
    GatedSparse<B, N, L, Compact, SigmaPoints<Cubic<f64>>>;

impl<S: Switch<f64>, G: Curve<f64>, const B: usize, const N: usize, const L: usize> GatedSparse<B, N, L, S, G> {
    /// Starts from the long-run distribution of `model`.
    ///
    /// # Panics
    /// If the model's law is not of the filter's family.
    #[must_use]
    pub fn new(model: SwitchedModel<f64, B, N>) -> Self {
        let ekf = SparseEkf::new(model, DT_S).expect("the filter is for such a law");
        Self { ekf, belief: Belief::initial(&model), log_likelihood: 0.0 }
    }

    /// Belief after the last reading.
    #[must_use]
    pub const fn belief(&self) -> &Belief<f64, N, L> {
        &self.belief
    }
}

impl<S: Switch<f64>, G: Curve<f64>, const B: usize, const N: usize, const L: usize> Filter
    for GatedSparse<B, N, L, S, G>
{
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        let Ok(residual) = self.ekf.step_gated(&mut self.belief, Reading::from(reading), GATE) else { return false };
        if residual.nis <= GATE {
            self.log_likelihood += residual.log_likelihood();
        }
        true
    }

    fn strain(&self) -> f64 {
        self.belief.mean[0]
    }
}
