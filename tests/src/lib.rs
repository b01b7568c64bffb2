//! Models and random numbers shared by several tests. The oracles are in the tests themselves.

pub mod character;
mod draws;
pub mod faults;
mod flow;
pub mod own_law;
pub mod particles;
pub mod sweep;

pub use draws::{Draws, square_root};
pub use flow::Flow;
use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Step, rts_step};
use ohmstrain_model::{
    Branch, Gauge, ModelNoise, Motion, Observation, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
    Transition,
};

/// A linear model with fixed matrices, the same for every step: `x' = F x + n`, `y = H x + w`.
#[derive(Clone, Copy, Debug)]
pub struct Linear<T, const N: usize> {
    /// Transition F.
    pub transition: SMatrix<T, N, N>,
    /// Covariance Q of n.
    pub noise: SMatrix<T, N, N>,
    /// Observation row H.
    pub gradient: SVector<T, N>,
    /// Variance R of w.
    pub variance: T,
}

impl<T: Scalar, const N: usize, const L: usize> Dynamics<T, N, L> for Linear<T, N> {
    type Prepared = ();

    fn prepare(&self, _dt_s: T) {}

    fn transition(&self, (): &(), from: &Belief<T, N, L>, _: Option<Phase>) -> Transition<T, N, L> {
        Transition {
            mean: self.transition * from.mean,
            jacobian: self.transition,
            noise: Symmetric::from_lower(&self.noise),
        }
    }
}

impl<T: Scalar, const N: usize, const L: usize> Channel<T, N, L> for Linear<T, N> {
    fn observe(&self, at: &Belief<T, N, L>, _: Option<Phase>) -> Observation<T, N> {
        Observation { value: self.gradient.dot(&at.mean), gradient: self.gradient, variance: self.variance }
    }
}

/// A model whose phase is given to the filter.
#[derive(Clone, Copy, Debug)]
pub struct KnownPhase<M> {
    /// The model.
    pub model: M,
    /// The given phase.
    pub phase: Phase,
}

impl<T: Scalar, M: Dynamics<T, N, L>, const N: usize, const L: usize> Dynamics<T, N, L> for KnownPhase<M> {
    type Prepared = M::Prepared;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        self.model.prepare(dt_s)
    }

    fn transition(&self, step: &Self::Prepared, from: &Belief<T, N, L>, _: Option<Phase>) -> Transition<T, N, L> {
        self.model.transition(step, from, Some(self.phase))
    }

    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        self.model.propagate(covariance, transition)
    }
}

impl<T: Scalar, M: Channel<T, N, L>, const N: usize, const L: usize> Channel<T, N, L> for KnownPhase<M> {
    fn observe(&self, at: &Belief<T, N, L>, _: Option<Phase>) -> Observation<T, N> {
        self.model.observe(at, Some(self.phase))
    }
}

/// Smooths a recording with the Rauch-Tung-Striebel smoother; returns the beliefs at the times of `steps` given all
/// readings.
#[must_use]
pub fn rts_smooth<T: Scalar, const N: usize, const L: usize>(steps: &[Step<T, N, L>]) -> Vec<Belief<T, N, L>> {
    let mut smoothed: Vec<_> = steps.iter().map(|step| step.posterior).collect();
    for k in (1..steps.len()).rev() {
        let next = &steps[k];
        smoothed[k - 1] = rts_step(&steps[k - 1].posterior, &next.transition, &next.prior, &smoothed[k]);
    }
    smoothed
}

/// Returns a plausible sensor with `B` branches and Ornstein-Uhlenbeck motion, with a baseline if `N = B + 3`.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn sensor<T: Scalar, const B: usize, const N: usize>() -> SwitchedModel<T, B, N> {
    let branch = |i: usize| Branch {
        tau_s: T::of(4.0 * 8_f64.powi(i as i32)),
        extend_gain: T::of(0.8),
        retract_gain: T::of(-0.5),
        extend_gain_slope: T::of(-0.6),
        retract_gain_slope: T::of(-0.4),
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.6, -1.2, 0.5].map(T::of) },
        extend_viscosity_s: T::of(0.02),
        retract_viscosity_s: T::of(-0.01),
        branches: std::array::from_fn(branch),
        range: StrainRange { lower: T::of(-0.02), upper: T::of(0.35) },
    };
    let noise = ModelNoise {
        reading_sd: T::of(2e-3),
        branch_sd: T::of(5e-3),
        baseline_sd: T::of(if N == B + 3 { 0.02 } else { 0.0 }),
        baseline_time_s: T::of(30.0),
    };
    Motion::ornstein_uhlenbeck(T::of(1.5), T::of(0.05), T::of(0.15), T::of(0.1))
        .and_then(|motion| SwitchedModel::new(law, motion, noise))
        .unwrap_or_else(|error| unreachable!("{error}"))
}

/// Returns a linear sensor that stretches, rests and releases at 10 %/s, and whose branch distinguishes stretching from
/// releasing.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn switching_sensor() -> SwitchedModel<f64, 1, 3> {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.5, 0.0, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [Branch {
            tau_s: 3.0,
            extend_gain: 1.0,
            retract_gain: -0.8,
            extend_gain_slope: 0.0,
            retract_gain_slope: 0.0,
        }],
        range: StrainRange { lower: -10.0, upper: 10.0 },
    };
    let noise = ModelNoise { reading_sd: 0.02, branch_sd: 0.01, baseline_sd: 0.0, baseline_time_s: 1.0 };
    Motion::ornstein_uhlenbeck(2.0, 0.03, 0.0, f64::INFINITY)
        .and_then(|motion| SwitchedModel::new(law, motion.with_phase_rate(0.1).unwrap(), noise))
        .unwrap_or_else(|error| unreachable!("{error}"))
}

/// The code in the README compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

/// The code in the description of the library compiles and runs, too.
#[cfg(doctest)]
#[doc = include_str!("../../docs/library.md")]
struct Library;

/// The first program on the page about Kalman filters compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../docs/kalman.md")]
struct Kalman;

/// The program in the README of the sensor's crate, which has no parser of files, compiles.
#[cfg(doctest)]
#[doc = include_str!("../../crates/sensor/README.md")]
struct SensorReadme;

/// And the code in the architecture document.
#[cfg(doctest)]
#[doc = include_str!("../../ARCHITECTURE.md")]
struct Architecture;
