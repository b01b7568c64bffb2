//! A bank computes for every sensor what the sparse filter computes for one.

use ohmstrain_ekf::{Bank, Belief, Compact, Lane, Reading, SparseEkf, StepError, WrongLength};
use ohmstrain_model::{Gauge, SwitchedModel};
use ohmstrain_tests::sensor;

const DT_S: f64 = 0.01;
/// Bound of one step in ε, derived below.
const DEEP: f64 = 5000.0;
const COUNTS: [usize; 5] = [1, 3, 8, 9, 33];

fn number<T: Lane>(x: T) -> f64 {
    nalgebra::try_convert(x).unwrap_or(f64::NAN)
}

/// A slow sine with a hold, for each sensor in another phase, some of it beyond the range: rates that are clear, uncertain
/// and none. Every seventh reading is missing, not the same for all.
fn reading<T: Lane>(k: usize, sensor: usize) -> T {
    let phase = k as f64 * 0.01 + sensor as f64;
    let missing = (k + 3 * sensor) % 7 == 3;
    T::of(if missing { f64::NAN } else { 0.15 + 0.35 * phase.sin().clamp(-0.8, 0.8) })
}

fn readings<T: Lane>(k: usize, sensors: usize) -> Vec<T> {
    (0..sensors).map(|sensor| reading(k, sensor)).collect()
}

fn as_option<T: Lane>(value: T, extra_variance: T) -> Option<Reading<T>> {
    (!value.is_nan()).then_some(Reading { value, extra_variance })
}

trait IsNan {
    fn is_nan(&self) -> bool;
}

impl<T: Lane> IsNan for T {
    fn is_nan(&self) -> bool {
        self.partial_cmp(self).is_none()
    }
}

/// Difference of means in deviations, and of covariances relative to their diagonals.
fn apart<T: Lane, const N: usize, const L: usize>(a: &Belief<T, N, L>, b: &Belief<T, N, L>, scale: &[f64; N]) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..N {
        worst = worst.max(number(a.mean[i] - b.mean[i]).abs() / scale[i]);
        for j in 0..=i {
            worst = worst.max(number(a.covariance[(i, j)] - b.covariance[(i, j)]).abs() / (scale[i] * scale[j]));
        }
    }
    worst
}

fn deviations<T: Lane, const N: usize, const L: usize>(belief: &Belief<T, N, L>) -> [f64; N] {
    std::array::from_fn(|i| number(belief.covariance[(i, i)]).sqrt())
}

/// Largest difference from the sparse filter over 3000 steps of as many sensors, each step from the same beliefs.
fn difference<T: Lane, const B: usize, const N: usize, const L: usize>(bits: usize, sensors: usize) -> f64 {
    let model: SwitchedModel<T, B, N> = sensor();
    let ekf = SparseEkf::<T, Compact, B, N>::new(model, T::of(DT_S)).unwrap();
    let mut bank = Bank::<T, B, N, L>::new(model, T::of(DT_S), sensors).unwrap().with_vectors_up_to(bits);
    let mut beliefs = vec![Belief::<T, N, L>::initial(&model); sensors];
    let extra: Vec<T> = (0..sensors).map(|sensor| T::of(1e-7 * sensor as f64)).collect();
    let mut worst = 0.0_f64;
    for k in 0..3000 {
        let readings = readings(k, sensors);
        assert_eq!(bank.step_with_variances(&readings, &extra), Ok(0));
        for (sensor, belief) in beliefs.iter_mut().enumerate() {
            let old = deviations(belief);
            let taken = ekf.step(belief, as_option(readings[sensor], extra[sensor])).unwrap();
            // Against the deviations before the step: those after it may be much smaller.
            worst = worst.max(apart(&bank.belief(sensor).unwrap(), belief, &old));
            let outcome = bank.outcome(sensor).unwrap().unwrap();
            assert_eq!(outcome.is_some(), taken.is_some());
            if let (Some(one), Some(other)) = (outcome, taken) {
                let sd = number(other.variance).sqrt();
                worst = worst.max(number(one.innovation - other.innovation).abs() / sd);
                worst = worst.max((number(one.variance / other.variance) - 1.0).abs());
            }
            assert!(bank.set_belief(sensor, belief));
        }
    }
    worst
}

