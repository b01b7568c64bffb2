//! Exact diffuse start: published figures of the Nile and of KFAS, the dense Gaussian with a flat prior written out, and
//! what must hold besides. Provenance of the figures stands in the fixture.

use nalgebra::{DMatrix, DVector, SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::{
    Belief, Channel, DiffuseBelief, DiffuseEkf, DiffuseStep, DiffuseUpdate, Dynamics, Ekf, Reading, StepError,
    Undetermined, diffuse_smooth,
};
use ohmstrain_model::{Scalar, Symmetric};
use ohmstrain_tests::{Linear, sensor};
use proptest::prelude::*;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value;

/// Figures of other programs agree with each other to 1e-12 of their size; ten times that leaves room for the order of
/// operations over a hundred steps.
const PUBLISHED: f64 = 1e-11;

fn fixture() -> Value {
    serde_json::from_str(include_str!("../fixtures/diffuse.json")).unwrap()
}

/// Numbers of an array, null as NaN.
fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
}

fn assert_close(got: f64, expected: f64, relative: f64, what: &str) {
    assert!((got - expected).abs() <= relative * (1.0 + expected.abs()), "{what}: {got} vs {expected}");
}

/// Filters readings, NaN for a missing one; the first is an update without a prediction.
fn run<M, T: Scalar, const N: usize, const L: usize>(
    model: M,
    start: DiffuseBelief<T, N, L>,
    readings: &[f64],
) -> Vec<DiffuseStep<T, N, L>>
where
    M: Dynamics<T, N, L> + Channel<T, N, L>,
{
    let filter = DiffuseEkf::new(model);
    let mut belief = start;
    let mut steps = Vec::new();
    for (k, y) in readings.iter().enumerate() {
        let dt_s = if k == 0 { T::zero() } else { T::of(0.1) };
        let step = filter.step(&belief, dt_s, y.is_finite().then(|| Reading::from(T::of(*y)))).unwrap();
        belief = step.posterior;
        steps.push(step);
    }
    steps
}

fn smooth<T: Scalar, const N: usize, const L: usize>(
    steps: &[DiffuseStep<T, N, L>],
) -> Result<Vec<Belief<T, N, L>>, Undetermined> {
    let mut smoothed: Vec<_> = steps.iter().map(|step| step.posterior.finite).collect();
    diffuse_smooth(steps, &mut smoothed)?;
    Ok(smoothed)
}

/// Log-likelihood with and without the constants of readings that fixed a direction.
fn log_likelihoods<const N: usize, const L: usize>(steps: &[DiffuseStep<f64, N, L>]) -> (f64, f64) {
    let updates = || steps.iter().filter_map(|step| step.update);
    let with = updates().map(|update| update.log_likelihood()).sum();
    (with, updates().map(|update| update.log_likelihood_without_constant()).sum())
}

fn unknown<T: Scalar, const N: usize, const L: usize>(scale: &[T; N]) -> DiffuseBelief<T, N, L> {
    DiffuseBelief::new(Belief::independent(SVector::zeros(), &[T::zero(); N]), scale)
}

fn local_level(variance: f64, noise: f64) -> Linear<f64, 1> {
    Linear { transition: matrix![1.0], noise: matrix![noise], gradient: vector![1.0], variance }
}

#[test]
fn the_nile() {
    let fixture = fixture();
    let nile = &fixture["nile"];
    let series = numbers(&nile["series"]);
    // The log-likelihood of the full series is stated with the first reading consumed, as its constant and nothing else:
    // F∞ = 1. Sums of a hundred terms are printed to ten figures.
    let consumed = nile["at"]["loglik_first_observation_consumed"].as_f64().unwrap();
    let missing = nile["missing"]["loglik_constant_included"].as_f64().unwrap();
    let expected = [consumed - 0.5 * std::f64::consts::TAU.ln(), missing];
    for (part, log_likelihood) in ["at", "missing"].into_iter().zip(expected) {
        let seen = |k: usize| part == "at" || !((20..40).contains(&k) || (60..80).contains(&k));
        let readings: Vec<f64> = (0..100).map(|k| if seen(k) { series[k] } else { f64::NAN }).collect();
        let steps = run(local_level(15099.0, 1469.1), unknown::<f64, 1, 1>(&[1.0]), &readings);
        let smoothed = smooth(&steps).unwrap();
        let oracle = |name: &str| numbers(&nile[part][name]);
        let (filtered, filtered_var) = (oracle("filtered"), oracle("filtered_var"));
        let (smooth_mean, smooth_var) = (oracle("smoothed"), oracle("smoothed_var"));
        for k in 0..100 {
            let posterior = steps[k].posterior.settled().unwrap();
            assert_close(posterior.mean[0], filtered[k], PUBLISHED, "filtered");
            assert_close(posterior.covariance[(0, 0)], filtered_var[k], PUBLISHED, "filtered variance");
            assert_close(smoothed[k].mean[0], smooth_mean[k], PUBLISHED, "smoothed");
            assert_close(smoothed[k].covariance[(0, 0)], smooth_var[k], PUBLISHED, "smoothed variance");
        }
        assert_close(log_likelihoods(&steps).0, log_likelihood, 1e-11, part);
    }
}

