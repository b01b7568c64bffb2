//! Comparison with results of other programs; see `made_by` in the fixtures.

use nalgebra::{SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::kalman::{self, Filter, Normal, Ukf, smooth};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, Reading, Step};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, Observation, Phase, SensorLaw, StrainRange, SwitchedModel, Symmetric,
    Transition,
};
use ohmstrain_tests::rts_smooth;
use serde_json::Value;

const DIRECTION: Direction<f64> = Direction::Known(Phase::Extend);

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap_or(f64::NAN)).collect()
}

/// The oracle's state is (strain, rate, q) with `q̇ = (ε - q)/τ`, `y = g ε + g₂ ε² + h q`. Ours is (strain, rate, c)
/// with `c = -h (ε - q)`: gain k = -h, gauge slope g + h, branch noise h² times q's.
fn viscoelastic(oracle: &Value, curvature: f64) -> (SwitchedModel<f64, 1, 3>, SMatrix<f64, 3, 3>) {
    let p = |name: &str| oracle["params"][name].as_f64().unwrap();
    let (h, tau_s) = (p("h"), p("tau"));
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [p("g") + h, curvature, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [Branch {
            tau_s,
            extend_gain: -h,
            retract_gain: -h,
            extend_gain_slope: 0.0,
            retract_gain_slope: 0.0,
        }],
        range: StrainRange { lower: -1e6, upper: 1e6 },
    };
    let noise = ModelNoise {
        reading_sd: p("R").sqrt(),
        branch_sd: (h * h * p("sq") * tau_s / 2.0).sqrt(),
        baseline_sd: 0.0,
        baseline_time_s: 1.0,
    };
    // A random walk of the rate: q = 2 σ²/T, with T so long that the rate has no pull to zero.
    let rate_time_s = 1e14_f64;
    let rate_sd = (0.5 * p("sa") * rate_time_s).sqrt();
    let motion = Motion::ornstein_uhlenbeck(rate_time_s, rate_sd, 0.0, f64::INFINITY).unwrap();
    let to_ours = matrix![1.0, 0.0, 0.0; 0.0, 1.0, 0.0; -h, 0.0, h];
    (SwitchedModel::new(law, motion, noise).unwrap(), to_ours)
}

/// Filters the record; the first reading is an update without a prediction. Returns steps and log-likelihood.
fn filter<M: Dynamics<f64, 3, 6> + Channel<f64, 3, 6>>(
    linear: &Value,
    record: &Value,
    ekf: &Ekf<M>,
    to_ours: SMatrix<f64, 3, 3>,
) -> (Vec<Step<f64, 3, 6>>, f64) {
    let start = SVector::<f64, 3>::from_column_slice(&numbers(&linear["m0"]));
    let spread: [f64; 3] = numbers(&linear["P0diag"]).try_into().unwrap();
    let mut belief = Belief {
        mean: to_ours * start,
        covariance: Symmetric::<f64, 3, 6>::from_diagonal(&spread).congruence(&to_ours),
    };
    let (times, readings) = (numbers(&record["t"]), numbers(&record["y"]));
    let (mut steps, mut log_likelihood, mut before) = (Vec::new(), 0.0, times[0]);
    for (t, y) in times.iter().zip(readings) {
        let step = ekf.step(&belief, t - before, y.is_finite().then(|| Reading::from(y))).unwrap();
        log_likelihood += step.update.map_or(0.0, |update| update.log_likelihood);
        (belief, before) = (step.posterior, *t);
        steps.push(step);
    }
    (steps, log_likelihood)
}

fn assert_state(got: &Belief<f64, 3, 6>, to_ours: &SMatrix<f64, 3, 3>, mean: &Value, covariance: Option<&Value>) {
    let back = to_ours.try_inverse().unwrap();
    let (state, expected) = (back * got.mean, numbers(mean));
    for i in 0..3 {
        assert!((state[i] - expected[i]).abs() < 1e-10, "state[{i}] {} vs {}", state[i], expected[i]);
    }
    let Some(covariance) = covariance else { return };
    let ours = got.covariance.congruence(&back);
    for (i, row) in covariance.as_array().unwrap().iter().enumerate() {
        for (j, expected) in numbers(row).into_iter().enumerate() {
            assert!((ours[(i, j)] - expected).abs() < 1e-11, "P[{i}][{j}] {} vs {expected}", ours[(i, j)]);
        }
    }
}