/// Vectors of 128 bits on x86 have no fused multiplication and addition: nothing but the order of operations is left.
#[cfg(target_arch = "x86_64")]
#[test]
fn is_the_sparse_filter_to_the_last_bit_where_nothing_is_fused() {
    for sensors in COUNTS {
        assert_eq!(difference::<f64, 0, 2, 3>(128, sensors), 0.0);
        assert_eq!(difference::<f64, 1, 4, 10>(128, sensors), 0.0);
        assert_eq!(difference::<f64, 3, 6, 21>(128, sensors), 0.0);
        assert_eq!(difference::<f32, 1, 3, 6>(128, sensors), 0.0);
        assert_eq!(difference::<f32, 3, 6, 21>(128, sensors), 0.0);
    }
}

/// A fused operation leaves out one rounding of a product, half an ε of it.
///
/// Covariances: a step is some 30 operations deep, on quantities up to S/R ≈ 100 times larger than what is left: 3000 ε.
/// Means: the expected reading has eight fused products (five of the gauge, one of its tangent, two of the dash-pot), each
/// of them below 1, and is seen in deviations of no less than 2e-3: 8 · ½ / 2e-3 = 2000 ε more.
#[test]
fn is_the_sparse_filter_to_rounding_in_vectors_of_any_width() {
    for bits in [128, 256, 512] {
        for sensors in COUNTS {
            let of_f64 = [
                difference::<f64, 0, 2, 3>(bits, sensors),
                difference::<f64, 1, 4, 10>(bits, sensors),
                difference::<f64, 2, 4, 10>(bits, sensors),
                difference::<f64, 3, 6, 21>(bits, sensors),
            ];
            assert!(of_f64.iter().all(|worst| *worst < DEEP * f64::EPSILON), "{bits} {sensors} {of_f64:?}");
            let of_f32 = [difference::<f32, 1, 3, 6>(bits, sensors), difference::<f32, 3, 6, 21>(bits, sensors)];
            assert!(of_f32.iter().all(|w| *w < DEEP * f64::from(f32::EPSILON)), "{bits} {sensors} {of_f32:?}");
        }
    }
}

/// Left alone for 3000 steps, rounding is forgotten as fast as anything else: the slowest time constant here, the branch of
/// 32 s, is 3200 steps, of which each may add what one step does.
#[test]
fn stays_with_the_sparse_filter_for_thousands_of_steps() {
    let model: SwitchedModel<f64, 2, 5> = sensor();
    let ekf = SparseEkf::<f64, Compact, 2, 5>::new(model, DT_S).unwrap();
    let mut bank = Bank::<f64, 2, 5, 15>::new(model, DT_S, 9).unwrap();
    let mut beliefs = vec![Belief::<f64, 5, 15>::initial(&model); 9];
    for k in 0..3000 {
        let readings = readings(k, 9);
        assert_eq!(bank.step(&readings), Ok(0));
        for (sensor, belief) in beliefs.iter_mut().enumerate() {
            ekf.step(belief, as_option(readings[sensor], 0.0)).unwrap();
            let worst = apart(&bank.belief(sensor).unwrap(), belief, &deviations(belief));
            assert!(worst < 3200.0 * DEEP * f64::EPSILON, "{k} {sensor} {worst:e}");
        }
    }
    let strains: Vec<_> = bank.strains().collect();
    assert_eq!(strains.len(), 9);
    for (sensor, strain) in strains.iter().enumerate() {
        assert_eq!(Some(*strain), bank.strain(sensor));
        assert_eq!(strain.mean, bank.belief(sensor).unwrap().mean[0]);
        assert_eq!(strain.variance, bank.belief(sensor).unwrap().covariance[(0, 0)]);
    }
}

/// Sensor by sensor, the gauge with an exponential gives the same numbers too.
#[test]
fn knows_the_gauges_with_an_exponential() {
    let polynomial: SwitchedModel<f64, 1, 4> = sensor();
    for gauge in [
        Gauge::DecayingExponential { slope: 1.6, decay_strain: 0.3 },
        Gauge::Tunnelling { gap: 0.5, barrier: 1.0, path_loss: -2.0 },
    ] {
        let mut law = *polynomial.law();
        law.gauge = gauge;
        let model = SwitchedModel::new(law, *polynomial.motion(), *polynomial.noise()).unwrap();
        let ekf = SparseEkf::<f64, Compact, 1, 4>::new(model, DT_S).unwrap();
        let mut bank = Bank::<f64, 1, 4, 10>::new(model, DT_S, 3).unwrap();
        for k in 0..500 {
            let readings = readings(k, 3);
            let old = std::array::from_fn::<_, 3, _>(|sensor| bank.belief(sensor).unwrap());
            assert_eq!(bank.step(&readings), Ok(0));
            for (sensor, mut belief) in old.into_iter().enumerate() {
                let scale = deviations(&belief);
                ekf.step(&mut belief, as_option(readings[sensor], 0.0)).unwrap();
                let worst = apart(&bank.belief(sensor).unwrap(), &belief, &scale);
                assert!(worst < DEEP * f64::EPSILON, "{gauge:?} {worst:e}");
            }
        }
    }
}

