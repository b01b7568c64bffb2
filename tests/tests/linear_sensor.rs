//! A sensor to which stretching and releasing are alike: the Kalman filter with constant matrices, and its limit.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Channel, Compact, Dynamics, Line, LinearFilter, Reading, SparseEkf, StepError, Undirected,
};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel};

const DT_S: f64 = 0.02;

fn law<T: Scalar, const B: usize>() -> SensorLaw<T, B> {
    let branch = |i: usize| Branch {
        tau_s: T::of(2.0 * 5_f64.powi(i as i32)),
        extend_gain: T::of(0.4 / (1.0 + i as f64)),
        retract_gain: T::of(0.4 / (1.0 + i as f64)),
        extend_gain_slope: T::zero(),
        retract_gain_slope: T::zero(),
    };
    SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.6, 0.0, 0.0].map(T::of) },
        extend_viscosity_s: T::of(0.02),
        retract_viscosity_s: T::of(0.02),
        branches: std::array::from_fn(branch),
        range: StrainRange { lower: T::zero(), upper: T::of(0.3) },
    }
}

fn sensor_of<const B: usize, const N: usize>(law: SensorLaw<f64, B>) -> SwitchedModel<f64, B, N> {
    let motion = Motion::ornstein_uhlenbeck(0.6, 0.1, 0.12, 0.1).unwrap();
    let baseline_sd = if N == B + 3 { 0.02 } else { 0.0 };
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd, baseline_time_s: 20.0 };
    SwitchedModel::new(law, motion, noise).unwrap()
}

/// To and fro beyond both ends of the range, which a straight gauge does not know of.
fn reading(k: usize) -> f64 {
    0.25 + 0.4 * (k as f64 * 0.03).sin()
}

/// `x' = F x + u`, `y = H x`, with covariances Q and R: of the dense model in a phase, which here is all the same.
struct Matrices<const N: usize> {
    f: SMatrix<f64, N, N>,
    u: SVector<f64, N>,
    q: SMatrix<f64, N, N>,
    h: SVector<f64, N>,
    r: f64,
}

impl<const N: usize> Matrices<N> {
    fn of<const B: usize, const L: usize>(model: &SwitchedModel<f64, B, N>) -> Self {
        let nowhere = Belief::<f64, N, L> { mean: SVector::zeros(), ..Belief::initial(model) };
        let prepared = Dynamics::<f64, N, L>::prepare(model, DT_S);
        let transition = Dynamics::<f64, N, L>::transition(model, &prepared, &nowhere, Some(Phase::Extend));
        let observation = Channel::<f64, N, L>::observe(model, &nowhere, Some(Phase::Extend));
        Self {
            f: transition.jacobian,
            u: transition.mean,
            q: transition.noise.to_matrix(),
            h: observation.gradient,
            r: observation.variance,
        }
    }

    /// A textbook step: mean, covariance and gain after it.
    fn step(&self, x: &mut SVector<f64, N>, p: &mut SMatrix<f64, N, N>, reading: Option<f64>) -> SVector<f64, N> {
        *x = self.f * *x + self.u;
        *p = self.f * *p * self.f.transpose() + self.q;
        let Some(reading) = reading else { return SVector::zeros() };
        let gain = *p * self.h / (self.h.dot(&(*p * self.h)) + self.r);
        *x += gain * (reading - self.h.dot(x));
        let left = SMatrix::<f64, N, N>::identity() - gain * self.h.transpose();
        *p = left * *p * left.transpose() + gain * gain.transpose() * self.r;
        gain
    }
}