#[test]
fn linear_sensor_with_irregular_steps_and_missing_samples() {
    let oracle = json(include_str!("../fixtures/kv_linear.json"));
    let (model, to_ours) = viscoelastic(&oracle, 0.0);
    let (steps, log_likelihood) = filter(&oracle, &oracle, &Ekf::new(model), to_ours);
    assert!((log_likelihood - oracle["loglik"].as_f64().unwrap()).abs() < 1e-9, "{log_likelihood}");
    assert_state(&steps[59].posterior, &to_ours, &oracle["filtered_last"], Some(&oracle["filtered_cov_last"]));
    assert_state(&steps[10].posterior, &to_ours, &oracle["filtered_10"], None);
    let smoothed = rts_smooth(&steps);
    assert_state(&smoothed[0], &to_ours, &oracle["smoothed_0"], Some(&oracle["smoothed_cov_0"]));
    assert_state(&smoothed[8], &to_ours, &oracle["smoothed_8_missing"], Some(&oracle["smoothed_cov_8"]));
}

#[test]
fn transition_and_noise_of_the_linear_sensor() {
    let oracle = json(include_str!("../fixtures/kv_linear.json"));
    let (model, to_ours) = viscoelastic(&oracle, 0.0);
    let back = to_ours.try_inverse().unwrap();
    let transition = model.transition::<6>(&model.prepare(0.02), &vector![0.1, 0.2, 0.0], DIRECTION);
    let f = back * transition.jacobian * to_ours;
    let q = transition.noise.congruence(&back);
    for i in 0..3 {
        let (f_row, q_row) = (numbers(&oracle["F_dt0p02"][i]), numbers(&oracle["Q_dt0p02"][i]));
        for j in 0..3 {
            assert!((f[(i, j)] - f_row[j]).abs() < 1e-15, "F[{i}][{j}]");
            // Cross terms of the branch noise are exact here and first-order there; they agree to rounding.
            assert!((q[(i, j)] - q_row[j]).abs() < 1e-15, "Q[{i}][{j}] {} vs {}", q[(i, j)], q_row[j]);
        }
    }
}

#[test]
fn quadratic_gauge_with_the_extended_filter() {
    let linear = json(include_str!("../fixtures/kv_linear.json"));
    let oracle = json(include_str!("../fixtures/kv_nonlinear.json"));
    let (model, to_ours) = viscoelastic(&linear, oracle["g2"].as_f64().unwrap());
    let (steps, log_likelihood) = filter(&linear, &oracle, &Ekf::new(model), to_ours);
    assert!((log_likelihood - oracle["ekf"]["loglik"].as_f64().unwrap()).abs() < 1e-9, "{log_likelihood}");
    assert_state(&steps[59].posterior, &to_ours, &oracle["ekf"]["last"], Some(&oracle["ekf"]["cov_last"]));
}

#[test]
fn quadratic_gauge_with_the_unscented_filter() {
    let linear = json(include_str!("../fixtures/kv_linear.json"));
    let oracle = json(include_str!("../fixtures/kv_nonlinear.json"));
    let (model, to_ours) = viscoelastic(&linear, oracle["g2"].as_f64().unwrap());
    let (last, log_likelihood) = filter_unscented(&linear, &oracle, &model, to_ours);
    let expected = &oracle["ukf_a1_b2_k0_redraw"];
    assert!((log_likelihood - expected["loglik"].as_f64().unwrap()).abs() < 1e-9, "{log_likelihood}");
    let last = Belief { mean: last.mean, covariance: Symmetric::from_lower(&last.covariance()) };
    assert_state(&last, &to_ours, &expected["last"], Some(&expected["cov_last"]));
}

/// Runs `kalman::Ukf` as `filter` runs the filter.
fn filter_unscented(
    linear: &Value,
    record: &Value,
    model: &SwitchedModel<f64, 1, 3>,
    to_ours: SMatrix<f64, 3, 3>,
) -> (Normal<f64, 3>, f64) {
    let start = SVector::<f64, 3>::from_column_slice(&numbers(&linear["m0"]));
    let spread = SMatrix::from_diagonal(&SVector::from_column_slice(&numbers(&linear["P0diag"])));
    let mut state = Normal::new(to_ours * start, &(to_ours * spread * to_ours.transpose())).unwrap();
    let (times, readings) = (numbers(&record["t"]), numbers(&record["y"]));
    let (mut log_likelihood, mut before) = (0.0, times[0]);
    for (t, y) in times.iter().zip(readings) {
        let prepared = model.prepare(t - before);
        let moved = |x: &SVector<f64, 3>| model.transition::<6>(&prepared, x, DIRECTION);
        let seen = |x: &SVector<f64, 3>| model.observe(x, DIRECTION);
        let functions = (|x: &SVector<f64, 3>| moved(x).mean, |x: &SVector<f64, 3>| vector![seen(x).value]);
        let (q, r) = (moved(&state.mean).noise.to_matrix(), matrix![seen(&state.mean).variance]);
        let (ukf, reading) = (Ukf::new(functions, q, r), [y.is_finite().then_some(y)]);
        let step = if *t > before { ukf.step(&state, &reading) } else { ukf.update(&state, &reading) }.unwrap();
        log_likelihood += step.log_likelihood;
        (state, before) = (step.posterior, *t);
    }
    (state, log_likelihood)
}