/// What a lane is refused for is what the sparse filter says; its belief stays, and all others are, to the last bit, what
/// they are without it.
#[test]
fn a_refused_sensor_keeps_its_belief_and_disturbs_nobody() {
    let model: SwitchedModel<f64, 1, 4> = sensor();
    let ekf = SparseEkf::<f64, Compact, 1, 4>::new(model, DT_S).unwrap();
    let cases = [
        (f64::INFINITY, 0.0, StepError::NonFiniteReading),
        (f64::NEG_INFINITY, 0.0, StepError::NonFiniteReading),
        (0.1, f64::NAN, StepError::NonFiniteReading),
        (0.1, -1e3, StepError::NegativeVariance),
    ];
    for bits in [128, 256, 512] {
        for ill in 0..17 {
            let mut bank = Bank::<f64, 1, 4, 10>::new(model, DT_S, 17).unwrap().with_vectors_up_to(bits);
            let mut healthy = bank.clone();
            for k in 0..40 {
                let (value, variance, error) = cases[k % cases.len()];
                let (mut readings, mut extra) = (readings(k, 17), vec![0.0; 17]);
                let before = bank.belief(ill).unwrap();
                assert_eq!(healthy.step_with_variances(&readings, &extra), Ok(0));
                (readings[ill], extra[ill]) = (value, variance);
                assert_eq!(bank.step_with_variances(&readings, &extra), Ok(1));
                assert_eq!(bank.belief(ill), Some(before));
                assert_eq!(bank.outcome(ill), Some(Err(error)));
                let mut one = before;
                assert_eq!(ekf.step(&mut one, Some(Reading { value, extra_variance: variance })), Err(error));
                for other in (0..17).filter(|other| *other != ill) {
                    assert_eq!(bank.belief(other), healthy.belief(other));
                    assert_eq!(bank.outcome(other), healthy.outcome(other));
                }
            }
        }
    }
}

/// A belief that is no number is refused with a reading and without, and stays what it is until it is set again.
#[test]
fn a_lost_belief_stays_lost_alone() {
    let model: SwitchedModel<f32, 1, 3> = sensor();
    let start = Belief::<f32, 3, 6>::initial(&model);
    let mut lost = start;
    lost.mean[2] = f32::NAN;
    let mut bank = Bank::<f32, 1, 3, 6>::new(model, DT_S as f32, 18).unwrap();
    assert!(bank.set_belief(16, &lost));
    for value in [0.1, f32::NAN] {
        let mut readings = vec![0.1; 18];
        readings[16] = value;
        assert_eq!(bank.step(&readings), Ok(1));
        assert_eq!(bank.outcome(16), Some(Err(StepError::NonFiniteState)));
        assert_eq!(bank.belief(16).map(|belief| belief.covariance), Some(start.covariance));
        assert_eq!(bank.belief(17), bank.belief(0));
        assert!(bank.belief(17).unwrap().is_finite());
    }
    assert!(bank.set_belief(16, &start));
    assert_eq!(bank.step(&[0.1; 18]), Ok(0));
}

#[test]
fn refuses_what_does_not_fit() {
    let model: SwitchedModel<f64, 1, 3> = sensor();
    assert!(Bank::<f64, 1, 3, 6>::new(model, 0.0, 3).is_err());
    let mut bank = Bank::<f64, 1, 3, 6>::new(model, DT_S, 3).unwrap();
    let before = bank.belief(0);
    assert_eq!(bank.step(&[0.1; 4]), Err(WrongLength { sensors: 3, found: 4 }));
    assert_eq!(bank.step_with_variances(&[0.1; 3], &[0.0; 2]), Err(WrongLength { sensors: 3, found: 2 }));
    assert_eq!(bank.belief(0), before);
    assert_eq!((bank.belief(3), bank.strain(3), bank.outcome(3)), (None, None, None));
    assert!(!bank.set_belief(3, &before.unwrap()));
    assert_eq!(bank.outcome(0), Some(Ok(None)));
    assert_eq!(bank.sensors(), 3);
    let mut none = Bank::<f64, 1, 3, 6>::new(model, DT_S, 0).unwrap();
    assert_eq!((none.step(&[]), none.strains().count()), (Ok(0), 0));
}
