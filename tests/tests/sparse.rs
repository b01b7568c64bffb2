//! The sparse path gives the same results as the generic one.

use nalgebra::SVector;
use ohmstrain_ekf::{Belief, Compact, Cubic, Ekf, Estimator, Logistic, Reading, SparseEkf, StepError, Switch};
use ohmstrain_model::{Gauge, Scalar, SensorLaw, SwitchedModel, Symmetric};
use ohmstrain_tests::sensor;

const DT_S: f64 = 0.01;

/// Returns a slow sine with a hold: rates with certain and uncertain directions, and zero rates.
fn reading(k: usize) -> f64 {
    0.15 + 0.12 * (k as f64 * 0.01).sin().clamp(-0.8, 0.8)
}

/// Returns the largest difference of a step from the generic one over 3000 steps, each from the same belief: of means in
/// standard deviations, and of covariances relative to their diagonals. Also returns the difference of the total
/// log-likelihood.
fn differences<T: Scalar, const B: usize, const N: usize, const L: usize>() -> (f64, f64) {
    let model: SwitchedModel<T, B, N> = sensor();
    let generic = Ekf::new(model);
    let prepared = model.prepare(T::of(DT_S));
    let sparse = SparseEkf::<T, Logistic, B, N>::new(model, T::of(DT_S)).unwrap();
    let mut belief = Belief::<T, N, L>::initial(&model);
    let (mut worst, mut sum, mut accumulated) = (0.0_f64, 0.0, 0.0);
    for k in 0..3000 {
        let reading = (k % 7 != 3).then(|| Reading { value: T::of(reading(k)), extra_variance: T::of(1e-7) });
        let step = generic.step_prepared(&belief, &prepared, reading).unwrap();
        let mut fast = belief;
        let residual = sparse.step(&mut fast, reading).unwrap();
        let number = |x: T| x.to_subset().unwrap_or(f64::NAN);
        accumulated += residual.map_or(0.0, |residual| number(residual.log_likelihood()));
        sum += step.update.map_or(0.0, |update| number(update.log_likelihood));
        for i in 0..N {
            let sd_i = number(step.prior.covariance[(i, i)]).sqrt();
            worst = worst.max(number(fast.mean[i] - step.posterior.mean[i]).abs() / sd_i);
            for j in 0..=i {
                let sd_j = number(step.prior.covariance[(j, j)]).sqrt();
                let apart = number(fast.covariance[(i, j)] - step.posterior.covariance[(i, j)]).abs();
                worst = worst.max(apart / (sd_i * sd_j));
            }
        }
        belief = step.posterior;
    }
    (worst, (accumulated - sum).abs())
}

/// A step is about 30 operations deep, on quantities up to S/R ≈ 100 times larger than the result: 3000 ε of f64.
#[test]
fn agrees_with_the_generic_path_to_rounding() {
    for (difference, likelihood) in [
        differences::<f64, 0, 2, 3>(),
        differences::<f64, 1, 3, 6>(),
        differences::<f64, 1, 4, 10>(),
        differences::<f64, 2, 4, 10>(),
        differences::<f64, 3, 5, 15>(),
        differences::<f64, 3, 6, 21>(),
    ] {
        assert!(difference < 3000.0 * f64::EPSILON, "{difference:e}");
        // 3000 sums of a few units each.
        assert!(likelihood < 1e4 * 3000.0 * f64::EPSILON, "{likelihood:e}");
    }
    let (difference, _) = differences::<f32, 3, 6, 21>();
    assert!(difference < 3000.0 * f64::from(f32::EPSILON), "{difference:e}");
}

/// Compares the split with Simpson's rule over its density.
#[test]
fn the_compact_split_integrates_its_density() {
    let density = |u: f64| 35.0 / 96.0 * (1.0 - u * u / 9.0).max(0.0).powi(3);
    let integral = |f: &dyn Fn(f64) -> f64, from: f64, to: f64| {
        let (n, h) = (2000, (to - from) / 2000.0);
        let inner: f64 = (1..n).map(|k| f(from + k as f64 * h) * if k % 2 == 1 { 4.0 } else { 2.0 }).sum();
        (f(from) + f(to) + inner) * h / 3.0
    };
    for rate in [-2.9, -1.0, -0.2, 0.0, 0.7, 2.0, 2.99_f64] {
        let sd = 0.5;
        let split = Compact::blend(rate * sd, Compact::width(sd * sd));
        let probability = integral(&density, -3.0, rate);
        let mean = integral(&|u| (rate - u) * density(u), -3.0, rate);
        // Simpson's error with h = 3e-3 on a polynomial of degree 7: below 1e-10.
        assert!((split.extend_probability - probability).abs() < 1e-10, "{rate}");
        assert!((split.extend - sd * mean).abs() < 1e-10, "{rate}");
        assert!((split.extend + split.retract - sd * rate).abs() < 1e-15, "{rate}");
        assert!((split.extend_probability + split.retract_probability - 1.0).abs() < 1e-15, "{rate}");
    }
    // Checks the number in its documentation against the normal distribution.
    let normal = |u: f64| (-0.5 * u * u).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let off = (-400..=400)
        .map(|k| f64::from(k) * 0.01)
        .map(|u| (integral(&density, -3.0, u.clamp(-3.0, 3.0)) - integral(&normal, -8.0, u)).abs())
        .fold(0.0, f64::max);
    assert!((off - 0.0164).abs() < 5e-5, "{off}");
}

