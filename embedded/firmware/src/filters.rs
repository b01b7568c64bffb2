//! One interface over the filters that are measured.

use core::hint::black_box;

use ohmstrain_ekf::{Belief, Cubic, Dwell, Ekf, Evidence, Imm, Mixture, Reading, Real, SignSplit, SparseEkf, Switch};
use ohmstrain_model::{ParameterError, Phase, Problem, Scalar, SwitchedModel, SwitchedStep};

use crate::fpu::OnFpu;
use crate::{DT_S, limits, sensor};

/// A filter with its state.
pub trait Filter<T>: Copy {
    /// The filter before any reading.
    ///
    /// # Errors
    /// None: the parameters are valid.
    fn start() -> Result<Self, ParameterError>;

    /// Takes the next reading; whether the step went well.
    fn step(&mut self, reading: Reading<T>) -> bool;

    /// Mean strain.
    fn strain(&self) -> T;

    /// Bytes that change from step to step.
    fn state_bytes() -> usize;
}

/// An EKF at a fixed rate.
#[derive(Clone, Copy)]
pub struct PreparedEkf<T, const B: usize, const N: usize, const L: usize> {
    ekf: Ekf<SwitchedModel<T, 2, B, N>>,
    prepared: SwitchedStep<T, 2, B>,
    belief: Belief<T, N, L>,
}

/// Strain, rate, one branch.
pub type Ekf3<T> = PreparedEkf<T, 1, 3, 6>;
/// Strain, rate, three branches, baseline.
pub type Ekf6<T> = PreparedEkf<T, 3, 6, 21>;

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Filter<T> for PreparedEkf<T, B, N, L> {
    fn start() -> Result<Self, ParameterError> {
        // Parameters come from a file in the field: the compiler must not compute with them.
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

/// The EKF of three states with a step length that changes from reading to reading.
#[derive(Clone, Copy)]
pub struct VaryingEkf3<T> {
    ekf: Ekf<SwitchedModel<T, 2, 1, 3>>,
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

/// Three phases, six states.
#[derive(Clone, Copy)]
pub struct Imm6<T> {
    imm: Imm<T, SwitchedModel<T, 2, 3, 6>>,
    prepared: SwitchedStep<T, 2, 3>,
    mixture: Mixture<T, 6, 21, 3>,
}

fn dwell<T: Scalar>() -> Result<Dwell<T>, ParameterError> {
    Dwell::new(T::of(5.0), T::of(1.0), T::of(0.3))
}

fn evidence<T: Scalar>() -> Evidence<T> {
    Evidence { limits: limits(), tempering: T::one() }
}

impl<T: Real> Filter<T> for Imm6<T> {
    fn start() -> Result<Self, ParameterError> {
        let model = black_box(sensor()?);
        let prepared = model.prepare(T::of(DT_S));
        let mixture = Mixture::single(Belief::initial(&model), Phase::Hold);
        Ok(Self { imm: Imm::new(model, black_box(dwell()?), black_box(evidence())), prepared, mixture })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        match self.imm.step_prepared(&self.mixture, &self.prepared, T::of(DT_S), Some(reading)) {
            Ok(step) => {
                self.mixture = step.posterior;
                true
            }
            Err(_) => false,
        }
    }

    fn strain(&self) -> T {
        self.mixture.moments().mean[0]
    }

    fn state_bytes() -> usize {
        size_of::<Mixture<T, 6, 21, 3>>()
    }
}

/// Four hypotheses split by the sign of the rate, six states.
#[derive(Clone, Copy)]
pub struct SplitFour<T> {
    split: SignSplit<T, SwitchedModel<T, 2, 3, 6>, 4>,
    prepared: SwitchedStep<T, 2, 3>,
    mixture: Mixture<T, 6, 21, 4>,
}

impl<T: Real> Filter<T> for SplitFour<T> {
    fn start() -> Result<Self, ParameterError> {
        let model = black_box(sensor()?);
        let prepared = model.prepare(T::of(DT_S));
        let mixture = Mixture::single(Belief::initial(&model), Phase::Extend);
        Ok(Self { split: SignSplit::new(model, None, black_box(evidence())), prepared, mixture })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        match self.split.step_prepared(&self.mixture, &self.prepared, T::of(DT_S), Some(reading)) {
            Ok(step) => {
                self.mixture = step.posterior;
                true
            }
            Err(_) => false,
        }
    }

    fn strain(&self) -> T {
        self.mixture.moments().mean[0]
    }

    fn state_bytes() -> usize {
        size_of::<Mixture<T, 6, 21, 4>>()
    }
}

/// The EKF that leaves out the zeros, at a fixed rate.
#[derive(Clone, Copy)]
pub struct FastEkf<T: Scalar, const B: usize, const N: usize, const L: usize> {
    ekf: SparseEkf<T, OnFpu, B, N, Cubic<T>>,
    belief: Belief<T, N, L>,
}

/// Strain, rate, one branch.
pub type Fast3<T> = FastEkf<T, 1, 3, 6>;
/// Strain, rate, three branches, baseline.
pub type Fast6<T> = FastEkf<T, 3, 6, 21>;

impl<T: Scalar, const B: usize, const N: usize, const L: usize> Filter<T> for FastEkf<T, B, N, L>
where
    OnFpu: Switch<T>,
{
    fn start() -> Result<Self, ParameterError> {
        let model = black_box(sensor()?);
        let step = SparseEkf::new(model, T::of(DT_S)).map_err(|_| ParameterError::new("dt_s", Problem::NotPositive))?;
        Ok(Self { ekf: step, belief: Belief::initial(&model) })
    }

    fn step(&mut self, reading: Reading<T>) -> bool {
        self.ekf.step(&mut self.belief, Some(reading)).is_ok()
    }

    fn strain(&self) -> T {
        self.belief.mean[0]
    }

    fn state_bytes() -> usize {
        size_of::<Belief<T, N, L>>()
    }
}