fn check_kfas<const N: usize, const L: usize>(model: Linear<f64, N>, readings: &[f64; 10], name: &str) {
    let oracle = &fixture()[name];
    let steps = run(model, unknown::<f64, N, L>(&[1.0; N]), readings);
    let smoothed = smooth(&steps).unwrap();
    let column = |name: &str| numbers(&oracle[name]);
    let (att, alphahat): (Vec<_>, Vec<_>) =
        (1..=N).map(|i| (column(&format!("att_{i}")), column(&format!("alphahat_{i}")))).unzip();
    let (f, f_inf, v, sum_v) = (column("F_1"), column("Finf_1"), column("v_1"), column("sumV"));
    for k in 0..10 {
        // KFAS prints fifteen figures.
        for i in 0..N {
            assert_close(steps[k].posterior.finite.mean[i], att[i][k], 1e-13, "att");
            assert_close(smoothed[k].mean[i], alphahat[i][k], 1e-13, "alphahat");
        }
        let sum: f64 = smoothed[k].covariance.to_matrix().sum();
        assert_close(sum, sum_v[k], 1e-13, "V");
        match steps[k].update {
            Some(DiffuseUpdate::Fixed { innovation, finite_variance, diffuse_variance, .. }) => {
                assert_close(innovation, v[k], 1e-13, "v");
                assert_close(finite_variance, f[k], 1e-13, "F*");
                assert_close(diffuse_variance, f_inf[k], 1e-13, "F∞");
            }
            Some(DiffuseUpdate::Ordinary(update)) => {
                assert!(!(f_inf[k] > 0.0));
                assert_close(update.innovation, v[k], 1e-13, "v");
                assert_close(update.innovation_variance, f[k], 1e-13, "F");
            }
            None => assert!(v[k].is_nan()),
        }
    }
    let (with, without) = log_likelihoods(&steps);
    assert_close(without, oracle["llf"].as_f64().unwrap(), 1e-13, "llf");
    // Printed with ten decimals.
    assert!((with - oracle["llf_with_constants"].as_f64().unwrap()).abs() < 6e-11);
}

#[test]
fn kfas_local_level() {
    let mut readings = [1.0; 10];
    readings[0] = 10.2394;
    check_kfas::<1, 1>(local_level(1.993, 8.253), &readings, "local_level");
}

fn local_linear_trend() -> Linear<f64, 2> {
    Linear {
        transition: matrix![1.0, 1.0; 0.0, 1.0],
        noise: matrix![8.253, 0.0; 0.0, 2.334],
        gradient: vector![1.0, 0.0],
        variance: 1.993,
    }
}

#[test]
fn kfas_local_linear_trend() {
    let mut readings = [1.0; 10];
    readings[..3].copy_from_slice(&[10.2394, 4.2039, 6.123123]);
    check_kfas::<2, 3>(local_linear_trend(), &readings, "trend");
    readings[1] = f64::NAN;
    check_kfas::<2, 3>(local_linear_trend(), &readings, "trend_missing");
}