/// The covariance stays positive semi-definite without Joseph's form: 100,000 steps in `f32`, exact readings.
#[test]
fn stays_a_covariance_in_single_precision() {
    let model: SwitchedModel<f32, 3, 6> = sensor();
    let ekf = SparseEkf::<f32, Compact, 3, 6>::new(model, DT_S as f32).unwrap();
    let mut belief = Belief::<f32, 6, 21>::initial(&model);
    let mut least = f64::INFINITY;
    for k in 0..100_000 {
        ekf.step(&mut belief, Some(Reading::from(reading(k) as f32))).unwrap();
        let sd: [f64; 6] = std::array::from_fn(|i| f64::from(belief.covariance[(i, i)]).sqrt());
        let correlation =
            nalgebra::SMatrix::<f64, 6, 6>::from_fn(|i, j| f64::from(belief.covariance[(i, j)]) / (sd[i] * sd[j]));
        least = least.min(correlation.symmetric_eigenvalues().min());
    }
    // An eigenvalue of a 6 × 6 correlation matrix is uncertain by 6 ε; twice that allows for one step's rounding.
    assert!(least > -12.0 * f64::from(f32::EPSILON), "{least:e}");
}

/// Within the gate, a gated step is the step; beyond it, the prediction; refused steps stay refused.
#[test]
fn a_gated_step_is_a_step_or_a_prediction() {
    let model: SwitchedModel<f64, 3, 6> = sensor();
    let ekf = SparseEkf::<f64, Compact, 3, 6, Cubic<f64>>::new(model, DT_S).unwrap();
    let mut belief = Belief::<f64, 6, 21>::initial(&model);
    let mut turned_down = 0;
    for k in 0..1000 {
        let spike = if k % 50 == 49 { 0.5 } else { 0.0 };
        let reading = Reading { value: reading(k) + spike, extra_variance: 1e-7 };
        let (mut plain, mut ahead) = (belief, belief);
        let seen = ekf.step(&mut plain, Some(reading)).unwrap().unwrap();
        ekf.step(&mut ahead, None).unwrap();
        let residual = ekf.step_gated(&mut belief, reading, 10.8).unwrap();
        assert_eq!(residual, seen);
        assert_eq!(belief, if residual.nis <= 10.8 { plain } else { ahead }, "step {k}");
        turned_down += u32::from(residual.nis > 10.8);
    }
    assert!((20..200).contains(&turned_down), "{turned_down}");
    let before = belief;
    let refused = ekf.step_gated(&mut belief, Reading::from(f64::NAN), 10.8);
    assert_eq!((refused, belief), (Err(StepError::NonFiniteReading), before));
}

#[test]
fn an_error_leaves_the_belief() {
    let model: SwitchedModel<f64, 1, 3> = sensor();
    let ekf = SparseEkf::<f64, Compact, 1, 3>::new(model, DT_S).unwrap();
    let start = Belief::<f64, 3, 6>::initial(&model);
    let mut belief = start;
    let refused = |belief: &mut Belief<f64, 3, 6>, value, extra_variance| {
        ekf.step(belief, Some(Reading { value, extra_variance })).unwrap_err()
    };
    assert_eq!(refused(&mut belief, f64::NAN, 0.0), StepError::NonFiniteReading);
    assert_eq!(refused(&mut belief, f64::INFINITY, 0.0), StepError::NonFiniteReading);
    assert_eq!(refused(&mut belief, 0.1, f64::NAN), StepError::NonFiniteReading);
    assert_eq!(refused(&mut belief, 0.1, -1e3), StepError::NegativeVariance);
    assert_eq!(belief, start);
    let mut lost = Belief { mean: SVector::from([f64::NAN, 0.0, 0.0]), covariance: Symmetric::zeros() };
    assert_eq!(refused(&mut lost, 0.1, 0.0), StepError::NonFiniteState);
    assert!(SparseEkf::<f64, Compact, 1, 3>::new(model, 0.0).is_err());
    assert!(SparseEkf::<f64, Compact, 1, 3>::new(model, f64::NAN).is_err());
}

