//! A common interface of the measured filters.

use core::hint::black_box;

use ohmstrain_ekf::{
    Belief, Cubic, Dwell, Ekf, Evidence, Imm, Mixture, PhaseMixture, Reading, Real, SignSplit, SparseEkf, State, Switch,
};
use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, SwitchedModel, SwitchedStep};

use crate::fpu::OnFpu;
use crate::{DT_S, limits, sensor};

/// A filter with its state.
pub trait Filter<T>: Copy {
    /// Creates the filter before any reading.
    ///
    /// # Errors
    /// None: the parameters are valid.
    fn start() -> Result<Self, ParameterError>;

    /// Takes the next reading; returns true if the step succeeded.
    fn step(&mut self, reading: Reading<T>) -> bool;

    /// Returns the mean strain.
    fn strain(&self) -> T;

    /// Returns the size of the state that changes from step to step, bytes.
    fn state_bytes() -> usize;
}

/// An EKF at a fixed rate.
#[derive(Clone, Copy)]
pub struct PreparedEkf<T, const B: usize, const N: usize, const L: usize> {
    ekf: Ekf<SwitchedModel<T, B, N>>,
    prepared: SwitchedStep<T, B>,
    belief: Belief<T, N, L>,
}

/// Strain, rate, one branch.
pub type Ekf3<T> = PreparedEkf<T, 1, 3, 6>;
/// Strain, rate, three branches, baseline.
pub type Ekf6<T> = PreparedEkf<T, 3, 6, 21>;

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Filter<T> for PreparedEkf<T, B, N, L> {
    fn start() -> Result<Self, ParameterError> {
        // In the field, parameters come from a file, so the compiler must not compute with them.
        let model = black_box(sensor()?);
        Ok(Self { prepared: model.prepare(T::of(DT_S)), belief: Belief::initial(&model), ekf: Ekf::new(model) })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        match self.ekf.step_prepared(&self.belief, &self.prepared, Some(reading)) {
            Ok(step) => {
                self.belief = step.posterior;
                true
            }
            Err(_) => false,
        }
    }

    fn strain(&self) -> T {
        self.belief.mean[0]
    }

    fn state_bytes() -> usize {
        size_of::<Belief<T, N, L>>()
    }
}

/// The EKF of three states with a step length that varies from reading to reading.
#[derive(Clone, Copy)]
pub struct VaryingEkf3<T> {
    ekf: Ekf<SwitchedModel<T, 1, 3>>,
    belief: Belief<T, 3, 6>,
    dt_s: T,
}

impl<T: Scalar> Filter<T> for VaryingEkf3<T> {
    fn start() -> Result<Self, ParameterError> {
        let model = black_box(sensor()?);
        Ok(Self { belief: Belief::initial(&model), ekf: Ekf::new(model), dt_s: T::of(DT_S) })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        match self.ekf.step(&self.belief, black_box(self.dt_s), Some(reading)) {
            Ok(step) => {
                self.belief = step.posterior;
                true
            }
            Err(_) => false,
        }
    }

    fn strain(&self) -> T {
        self.belief.mean[0]
    }

    fn state_bytes() -> usize {
        size_of::<Belief<T, 3, 6>>()
    }
}

fn dwell<T: Scalar>() -> Result<Dwell<T>, ParameterError> {
    Dwell::new(T::of(5.0), T::of(1.0), T::of(0.3))
}

fn evidence<T: Scalar>() -> Evidence<T> {
    Evidence { limits: limits(), tempering: T::one() }
}

/// A sparse filter of the sensor's own model at a fixed rate, with its state, which changes in place.
#[derive(Clone, Copy)]
pub struct Fast<F, S> {
    filter: F,
    state: S,
}

/// The sparse EKF, with the floating-point unit's square root and a polynomial gauge.
type Kernel<T, const B: usize, const N: usize> = SparseEkf<T, OnFpu, B, N, Cubic<T>>;
type FastImm<T, const B: usize, const N: usize> = Imm<T, B, N, OnFpu, Cubic<T>>;
type FastSplit<T, const B: usize, const N: usize, const K: usize> = SignSplit<T, B, N, K, OnFpu, Cubic<T>>;