/// Smoothed means, covariances, diffuse log-likelihood and the condition number of the information on δ, from one dense
/// Gaussian: x = X δ + u with δ flat, by generalised least squares. The first state has no prediction before it.
fn dense<const N: usize>(
    model: &Linear<f64, N>,
    start: &SMatrix<f64, N, N>,
    flat: &DMatrix<f64>,
    readings: &[f64],
) -> (DVector<f64>, DMatrix<f64>, f64, f64) {
    let count = readings.len();
    let mut x = DMatrix::zeros(N * count, flat.ncols());
    let mut cov = DMatrix::zeros(N * count, N * count);
    let (mut block, mut p) = (flat.clone(), *start);
    for k in 0..count {
        if k > 0 {
            block = DMatrix::from_column_slice(N, N, model.transition.as_slice()) * block;
            p = model.transition * p * model.transition.transpose() + model.noise;
        }
        x.rows_mut(N * k, N).copy_from(&block);
        let mut cross = p;
        for later in k..count {
            cov.view_mut((N * k, N * later), (N, N)).copy_from(&cross);
            cov.view_mut((N * later, N * k), (N, N)).copy_from(&cross.transpose());
            cross *= model.transition.transpose();
        }
    }
    let seen: Vec<usize> = (0..count).filter(|k| readings[*k].is_finite()).collect();
    let h =
        DMatrix::from_fn(
            seen.len(),
            N * count,
            |row, column| {
                if column / N == seen[row] { model.gradient[column % N] } else { 0.0 }
            },
        );
    let y = DVector::from_iterator(seen.len(), seen.iter().map(|k| readings[*k]));
    let v = &h * &cov * h.transpose() + DMatrix::identity(seen.len(), seen.len()) * model.variance;
    let inverse = v.clone().try_inverse().unwrap();
    let z = &h * &x;
    let information = z.transpose() * &inverse * &z;
    let eigenvalues = information.symmetric_eigenvalues();
    let condition = eigenvalues.max() / eigenvalues.min();
    assert!(condition < 1e7, "{eigenvalues}");
    let spread = information.clone().try_inverse().unwrap();
    let delta = &spread * z.transpose() * &inverse * &y;
    let rest = &y - &z * &delta;
    let gain = &cov * h.transpose() * &inverse;
    let mean = &x * &delta + &gain * &rest;
    let lever = &x - &gain * &z;
    let covariance = &cov - &gain * &h * &cov + &lever * &spread * lever.transpose();
    let log_density = -0.5
        * (rest.dot(&(&inverse * &rest))
            + v.determinant().ln()
            + information.determinant().ln()
            + seen.len() as f64 * std::f64::consts::TAU.ln());
    (mean, covariance, log_density, condition)
}

fn check_against_dense<const N: usize, const L: usize>(seed: u64, scale: [f64; N]) {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    // A random rotation forgets nothing, so that every direction is found soon.
    let mut columns: [SVector<f64, N>; N] = std::array::from_fn(|_| SVector::from_fn(|_, _| normal()));
    SVector::orthonormalize(&mut columns);
    let root = SMatrix::<f64, N, N>::from_fn(|_, _| normal());
    let model = Linear {
        transition: SMatrix::from_columns(&columns) * 0.97,
        noise: root * root.transpose() * 0.3,
        gradient: SVector::from_fn(|_, _| normal()),
        variance: 0.3,
    };
    let known: [f64; N] = scale.map(|scale| if scale == 0.0 { 0.7 } else { 0.0 });
    let mut readings: Vec<f64> = (0..20).map(|_| 2.0 * normal()).collect();
    for k in [1, 7, 8, 13] {
        readings[k] = f64::NAN;
    }
    let flat = DMatrix::from_diagonal(&DVector::from_row_slice(&scale));
    let flat = flat.select_columns(&(0..N).filter(|i| scale[*i] != 0.0).collect::<Vec<_>>());
    let start = DiffuseBelief::new(Belief::<f64, N, L>::independent(SVector::zeros(), &known), &scale);
    assert_eq!(start.unknown(), flat.ncols());
    let steps = run(model, start, &readings);
    let (mean, covariance, log_density, condition) =
        dense(&model, &SMatrix::from_diagonal(&SVector::from(known)), &flat, &readings);
    // The flat prior's part loses the condition number of the information on δ over 20 steps, and the dense oracle, 100
    // wide, another ten; what has no such part is good to the dense inverse's 1e-11.
    let tolerance = 1e-11 + condition * 20.0 * 10.0 * f64::EPSILON;
    for (k, belief) in smooth(&steps).unwrap().iter().enumerate() {
        for i in 0..N {
            assert_close(belief.mean[i], mean[N * k + i], tolerance, "mean");
            for j in 0..N {
                assert_close(belief.covariance[(i, j)], covariance[(N * k + i, N * k + j)], tolerance, "covariance");
            }
        }
    }
    assert_close(log_likelihoods(&steps).0, log_density, tolerance, "log-likelihood");
    // A recording of which the ordinary filter did the later part smooths the same.
    let settled = steps.iter().position(|step| step.posterior.unknown() == 0).unwrap();
    let mut mixed = steps[..=settled].to_vec();
    let mut belief = steps[settled].posterior.settled().unwrap();
    for y in &readings[settled + 1..] {
        let step = Ekf::new(model).step(&belief, 0.1, y.is_finite().then(|| Reading::from(*y))).unwrap();
        belief = step.posterior;
        mixed.push(step.into());
    }
    assert_eq!(smooth(&mixed), smooth(&steps));
}

