use ohmstrain_model::{Phase, SwitchedModel};

use crate::{
    Belief, Curve, Estimator, Gaussian, Hypotheses, Imm, Mixture, PhaseMixture, Real, SignSplit, SparseEkf, Switch,
};

/// An estimator of the sensor's own model, which a [`LiveFilter`](super::LiveFilter) runs.
pub trait SensorEstimator<T: Real, const N: usize, const L: usize>: Estimator<T, N, L> {
    /// Number of relaxing branches of the law.
    const BRANCHES: usize;

    /// Returns the state before any reading, at a known strain if there is one.
    fn start(&self, strain: Option<Gaussian<T>>) -> Self::State;
}

/// Returns the initial belief of a model.
fn belief<T: Real, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<T, B, N>,
    strain: Option<Gaussian<T>>,
) -> Belief<T, N, L> {
    let (mut mean, mut variance) = model.initial_distribution();
    if let Some(strain) = strain {
        (mean[0], variance[0]) = (strain.mean, strain.variance);
    }
    Belief::independent(mean, &variance)
}

impl<T, S, G, const B: usize, const N: usize, const L: usize> SensorEstimator<T, N, L> for SparseEkf<T, S, B, N, G>
where
    T: Real,
    S: Switch<T>,
    G: Curve<T>,
{
    const BRANCHES: usize = B;

    fn start(&self, strain: Option<Gaussian<T>>) -> Belief<T, N, L> {
        belief(self.model(), strain)
    }
}

/// Implements [`SensorEstimator`] for filters that start with a single hypothesis, in the given phase.
macro_rules! with_phases {
    ($($filter:ty $([$hypotheses:ident])? => $state:ty, $phase:expr;)+) => {$(
        impl<T, S, G, const B: usize, const N: usize, const L: usize $(, const $hypotheses: usize)?>
            SensorEstimator<T, N, L> for $filter
        where
            T: Real,
            S: Switch<T>,
            G: Curve<T>,
        {
            const BRANCHES: usize = B;

            fn start(&self, strain: Option<Gaussian<T>>) -> $state {
                <$state>::single(belief(self.model(), strain), $phase)
            }
        }
    )+};
}

with_phases! {
    SignSplit<T, B, N, K, S, G> [K] => Mixture<T, N, L, K>, Phase::Extend;
    Hypotheses<T, B, N, K, S, G> [K] => Mixture<T, N, L, K>, Phase::Hold;
    Imm<T, B, N, S, G> => PhaseMixture<T, N, L>, Phase::Hold;
}
