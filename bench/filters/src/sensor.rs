//! The sensor of all benchmarks here. Its numbers are illustrative.

use ohmstrain_ekf::{Belief, Channel, Dynamics};
use ohmstrain_model::{
    Branch, Gauge, ModelNoise, Motion, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
};

/// Time between readings, s.
pub const DT_S: f64 = 0.01;

/// Standard deviation of a reading's noise.
pub(crate) const READING_SD: f64 = 2e-3;

/// Range of strains for which the law holds.
pub const RANGE: StrainRange<f64> = StrainRange { lower: -0.02, upper: 0.35 };

/// Returns the law of a sensor whose `B` branches share the relaxation.
pub(crate) fn law<T: Scalar, const B: usize>() -> SensorLaw<T, B> {
    let share = 1.0 / B as f64;
    SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.6, -1.2, 0.5].map(T::of) },
        extend_viscosity_s: T::of(0.02),
        retract_viscosity_s: T::of(-0.01),
        branches: std::array::from_fn(|i| Branch {
            tau_s: T::of(4.0 * 4_f64.powi(i as i32)),
            extend_gain: T::of(0.3 * share),
            retract_gain: T::of(0.2 * share),
            extend_gain_slope: T::of(-0.2 * share),
            retract_gain_slope: T::of(-0.1 * share),
        }),
        range: StrainRange { lower: T::of(RANGE.lower), upper: T::of(RANGE.upper) },
    }
}

/// Returns a sensor with up to three branches, and a baseline if `N = B + 3`.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn sensor<const B: usize, const N: usize>() -> SwitchedModel<f64, B, N> {
    sensor_of()
}

/// Returns the same sensor with numbers of any type.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn sensor_of<T: Scalar, const B: usize, const N: usize>() -> SwitchedModel<T, B, N> {
    model(law(), motion(0.15))
}

/// Returns the same sensor for filters of phases: a moving body has a mean speed.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn phased_sensor<const B: usize, const N: usize>() -> SwitchedModel<f64, B, N> {
    model(law(), motion(0.15).with_phase_rate(0.1).unwrap())
}

/// Returns a sensor that responds alike to stretching and releasing: its law is linear, and so is its motion about strain zero.
///
/// # Panics
/// Never: the parameters are valid.
#[must_use]
pub fn linear_sensor() -> SwitchedModel<f64, 1, 3> {
    let branch =
        Branch { tau_s: 4.0, extend_gain: 0.3, retract_gain: 0.3, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.6, 0.0, 0.0] },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: 0.02,
        branches: [branch],
        range: RANGE,
    };
    model(law, motion(0.0))
}

fn motion<T: Scalar>(strain_mean: f64) -> Motion<T> {
    let motion = Motion::ornstein_uhlenbeck(T::of(0.5), T::of(0.1), T::of(strain_mean), T::of(0.1));
    motion.expect("the parameters are valid")
}

fn model<T: Scalar, const B: usize, const N: usize>(law: SensorLaw<T, B>, motion: Motion<T>) -> SwitchedModel<T, B, N> {
    let noise = ModelNoise {
        reading_sd: T::of(READING_SD),
        branch_sd: T::of(5e-3),
        baseline_sd: T::of(if N == B + 3 { 0.02 } else { 0.0 }),
        baseline_time_s: T::of(30.0),
    };
    SwitchedModel::new(law, motion, noise).expect("the parameters are valid")
}

/// The linear sensor over one step, in the form that other filters take: `x' = F x + n`, `y = H x + w`, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearModel {
    /// Transition F.
    pub transition: [[f64; 3]; 3],
    /// Covariance Q of n.
    pub noise: [[f64; 3]; 3],
    /// Observation row H.
    pub gradient: [f64; 3],
    /// Variance R of w.
    pub variance: f64,
    /// Variances of the state before any reading; its mean is zero.
    pub start: [f64; 3],
}

/// Returns the matrices of [`linear_sensor`] for steps of [`DT_S`].
#[must_use]
pub fn linearised() -> LinearModel {
    let model = linear_sensor();
    let start = Belief::<f64, 3, 6>::initial(&model);
    let prepared = Dynamics::<f64, 3, 6>::prepare(&model, DT_S);
    let transition = Dynamics::<f64, 3, 6>::transition(&model, &prepared, &start, Some(Phase::Extend));
    let observation = Channel::<f64, 3, 6>::observe(&model, &start, Some(Phase::Extend));
    let noise: &Symmetric<f64, 3, 6> = &transition.noise;
    LinearModel {
        transition: std::array::from_fn(|i| std::array::from_fn(|j| transition.jacobian[(i, j)])),
        noise: std::array::from_fn(|i| std::array::from_fn(|j| noise[(i, j)])),
        gradient: std::array::from_fn(|i| observation.gradient[i]),
        variance: observation.variance,
        start: std::array::from_fn(|i| start.covariance[(i, i)]),
    }
}