#[test]
fn filter_and_smoother_equal_the_dense_gaussian_with_a_flat_prior() {
    check_against_dense::<1, 1>(1, [1.0]);
    check_against_dense::<2, 3>(2, [1.0; 2]);
    check_against_dense::<3, 6>(3, [1.0; 3]);
    check_against_dense::<3, 6>(4, [0.0, 2.0, 0.0]);
    check_against_dense::<4, 10>(5, [1.0, 0.0, 0.5, 3.0]);
    check_against_dense::<5, 15>(6, [1.0, 1.0, 0.0, 0.0, 1.0]);
}

proptest! {
    /// Units of the state that are powers of two scale every number without rounding: results are equal to the last bit,
    /// and so is the decision what is zero.
    #[test]
    fn units_do_not_matter(readings in prop::collection::vec(-5.0..5.0_f64, 6), exponents in prop::array::uniform3(-60..60_i32)) {
        let unit = SVector::from(exponents.map(|e| 2_f64.powi(e)));
        let plain = Linear {
            transition: matrix![1.0, 0.01, 0.00005; 0.0, 1.0, 0.01; 0.0, 0.0, 1.0],
            noise: SMatrix::<f64, 3, 3>::from_diagonal(&vector![1e-4, 2e-3, 0.03]),
            gradient: vector![1.0, 0.0, 0.0],
            variance: 0.2,
        };
        let to = SMatrix::from_diagonal(&unit);
        let from = SMatrix::from_diagonal(&unit.map(f64::recip));
        let scaled = Linear {
            transition: to * plain.transition * from,
            noise: to * plain.noise * to,
            gradient: from * plain.gradient,
            ..plain
        };
        let plain = run(plain, unknown::<f64, 3, 6>(&[1.0; 3]), &readings);
        let scaled = run(scaled, unknown::<f64, 3, 6>(&unit.into()), &readings);
        for (plain, scaled) in plain.iter().zip(&scaled) {
            prop_assert_eq!(plain.posterior.unknown(), scaled.posterior.unknown());
            prop_assert_eq!(plain.update.map(|u| u.log_likelihood()), scaled.update.map(|u| u.log_likelihood()));
            for i in 0..3 {
                prop_assert_eq!(plain.posterior.finite.mean[i], scaled.posterior.finite.mean[i] / unit[i]);
            }
        }
        // Three directions, three readings, although the third reading sees acceleration with a weight of 1e-4 only.
        prop_assert_eq!(plain[2].posterior.unknown(), 0);
        let (plain, scaled) = (smooth(&plain).unwrap(), smooth(&scaled).unwrap());
        for (plain, scaled) in plain.iter().zip(&scaled) {
            for i in 0..3 {
                prop_assert_eq!(plain.mean[i], scaled.mean[i] / unit[i]);
                prop_assert_eq!(plain.covariance[(i, i)], scaled.covariance[(i, i)] / unit[i] / unit[i]);
            }
        }
    }

    /// What a random rotation leaves of a direction that was fixed is rounding, and no reading may take it for more.
    #[test]
    fn a_fixed_direction_stays_fixed(angles in prop::array::uniform3(-3.0..3.0_f64), readings in prop::collection::vec(-5.0..5.0_f64, 3..40)) {
        let rotation = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
        // The state is seen through one and the same oblique direction, so that two stay unknown.
        let model = Linear {
            transition: SMatrix::<f64, 3, 3>::identity(),
            noise: SMatrix::zeros(),
            gradient: rotation * vector![1.0, 0.3, -2.0],
            variance: 1.0,
        };
        let steps = run(model, unknown::<f64, 3, 6>(&[1.0; 3]), &readings);
        let count = readings.len();
        prop_assert!(steps.iter().all(|step| step.posterior.unknown() == 2));
        prop_assert_eq!(smooth(&steps), Err(Undetermined { step: count - 1 }));
        // What is seen is the mean of all readings.
        let seen = model.gradient.dot(&steps[count - 1].posterior.finite.mean);
        prop_assert!((seen - readings.iter().sum::<f64>() / count as f64).abs() < 1e-12);
    }
}