/// Särkkä's toolbox: unscented filter and smoother on a linear model, the first sample missing.
#[test]
fn sarkkas_unscented_filter_and_smoother() {
    let oracle = json(include_str!("../fixtures/sarkka_ukf_urts.json"));
    let transition = |x: &SVector<f64, 2>| matrix![1.0, 1.0; 0.0, 1.0] * x;
    let reading = |x: &SVector<f64, 2>| matrix![0.5, -0.3] * x;
    let ukf = Ukf::new((transition, reading), matrix![2.0, 0.0; 0.0, 2.0], matrix![0.5]);
    let mut state = Normal::new(vector![1.0, 1.0], &matrix![1.0, 0.1; 0.1, 1.0]).unwrap();
    let mut steps: Vec<kalman::Step<f64, 2, 1>> = Vec::new();
    // Their first sample is missing, without a prediction before it, so it is the start.
    for z in [1.0, 2.0, 3.0] {
        let step = ukf.step(&state, &[Some(z)]).unwrap();
        state = step.posterior;
        steps.push(step);
    }
    let check = |got: &Normal<f64, 2>, mean: &Value, covariance: &Value| {
        for i in 0..2 {
            // The toolbox's own rounding through sigma points is 4e-11 relative in the smoother.
            let (expected, row) = (numbers(mean)[i], numbers(&covariance[i]));
            assert!((got.mean[i] - expected).abs() < 1e-10 * expected.abs(), "{} vs {expected}", got.mean[i]);
            for j in 0..2 {
                assert!((got.covariance()[(i, j)] - row[j]).abs() < 1e-10 * row[j].abs());
            }
        }
    };
    let mut smoothed = vec![state; 3];
    smooth(&steps, &mut smoothed).unwrap();
    for (k, (step, smoothed)) in steps.iter().zip(&smoothed).enumerate() {
        check(&step.posterior, &oracle["filt_mu"][k], &oracle["filt_P"][k]);
        check(smoothed, &oracle["smooth_mu"][k], &oracle["smooth_P"][k]);
    }
}

/// rednose's kinematic example: position and velocity, Q = dt · diag(0.01, 4), the position measured.
struct Kinematic;

impl Dynamics<f64, 2, 3> for Kinematic {
    type Prepared = f64;

    fn prepare(&self, dt_s: f64) -> f64 {
        dt_s
    }

    fn transition(&self, dt_s: &f64, from: &Belief<f64, 2, 3>, _: Option<Phase>) -> Transition<f64, 2, 3> {
        let jacobian = matrix![1.0, *dt_s; 0.0, 1.0];
        Transition { mean: jacobian * from.mean, jacobian, noise: Symmetric::from_diagonal(&[dt_s * 0.01, dt_s * 4.0]) }
    }
}

impl Channel<f64, 2, 3> for Kinematic {
    fn observe(&self, at: &Belief<f64, 2, 3>, _: Option<Phase>) -> Observation<f64, 2> {
        Observation { value: at.mean[0], gradient: vector![1.0, 0.0], variance: 0.01 }
    }
}

#[test]
fn five_hundred_kinematic_steps() {
    let ekf = Ekf::new(Kinematic);
    let mut belief: Belief<f64, 2, 3> = Belief::independent(vector![0.5, 0.0], &[1.0, 1.0]);
    let mut before = 0.0;
    for row in include_str!("../fixtures/kinematic.csv").lines().skip(2) {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        belief = ekf.step(&belief, cells[0] - before, Some(Reading::from(cells[1]))).unwrap().posterior;
        before = cells[0];
    }
    let expected = [-0.010866289677966417, 0.04477103863330089, -0.8553720537261753, 0.6695762270974388];
    let got = [belief.mean[0], belief.covariance[(0, 0)].sqrt(), belief.mean[1], belief.covariance[(1, 1)].sqrt()];
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() <= 1e-14 * expected.abs(), "{got} vs {expected}");
    }
}