/// Strain, rate, one branch.
pub type Fast3<T> = Fast<Kernel<T, 1, 3>, Belief<T, 3, 6>>;
/// Strain, rate, three branches, baseline.
pub type Fast6<T> = Fast<Kernel<T, 3, 6>, Belief<T, 6, 21>>;
/// Three phases with these six states.
pub type FastImm6<T> = Fast<FastImm<T, 3, 6>, PhaseMixture<T, 6, 21>>;
/// Four hypotheses with these six states, split by the sign of the rate.
pub type FastSplit6<T> = Fast<FastSplit<T, 3, 6, 4>, Mixture<T, 6, 21, 4>>;

fn kernel<T: Scalar, const B: usize, const N: usize>() -> Result<Kernel<T, B, N>, ParameterError>
where
    OnFpu: Switch<T>,
{
    SparseEkf::new(black_box(sensor()?), T::of(DT_S)).map_err(|_| ParameterError::new("dt_s", Problem::NotPositive))
}

/// Implements [`Filter`] for these; they differ in their start and in the place of the strain.
macro_rules! fast_filter {
    (
        <T: $scalar:ident $(, const $n:ident)*> $filter:ty, $state:ty,
        |$kernel:ident| $start:expr, |$of:ident| $strain:expr
    ) => {
        impl<T: $scalar $(, const $n: usize)*> Filter<T> for Fast<$filter, $state>
        where
            OnFpu: Switch<T>,
        {
            fn start() -> Result<Self, ParameterError> {
                let $kernel = kernel()?;
                let (state, filter) = $start;
                Ok(Self { filter, state })
            }

            fn step(&mut self, reading: Reading<T>) -> bool {
                self.filter.step(&mut self.state, Some(reading)).is_ok()
            }

            fn strain(&self) -> T {
                let $of = &self.state;
                $strain
            }

            fn state_bytes() -> usize {
                size_of::<$state>()
            }
        }
    };
}

fast_filter!(
    <T: Scalar, const B, const N, const L> Kernel<T, B, N>, Belief<T, N, L>,
    |kernel| (Belief::initial(kernel.model()), kernel),
    |belief| belief.mean[0]
);
fast_filter!(
    <T: Real, const B, const N, const L> FastImm<T, B, N>, PhaseMixture<T, N, L>,
    |kernel| (
        PhaseMixture::single(Belief::initial(kernel.model()), Phase::Hold),
        Imm::around(kernel, black_box(dwell()?), black_box(evidence()))
    ),
    |mixture| mixture.marginal(0).mean
);
fast_filter!(
    <T: Real, const B, const N, const L, const K> FastSplit<T, B, N, K>, Mixture<T, N, L, K>,
    |kernel| (
        Mixture::single(Belief::initial(kernel.model()), Phase::Extend),
        SignSplit::around(kernel, None, black_box(evidence()))
    ),
    |mixture| mixture.marginal(0).mean
);

/// The sparse EKF of three states with a step length given at every reading.
#[derive(Clone, Copy)]
pub struct VaryingFast3<T: Scalar> {
    fast: Fast3<T>,
    dt_s: T,
}

impl<T: Scalar> Filter<T> for VaryingFast3<T>
where
    OnFpu: Switch<T>,
{
    fn start() -> Result<Self, ParameterError> {
        Ok(Self { fast: Fast3::start()?, dt_s: T::of(DT_S) })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        let Self { fast: Fast { filter, state }, dt_s } = self;
        filter.retime(black_box(*dt_s)).is_ok() && filter.step(state, Some(reading)).is_ok()
    }

    fn strain(&self) -> T {
        self.fast.strain()
    }

    fn state_bytes() -> usize {
        size_of::<Belief<T, 3, 6>>()
    }
}