/// No step, with or without a reading, passes on an invalid belief.
#[test]
fn a_lost_belief_goes_no_further() {
    let model: SwitchedModel<f64, 1, 4> = sensor();
    let ekf = SparseEkf::<f64, Compact, 1, 4>::new(model, DT_S).unwrap();
    let check = |belief: Belief<f64, 4, 10>, what: &str| {
        for reading in [None, Some(Reading::from(0.1))] {
            let mut stepped = belief;
            assert!(ekf.step(&mut stepped, reading).is_err(), "{what}, {reading:?}: {stepped:?}");
        }
    };
    for i in 0..4 {
        for lost in [f64::NAN, f64::INFINITY] {
            let mut belief = Belief::<f64, 4, 10>::initial(&model);
            belief.mean[i] = lost;
            check(belief, "mean");
            let mut belief = Belief::<f64, 4, 10>::initial(&model);
            belief.covariance[(i, i)] = lost;
            check(belief, "variance");
        }
    }
}

/// Returns the largest differences of beliefs smoothed by the sparse and the general filter, both with the logistic switch: for
/// single backward steps, and for successive steps through the whole series.
fn smoothed_differences<const B: usize, const N: usize, const L: usize>() -> [f64; 2] {
    let model: SwitchedModel<f64, B, N> = sensor();
    let readings: Vec<_> =
        (0..800).map(|k| (k % 7 != 3).then(|| Reading { value: reading(k), extra_variance: 1e-7 })).collect();
    let apart = |a: &Belief<f64, N, L>, b: &Belief<f64, N, L>, filtered: &Belief<f64, N, L>| {
        let sd = |i: usize| filtered.covariance[(i, i)].sqrt();
        let mut worst = 0.0_f64;
        for i in 0..N {
            worst = worst.max((a.mean[i] - b.mean[i]).abs() / sd(i));
            for j in 0..=i {
                worst = worst.max((a.covariance[(i, j)] - b.covariance[(i, j)]).abs() / (sd(i) * sd(j)));
            }
        }
        worst
    };

    let (generic, prepared) = (Ekf::new(model), model.prepare(DT_S));
    let sparse = SparseEkf::<f64, Logistic, B, N>::new(model, DT_S).unwrap();
    let mut belief = Belief::<f64, N, L>::initial(&model);
    let filtered: Vec<_> = readings
        .iter()
        .map(|reading| {
            sparse.step(&mut belief, *reading).unwrap();
            belief
        })
        .collect();
    let back = |k: usize, later: [&Belief<f64, N, L>; 2]| {
        [
            sparse.smooth_back(&filtered[k - 1], &sparse, readings[k], later[0]).unwrap(),
            generic.smooth_back(&filtered[k - 1], &prepared, readings[k], later[1]).unwrap(),
        ]
    };
    let (mut beside, mut along, mut smoothed) = (0.0_f64, 0.0_f64, [belief; 2]);
    for k in (1..readings.len()).rev() {
        // A belief that later readings have moved by a standard deviation and narrowed.
        let next = &filtered[k];
        let sd = next.covariance.to_matrix().diagonal().map(f64::sqrt);
        let later = Belief { mean: next.mean + sd, covariance: next.covariance.scaled(0.5) };
        let [of_sparse, of_generic] = back(k, [&later; 2]);
        beside = beside.max(apart(&of_sparse, &of_generic, &filtered[k - 1]));
        smoothed = back(k, [&smoothed[0], &smoothed[1]]);
        along = along.max(apart(&smoothed[0], &smoothed[1], &filtered[k - 1]));
    }
    [beside, along]
}

/// A step as in the tests above, 3000 ε; 800 successive steps. A backward step solves for the gain in directions down to ε^⅔ of
/// their variance, which costs up to N² ε^⅓ of the covariance for a direction as certain as that. Here none is below 10⁻⁴, for
/// which a gain of up to 10² amplifies a rounding by 10².
#[test]
fn goes_back_as_the_general_filter_does() {
    for [beside, along] in [
        smoothed_differences::<0, 2, 3>(),
        smoothed_differences::<1, 3, 6>(),
        smoothed_differences::<1, 4, 10>(),
        smoothed_differences::<3, 6, 21>(),
    ] {
        assert!(beside < 1e2 * 3000.0 * f64::EPSILON, "{beside:e}");
        assert!(along < 800.0 * 1e2 * 3000.0 * f64::EPSILON, "{along:e}");
    }
}

