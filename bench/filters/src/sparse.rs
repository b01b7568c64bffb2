use ohmstrain_ekf::{
    Belief, Compact, Cubic, Curve, Frozen, Line, LinearFilter, LogLikelihood, Reading, SigmaPoints, SparseEkf, Switch,
    Undirected,
};
use ohmstrain_model::SwitchedModel;

use crate::estimators::GATE;
use crate::{DT_S, Filter};

/// The EKF without multiplications by zero, with a gate on the normalised innovation squared and a log-likelihood.
#[derive(Clone, Copy, Debug)]
pub struct GatedSparse<const B: usize, const N: usize, const L: usize, S = Compact, G = Cubic<f64>> {
    ekf: SparseEkf<f64, S, B, N, G>,
    belief: Belief<f64, N, L>,
    log_likelihood: LogLikelihood<f64>,
}

/// The same of a linear sensor.
pub type GatedLinear<const B: usize, const N: usize, const L: usize> = GatedSparse<B, N, L, Undirected, Line<f64>>;

/// The unscented filter.
pub type GatedUnscented<const B: usize, const N: usize, const L: usize> =
    GatedSparse<B, N, L, Compact, SigmaPoints<Cubic<f64>>>;

impl<S: Switch<f64>, G: Curve<f64>, const B: usize, const N: usize, const L: usize> GatedSparse<B, N, L, S, G> {
    /// From the long-run distribution of `model`.
    ///
    /// # Panics
    /// If the model's law is not of the family of the filter.
    #[must_use]
    pub fn new(model: SwitchedModel<f64, B, N>) -> Self {
        let ekf = SparseEkf::new(model, DT_S).expect("the filter is for such a law");
        Self { ekf, belief: Belief::initial(&model), log_likelihood: LogLikelihood::new() }
    }

    /// What is known after the last reading.
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
            self.log_likelihood.add(&residual);
        }
        true
    }

    fn strain(&self) -> f64 {
        self.belief.mean[0]
    }
}

/// The linear filter whose covariance stands still.
#[derive(Clone, Copy, Debug)]
pub struct FrozenLinear {
    filter: Frozen<f64, 1, 3>,
    mean: nalgebra::SVector<f64, 3>,
}

impl FrozenLinear {
    /// Where the filter of `model` settles.
    ///
    /// # Panics
    /// If the model is not linear.
    #[must_use]
    pub fn new(model: SwitchedModel<f64, 1, 3>) -> Self {
        let (filter, start) = (LinearFilter::new(model, DT_S), Belief::<f64, 3, 6>::initial(&model));
        let filter = filter.and_then(|filter| filter.freeze(&start)).expect("a linear sensor's filter settles");
        Self { filter, mean: start.mean }
    }
}

impl Filter for FrozenLinear {
    #[inline]
    fn step(&mut self, reading: f64) -> bool {
        self.filter.step(&mut self.mean, Some(reading)).is_ok()
    }

    fn strain(&self) -> f64 {
        self.mean[0]
    }
}