fn is_the_textbook_filter<const B: usize, const N: usize, const L: usize>() {
    let model = sensor_of::<B, N>(law());
    let matrices = Matrices::of::<B, L>(&model);
    let filter = LinearFilter::new(model, DT_S).unwrap();
    let mut belief = Belief::<f64, N, L>::initial(&model);
    let (mut x, mut p) = (belief.mean, belief.covariance.to_matrix());
    for k in 0..2000 {
        let reading = (k % 9 != 4).then(|| reading(k));
        filter.step(&mut belief, reading.map(Reading::from)).unwrap();
        matrices.step(&mut x, &mut p, reading);
        for i in 0..N {
            // Some 30 operations on quantities up to S/R ≈ 100 times larger than what is left, forgotten within 100 steps.
            let (sd, tolerance) = (p[(i, i)].sqrt(), 100.0 * 3000.0 * f64::EPSILON);
            assert!((belief.mean[i] - x[i]).abs() < tolerance * sd.max(x[i].abs()), "{B} {N}, step {k}, state {i}");
            for j in 0..=i {
                let apart = (belief.covariance[(i, j)] - p[(i, j)]).abs();
                assert!(apart < tolerance * (p[(i, i)] * p[(j, j)]).sqrt(), "{B} {N}, step {k}, {i} {j}");
            }
        }
    }
}

#[test]
fn a_linear_filter_is_the_textbook_one() {
    is_the_textbook_filter::<0, 2, 3>();
    is_the_textbook_filter::<1, 3, 6>();
    is_the_textbook_filter::<2, 5, 15>();
    is_the_textbook_filter::<3, 6, 21>();
}

#[test]
fn a_sensor_with_a_direction_is_refused() {
    let refused = |change: fn(&mut SensorLaw<f64, 1>)| {
        let mut other = law();
        change(&mut other);
        LinearFilter::new(sensor_of::<1, 3>(other), DT_S).err()
    };
    assert_eq!(refused(|_| {}), None);
    assert_eq!(refused(|law| law.retract_viscosity_s = 0.01), Some(StepError::Directed));
    assert_eq!(refused(|law| law.branches[0].retract_gain = 0.3), Some(StepError::Directed));
    assert_eq!(refused(|law| law.branches[0].extend_gain_slope = 0.1), Some(StepError::Directed));
    assert_eq!(refused(|law| law.branches[0].retract_gain_slope = 0.1), Some(StepError::Directed));
    let bend = |law: &mut SensorLaw<f64, 1>| law.gauge = Gauge::Polynomial { coefficients: [1.6, -1.0, 0.0] };
    assert_eq!(refused(bend), Some(StepError::OtherGauge));
    // A bent gauge alone needs no direction either.
    let mut bent = law();
    bend(&mut bent);
    assert!(SparseEkf::<f64, Undirected, 1, 3>::new(sensor_of(bent), DT_S).is_ok());
}

/// A bent gauge whose direction does not count: the filter that asks for the direction finds the same in either.
#[test]
fn without_a_direction_splitting_changes_nothing() {
    let bent = SensorLaw { gauge: Gauge::Polynomial { coefficients: [1.6, -1.0, 0.0] }, ..law() };
    let model = sensor_of::<2, 5>(bent);
    let split = SparseEkf::<f64, Compact, 2, 5>::new(model, DT_S).unwrap();
    let plain = SparseEkf::<f64, Undirected, 2, 5>::new(model, DT_S).unwrap();
    let mut beliefs = [Belief::<f64, 5, 15>::initial(&model); 2];
    for k in 0..1000 {
        split.step(&mut beliefs[0], Some(Reading::from(0.2 * reading(k)))).unwrap();
        plain.step(&mut beliefs[1], Some(Reading::from(0.2 * reading(k)))).unwrap();
        let [a, b] = &beliefs;
        for i in 0..5 {
            let sd = b.covariance[(i, i)].sqrt();
            assert!((a.mean[i] - b.mean[i]).abs() < 100.0 * 3000.0 * f64::EPSILON * sd, "step {k}, state {i}");
        }
    }
}