/// A retimed filter equals a new filter for that step length; the cubic-only curve equals the cubic among other gauges.
#[test]
fn a_retimed_filter_is_a_new_one() {
    let model: SwitchedModel<f64, 3, 6> = sensor();
    let mut ekf = SparseEkf::<f64, Compact, 3, 6, Cubic<f64>>::new(model, DT_S).unwrap();
    let fresh = SparseEkf::<f64, Compact, 3, 6, Cubic<f64>>::new(model, 3.0 * DT_S).unwrap();
    let same = ekf;
    ekf.retime(DT_S).unwrap();
    assert_eq!(ekf, same);
    assert_eq!(ekf.retime(-DT_S), Err(StepError::NegativeTimeStep));
    assert_eq!(ekf.retime(f64::NAN), Err(StepError::NonFiniteTimeStep));
    assert_eq!(ekf, same);
    ekf.retime(3.0 * DT_S).unwrap();
    assert_eq!(ekf, fresh);

    let any = SparseEkf::<f64, Compact, 3, 6>::new(model, DT_S).unwrap();
    let (mut a, mut b) = (Belief::<f64, 6, 21>::initial(&model), Belief::<f64, 6, 21>::initial(&model));
    for k in 0..300 {
        // Also beyond the range, where both continue along the tangent.
        let reading = Some(Reading::from(reading(k) + 0.002 * k as f64));
        any.step(&mut a, reading).unwrap();
        same.step(&mut b, reading).unwrap();
    }
    for i in 0..6 {
        // 300 steps, each off by a few roundings of numbers up to 1/sd ≈ 1e3 times larger than a standard deviation.
        let sd = a.covariance[(i, i)].sqrt();
        assert!((a.mean[i] - b.mean[i]).abs() < 300.0 * 1e3 * f64::EPSILON * sd, "{i}");
    }
}

/// Beliefs with invalid covariances, and numbers up to the limit of `f32`: a step refuses them, or leaves finite numbers
/// without a negative variance. The kernel checks only a few of its numbers; this test checks all.
#[test]
fn what_a_step_accepts_is_finite() {
    let model: SwitchedModel<f32, 3, 6> = sensor();
    let ekf = SparseEkf::<f32, Compact, 3, 6>::new(model, DT_S as f32).unwrap();
    let mut state = 1_u64;
    let mut uniform = || {
        // Upper bits of Knuth's MMIX generator.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    };
    let mut accepted = 0;
    for k in 0..200_000 {
        let reach = [1.0, 10.0, 38.0][k % 3];
        let mut wild = || (uniform() - 0.5).signum() * 10_f32.powf(reach * (2.0 * uniform() - 1.0));
        let mut covariance: [f32; 21] = std::array::from_fn(|_| wild());
        for diagonal in [0, 2, 5, 9, 14, 20] {
            covariance[diagonal] = covariance[diagonal].abs();
        }
        let mut belief = Belief {
            mean: SVector::<f32, 6>::from_fn(|_, _| wild()),
            covariance: Symmetric::<f32, 6, 21>::from_packed(covariance),
        };
        let before = belief;
        if ekf.step(&mut belief, Some(Reading::from(wild()))).is_ok() {
            accepted += 1;
            assert!(belief.is_finite(), "{before:?} became {belief:?}");
            assert!((0..6).all(|i| belief.covariance[(i, i)] >= 0.0), "{belief:?}");
        } else {
            assert_eq!(belief, before);
        }
    }
    assert!(accepted > 1000, "{accepted} accepted: nothing was tested");
}

#[test]
fn a_cubic_refuses_other_gauges() {
    let model: SwitchedModel<f64, 1, 3> = sensor();
    let gauge = Gauge::DecayingExponential { slope: 1.5, decay_strain: 0.4 };
    let law = SensorLaw { gauge, ..*model.law() };
    let other = SwitchedModel::new(law, *model.motion(), *model.noise()).unwrap();
    let refused = SparseEkf::<f64, Compact, 1, 3, Cubic<f64>>::new(other, DT_S);
    assert_eq!(refused.err(), Some(StepError::OtherGauge));
    assert!(SparseEkf::<f64, Compact, 1, 3>::new(other, DT_S).is_ok());
}
