//! Sparse filters of hypotheses, each beside its generic counterpart.

use ohmstrain_ekf::{
    Dwell, Dynamics, Hypotheses, Imm, Mixture, MixtureResidual, MixtureStep, PhaseMixture, Reading, Real, SignSplit,
    SparseHypotheses, SparseImm, SparseMixture, SparseSignSplit, State,
};
use ohmstrain_model::SwitchedModel;

use super::{DT_S, dwell, evidence};

/// A sparse filter and its generic counterpart.
pub trait Pair<T: Real, const N: usize, const L: usize, const K: usize> {
    type State: State<T, N, L> + Into<Mixture<T, N, L, K>>;
    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>>;
    fn generic(&self, from: &Mixture<T, N, L, K>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, K>;
}

pub struct Imms<T, const B: usize, const N: usize> {
    sparse: SparseImm<T, B, N>,
    generic: Imm<T, SwitchedModel<T, B, N>>,
}

impl<T: Real, const B: usize, const N: usize> Imms<T, B, N> {
    pub fn new(model: SwitchedModel<T, B, N>, tempering: f64) -> Self {
        let (dt_s, evidence) = (T::of(DT_S), evidence(tempering));
        let sparse = SparseImm::new(model, dt_s, dwell(), evidence).unwrap();
        Self { sparse, generic: Imm::new(model, dwell(), evidence) }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize> Pair<T, N, L, 3> for Imms<T, B, N> {
    type State = PhaseMixture<T, N, L>;

    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>> {
        self.sparse.step(state, reading).unwrap()
    }

    fn generic(&self, from: &Mixture<T, N, L, 3>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, 3> {
        let prepared = Dynamics::<T, N, L>::prepare(self.generic.model(), T::of(DT_S));
        self.generic.step_prepared(from, &prepared, T::of(DT_S), reading).unwrap()
    }
}

pub struct Splits<T, const B: usize, const N: usize, const K: usize> {
    sparse: SparseSignSplit<T, B, N, K>,
    generic: SignSplit<T, SwitchedModel<T, B, N>, K>,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> Splits<T, B, N, K> {
    pub fn new(model: SwitchedModel<T, B, N>, hold: Option<Dwell<T>>, tempering: f64) -> Self {
        let (dt_s, evidence) = (T::of(DT_S), evidence(tempering));
        let sparse = SparseSignSplit::new(model, dt_s, hold, evidence).unwrap();
        Self { sparse, generic: SignSplit::new(model, hold, evidence) }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Pair<T, N, L, K> for Splits<T, B, N, K> {
    type State = SparseMixture<T, N, L, K>;

    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>> {
        self.sparse.step(state, reading).unwrap()
    }

    fn generic(&self, from: &Mixture<T, N, L, K>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, K> {
        let prepared = Dynamics::<T, N, L>::prepare(self.generic.model(), T::of(DT_S));
        self.generic.step_prepared(from, &prepared, T::of(DT_S), reading).unwrap()
    }
}

pub struct Histories<T, const B: usize, const N: usize, const K: usize> {
    sparse: SparseHypotheses<T, B, N, K>,
    generic: Hypotheses<T, SwitchedModel<T, B, N>, K>,
}

impl<T: Real, const B: usize, const N: usize, const K: usize> Histories<T, B, N, K> {
    pub fn new(model: SwitchedModel<T, B, N>, tempering: f64) -> Self {
        let (dt_s, evidence) = (T::of(DT_S), evidence(tempering));
        let sparse = SparseHypotheses::new(model, dt_s, dwell(), evidence).unwrap();
        Self { sparse, generic: Hypotheses::new(model, dwell(), evidence) }
    }
}

impl<T: Real, const B: usize, const N: usize, const L: usize, const K: usize> Pair<T, N, L, K>
    for Histories<T, B, N, K>
{
    type State = SparseMixture<T, N, L, K>;

    fn sparse(&self, state: &mut Self::State, reading: Option<Reading<T>>) -> Option<MixtureResidual<T>> {
        self.sparse.step(state, reading).unwrap()
    }

    fn generic(&self, from: &Mixture<T, N, L, K>, reading: Option<Reading<T>>) -> MixtureStep<T, N, L, K> {
        let prepared = Dynamics::<T, N, L>::prepare(self.generic.model(), T::of(DT_S));
        self.generic.step_prepared(from, &prepared, T::of(DT_S), reading).unwrap()
    }
}