/// The gain that the textbook recursion settles at, and from there the same means.
#[test]
fn a_frozen_filter_is_the_limit() {
    let model = sensor_of::<2, 5>(law());
    let matrices = Matrices::of::<2, 15>(&model);
    let start = Belief::<f64, 5, 15>::initial(&model);
    let (mut x, mut p, mut gain) = (start.mean, start.covariance.to_matrix(), SVector::zeros());
    // Ten of the slowest time constants, 20 s.
    for _ in 0..10_000 {
        gain = matrices.step(&mut x, &mut p, Some(0.2));
    }
    let filter = LinearFilter::new(model, DT_S).unwrap();
    let frozen = filter.freeze(&start).unwrap();
    let largest = gain.amax();
    for i in 0..5 {
        // What is left of a step's change at 1/4 ε, over 1000 steps to forget it, and rounding of the recursion as above.
        let tolerance = (250.0 + 100.0 * 3000.0) * f64::EPSILON;
        assert!((frozen.gain()[i] - gain[i]).abs() < tolerance * largest, "{i}: {} {}", frozen.gain()[i], gain[i]);
    }
    let mut settled = Belief { mean: x, covariance: start.covariance };
    for _ in 0..10_000 {
        filter.step(&mut settled, Some(Reading::from(0.2))).unwrap();
    }
    let mut mean = settled.mean;
    for k in 0..1000 {
        // As many gaps as there are would make the filter's gain another one: here none.
        let (by_filter, by_gain) = (
            filter.step(&mut settled, Some(Reading::from(reading(k)))).unwrap().unwrap(),
            frozen.step(&mut mean, Some(reading(k))).unwrap().unwrap(),
        );
        assert!((by_gain.variance / by_filter.variance - 1.0).abs() < 1e-9, "step {k}");
        assert!((mean - settled.mean).amax() < 1e-9, "step {k}: {mean} {}", settled.mean);
    }
    frozen.step(&mut mean, None).unwrap();
    filter.step(&mut settled, None).unwrap();
    assert!((mean - settled.mean).amax() < 1e-9);
}

#[test]
fn a_frozen_filter_refuses_what_is_no_number() {
    let model = sensor_of::<1, 4>(law());
    let start = Belief::<f64, 4, 10>::initial(&model);
    let frozen = LinearFilter::new(model, DT_S).unwrap().freeze(&start).unwrap();
    let mut mean = start.mean;
    assert_eq!(frozen.step(&mut mean, Some(f64::NAN)), Err(StepError::NonFiniteReading));
    assert_eq!(frozen.step(&mut mean, Some(f64::INFINITY)), Err(StepError::NonFiniteReading));
    assert_eq!(mean, start.mean);
    mean[1] = f64::INFINITY;
    assert_eq!(frozen.step(&mut mean, Some(0.1)), Err(StepError::NonFiniteState));
    assert_eq!(frozen.step(&mut mean, None), Err(StepError::NonFiniteState));
}

/// In single precision a gain settles too.
#[test]
fn a_gain_settles_in_single_precision() {
    let motion = Motion::ornstein_uhlenbeck(0.6_f32, 0.1, 0.12, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 20.0 };
    let single: SwitchedModel<f32, 1, 4> = SwitchedModel::new(law(), motion, noise).unwrap();
    let start = Belief::<f32, 4, 10>::initial(&single);
    let filter = SparseEkf::<f32, Undirected, 1, 4, Line<f32>>::new(single, DT_S as f32).unwrap();
    let in_single = filter.freeze(&start).unwrap();
    let double = sensor_of::<1, 4>(law());
    let start = Belief::<f64, 4, 10>::initial(&double);
    let in_double = LinearFilter::new(double, DT_S).unwrap().freeze(&start).unwrap();
    let largest = in_double.gain().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for (single, double) in in_single.gain().iter().zip(in_double.gain()) {
        // Ten time constants of 20 s are 10⁴ steps of a rounding each.
        let tolerance = 1e4 * f64::from(f32::EPSILON);
        assert!((f64::from(*single) - double).abs() < tolerance * largest, "{single} {double}");
    }
}