/// A thousand steps without a reading do not turn rounding into a direction, in `f32` either.
#[test]
fn a_long_gap_keeps_the_count() {
    let model = Linear {
        transition: matrix![0.999_f32, 0.02; -0.02, 0.999],
        noise: SMatrix::<f32, 2, 2>::identity() * 1e-3,
        gradient: vector![1.0, 0.0],
        variance: 0.1,
    };
    let mut readings = vec![f64::NAN; 3000];
    for k in [0, 1200, 1201, 2999] {
        readings[k] = 1.0;
    }
    let left = run(model, unknown::<f32, 2, 3>(&[1.0; 2]), &readings);
    assert_eq!([0, 1199, 1200, 2999].map(|k| left[k].posterior.unknown()), [1, 1, 0, 0]);
}

/// Dynamics that forget a component make it known; what it was before remains undetermined.
#[test]
fn a_forgotten_direction_is_known() {
    let model = Linear {
        transition: matrix![1.0, 0.0; 0.0, 0.0],
        noise: SMatrix::<f64, 2, 2>::identity(),
        gradient: vector![1.0, 0.0],
        variance: 1.0,
    };
    let steps = run(model, unknown::<f64, 2, 3>(&[1.0; 2]), &[1.0, 2.0, 3.0]);
    assert_eq!(steps.iter().map(|step| step.posterior.unknown()).collect::<Vec<_>>(), [1, 0, 0]);
    assert_eq!(smooth(&steps), Err(Undetermined { step: 0 }));
}

/// A sensor whose rest resistance is not known: the limit of ever larger variances of its baseline.
#[test]
fn a_sensor_with_unknown_baseline() {
    let model = sensor::<f64, 2, 5>();
    let start = Belief::<f64, 5, 15>::initial(&model);
    let mut known = start;
    for j in 0..5 {
        known.covariance[(4, j)] = 0.0;
    }
    let readings = [0.4, 0.41, f64::NAN, 0.43, 0.46];
    let steps = run(model, DiffuseBelief::new(known, &[0.0, 0.0, 0.0, 0.0, 1.0]), &readings);
    let ekf = Ekf::new(model);
    let mut belief = known;
    belief.covariance[(4, 4)] = 1e6;
    for (k, (y, step)) in readings.iter().zip(&steps).enumerate() {
        let dt_s = if k == 0 { 0.0 } else { 0.1 };
        belief = ekf.step(&belief, dt_s, y.is_finite().then(|| Reading::from(*y))).unwrap().posterior;
        // All finite variances here are below 0.01: 1e-8 of 1e6, and as much is lost to rounding.
        let exact = step.posterior.settled().unwrap();
        assert!((exact.mean - belief.mean).amax() < 1e-7, "{} {}", exact.mean, belief.mean);
        assert!((exact.covariance.to_matrix() - belief.covariance.to_matrix()).amax() < 1e-7);
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let filter = DiffuseEkf::new(local_level(1.0, 1.0));
    let start = unknown::<f64, 1, 1>(&[1.0]);
    let refused = |dt_s: f64, y: f64| filter.step(&start, dt_s, Some(Reading::from(y))).unwrap_err();
    assert_eq!(refused(-0.1, 1.0), StepError::NegativeTimeStep);
    assert_eq!(refused(f64::NAN, 1.0), StepError::NonFiniteTimeStep);
    assert_eq!(refused(0.1, f64::INFINITY), StepError::NonFiniteReading);
    let filter = DiffuseEkf::new(local_level(-1.0, 1.0));
    let refused = filter.step(&start, 0.0, Some(Reading::from(1.0))).unwrap_err();
    assert_eq!(refused, StepError::NonPositiveInnovationVariance);
    let exact = DiffuseEkf::new(local_level(0.0, 1.0)).step(&start, 0.0, Some(Reading::from(3.0))).unwrap();
    assert_eq!(exact.posterior.settled(), Some(Belief { mean: vector![3.0], covariance: Symmetric::zeros() }));
}
