//! Oracles on linear models, with irregular steps and missing readings: filter and smoother must agree at every row with two
//! other formulations: the dense joint Gaussian of all states and readings, and the modified Bryson-Frazier smoother, which
//! inverts no covariance. Exactly known states make the smoother's priors singular.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, Reading, Step};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel, Symmetric};
use ohmstrain_tests::{Draws, Flow, KnownPhase, Linear, rts_smooth};

/// A row in the form used by the oracles: `x' = F x + push + n`, `y = H x + offset + w`.
struct Row<const N: usize> {
    transition: SMatrix<f64, N, N>,
    push: SVector<f64, N>,
    noise: SMatrix<f64, N, N>,
    gradient: SVector<f64, N>,
    offset: f64,
    variance: f64,
    reading: Option<f64>,
}

impl<const N: usize> Row<N> {
    /// Extracts the row of a linear model over `dt_s` by evaluating it at the origin.
    fn of<const L: usize>(
        model: &(impl Dynamics<f64, N, L> + Channel<f64, N, L>),
        dt_s: f64,
        reading: Option<f64>,
    ) -> Self {
        let origin: Belief<f64, N, L> = Belief::independent(SVector::zeros(), &[0.0; N]);
        let moved = model.transition(&model.prepare(dt_s), &origin, None);
        let seen = model.observe(&origin, None);
        let stands = dt_s == 0.0;
        Self {
            transition: if stands { SMatrix::identity() } else { moved.jacobian },
            push: if stands { SVector::zeros() } else { moved.mean },
            noise: if stands { SMatrix::zeros() } else { moved.noise.to_matrix() },
            gradient: seen.gradient,
            offset: seen.value,
            variance: seen.variance,
            reading,
        }
    }
}

/// Smoothed means and covariances at all rows.
type Smoothed<const N: usize> = Vec<(SVector<f64, N>, SMatrix<f64, N, N>)>;

/// Conditions one Gaussian of all states. Returns the smoothed rows, the standard deviations before any reading, and
/// the log density of the readings.
fn dense<const N: usize>(
    start: (SVector<f64, N>, SMatrix<f64, N, N>),
    rows: &[Row<N>],
) -> (Smoothed<N>, Vec<SVector<f64, N>>, f64) {
    let count = rows.len();
    let (mut joint_mean, mut joint) = (DVector::zeros(N * count), DMatrix::zeros(N * count, N * count));
    let (mut m, mut p) = start;
    for (k, row) in rows.iter().enumerate() {
        m = row.transition * m + row.push;
        p = row.transition * p * row.transition.transpose() + row.noise;
        joint_mean.rows_mut(N * k, N).copy_from(&m);
        let mut cross = p;
        for later in k..count {
            if later > k {
                cross *= rows[later].transition.transpose();
            }
            joint.view_mut((N * k, N * later), (N, N)).copy_from(&cross);
            joint.view_mut((N * later, N * k), (N, N)).copy_from(&cross.transpose());
        }
    }
    let seen: Vec<(usize, f64)> =
        rows.iter().enumerate().filter_map(|(k, row)| row.reading.map(|y| (k, y - row.offset))).collect();
    let h = DMatrix::from_fn(seen.len(), N * count, |i, column| {
        if column / N == seen[i].0 { rows[column / N].gradient[column % N] } else { 0.0 }
    });
    let variances = DVector::from_iterator(seen.len(), seen.iter().map(|(k, _)| rows[*k].variance));
    let s = &h * &joint * h.transpose() + DMatrix::from_diagonal(&variances);
    let inverse = s.clone().try_inverse().unwrap();
    let gain = &joint * h.transpose() * &inverse;
    let innovation = DVector::from_iterator(seen.len(), seen.iter().map(|(_, y)| *y)) - &h * &joint_mean;
    let log_density = -0.5
        * (innovation.dot(&(&inverse * &innovation))
            + s.symmetric_eigenvalues().map(f64::ln).sum()
            + seen.len() as f64 * std::f64::consts::TAU.ln());
    let (mean, covariance) = (joint_mean + &gain * innovation, &joint - gain * h * &joint);
    let smoothed = (0..count).map(|k| {
        let block = covariance.view((N * k, N * k), (N, N));
        (SVector::from_fn(|i, _| mean[N * k + i]), SMatrix::from_fn(|i, j| block[(i, j)]))
    });
    let sd = (0..count).map(|k| SVector::from_fn(|i, _| joint[(N * k + i, N * k + i)].max(0.0).sqrt()));
    (smoothed.collect(), sd.collect(), log_density)
}

/// Runs the modified Bryson-Frazier smoother: a Kalman filter forwards, and an adjoint λ with its matrix Λ backwards.
///
/// Source: Bierman, *Int. J. Control* 18 (1973) 1227.
#[allow(non_snake_case, reason = "the letters of the source")]
fn bryson_frazier<const N: usize>(start: (SVector<f64, N>, SMatrix<f64, N, N>), rows: &[Row<N>]) -> Smoothed<N> {
    let (mut x, mut P) = start;
    let mut filtered = Vec::new();
    for row in rows {
        x = row.transition * x + row.push;
        P = row.transition * P * row.transition.transpose() + row.noise;
        let H = row.gradient.transpose();
        let S = (H * P * row.gradient)[0] + row.variance;
        let K = P * row.gradient / S;
        let innovation = row.reading.map(|y| y - row.offset - (H * x)[0]);
        if let Some(innovation) = innovation {
            x += K * innovation;
            P -= K * S * K.transpose();
        }
        filtered.push((x, P, innovation.map(|innovation| (innovation, S, SMatrix::identity() - K * H))));
    }
    let (mut lambda, mut Lambda) = (SVector::<f64, N>::zeros(), SMatrix::<f64, N, N>::zeros());
    let mut smoothed = Vec::new();
    for (row, (x, P, update)) in rows.iter().zip(&filtered).rev() {
        smoothed.push((x - P * lambda, P - P * Lambda * P));
        if let Some((innovation, S, C)) = update {
            lambda = C.transpose() * lambda - row.gradient * (innovation / S);
            Lambda = C.transpose() * Lambda * C + row.gradient * row.gradient.transpose() / *S;
        }
        lambda = row.transition.transpose() * lambda;
        Lambda = row.transition.transpose() * Lambda * row.transition;
    }
    smoothed.reverse();
    smoothed
}

/// Steps in seconds: short, long, and zero.
const STEPS_S: [f64; 9] = [0.05, 0.3, 0.0, 1.7, 0.001, 0.12, 0.7, 4.0, 0.02];
const ROWS: usize = 31;
/// The covariance of the readings has condition numbers below 1e4 here, and 31 rows of rounded products leave
/// 1e4 · 31 · ε = 7e-11 of a standard deviation.
const ROUNDING: f64 = 1e-10;

/// Runs filter, smoother and both oracles; `model_at` is the model of a row.
///
/// Everything is compared in units of the standard deviations before any reading.
fn check<M, const N: usize, const L: usize>(
    what: &str,
    tolerance: f64,
    draws: &mut Draws,
    start: Belief<f64, N, L>,
    model_at: impl Fn(usize) -> M,
) where
    M: Dynamics<f64, N, L> + Channel<f64, N, L>,
{
    let (mut belief, mut steps, mut rows) = (start, Vec::<Step<f64, N, L>>::new(), Vec::new());
    for k in 0..ROWS {
        let (model, dt_s) = (model_at(k), STEPS_S[k % STEPS_S.len()]);
        let size = model.observe(&belief, None);
        let reading = (k % 4 != 2).then(|| size.value + 2.0 * size.variance.sqrt() * draws.normal());
        rows.push(Row::of(&model, dt_s, reading));
        let step = Ekf::new(model).step(&belief, dt_s, reading.map(Reading::from)).unwrap();
        belief = step.posterior;
        steps.push(step);
    }
    let start = (start.mean, start.covariance.to_matrix());
    let (expected, sd, log_density) = dense(start, &rows);
    let bryson_frazier = bryson_frazier(start, &rows);
    for (k, ours) in rts_smooth(&steps).iter().enumerate() {
        for (name, (mean, covariance)) in [("dense", &expected[k]), ("Bryson-Frazier", &bryson_frazier[k])] {
            for i in 0..N {
                let off = (ours.mean[i] - mean[i]).abs();
                assert!(off <= tolerance * sd[k][i], "{what}, {name}: mean {i} of row {k} off by {off:e}");
                for j in 0..N {
                    let off = (ours.covariance[(i, j)] - covariance[(i, j)]).abs();
                    assert!(
                        off <= tolerance * sd[k][i] * sd[k][j],
                        "{what}, {name}: P[{i}][{j}] of row {k} off by {off:e}"
                    );
                }
            }
        }
    }
    let sum: f64 = steps.iter().filter_map(|step| step.update).map(|update| update.log_likelihood).sum();
    assert!((sum - log_density).abs() < 1e-9 * (1.0 + log_density.abs()), "{what}: {sum} vs {log_density}");
}

fn check_flow<const N: usize, const L: usize>(seed: u64) {
    let mut draws = Draws::new(seed);
    let flow = Flow::<N>::random(&mut draws);
    let (mean, covariance) = (draws.vector(), Symmetric::<f64, N, L>::from_lower(&draws.covariance()));
    check(&format!("n = {N}"), ROUNDING, &mut draws, Belief { mean, covariance }, |_| flow);
    let known = Belief::<f64, N, L>::independent(mean, &[0.0; N]);
    check(&format!("n = {N} from a known state"), ROUNDING, &mut draws, known, |_| flow);
}

#[test]
fn random_models_equal_both_oracles_at_every_row() {
    check_flow::<1, 1>(1);
    check_flow::<2, 3>(2);
    check_flow::<3, 6>(3);
    check_flow::<4, 10>(4);
    check_flow::<5, 15>(5);
    check_flow::<6, 21>(6);
}

/// Returns a linear sensor whose branches wander by `branch_sd` around their law, and whose baseline, if it has one, is
/// always zero.
fn linear_sensor<const B: usize, const N: usize>(motion: Motion<f64>, branch_sd: f64) -> SwitchedModel<f64, B, N> {
    let branch = |i: usize| Branch {
        tau_s: 4.0 * 8_f64.powi(i as i32),
        extend_gain: 0.8,
        retract_gain: -0.5,
        extend_gain_slope: 0.0,
        retract_gain_slope: 0.0,
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.6, 0.0, 0.0] },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        branches: std::array::from_fn(branch),
        range: StrainRange { lower: -1.0, upper: 1.0 },
    };
    let noise = ModelNoise { reading_sd: 0.02, branch_sd, baseline_sd: 0.0, baseline_time_s: 30.0 };
    SwitchedModel::new(law, motion, noise).unwrap()
}

/// Checks a body that stretches, rests, releases and rests again; in a rest the rate is exactly zero.
fn check_sensor<const B: usize, const N: usize, const L: usize>(
    what: &str,
    tolerance: f64,
    model: SwitchedModel<f64, B, N>,
) {
    let phases = [Phase::Extend, Phase::Hold, Phase::Retract, Phase::Hold];
    let mut draws = Draws::new(7);
    let known = SVector::from_fn(|i, _| if i == 0 { 0.1 } else { 0.0 });
    let starts = [("a", Belief::<f64, N, L>::initial(&model)), ("a known", Belief::independent(known, &[0.0; N]))];
    for (from, start) in starts {
        let model_at = |k: usize| KnownPhase { model, phase: phases[k / 4 % 4] };
        check(&format!("{what} from {from} state"), tolerance, &mut draws, start, model_at);
    }
}

fn rough() -> Motion<f64> {
    Motion::ornstein_uhlenbeck(1.5, 0.05, 0.15, 0.1).unwrap()
}

/// Rests, and a baseline of exactly zero, make priors singular.
#[test]
fn the_sensor_equals_both_oracles_at_every_row() {
    check_sensor::<0, 2, 3>("no branch", ROUNDING, linear_sensor(rough(), 0.0));
    check_sensor::<1, 4, 10>("one branch", ROUNDING, linear_sensor(rough(), 0.01));
    check_sensor::<2, 5, 15>("two branches", ROUNDING, linear_sensor(rough(), 0.01));
}

/// All states are driven by one noise. After a short step from a known state they are almost completely correlated, and
/// the smoother's gain, which the Bryson-Frazier smoother does not need, has the worst possible condition. The stated
/// error is then N² ε^⅓.
#[test]
fn branches_without_noise_of_their_own_stay_within_the_promise() {
    let promise = |n: f64| n * n * f64::EPSILON.cbrt();
    check_sensor::<1, 4, 10>("one branch", promise(4.0), linear_sensor(rough(), 0.0));
    check_sensor::<2, 5, 15>("two branches", promise(5.0), linear_sensor(rough(), 0.0));
}

/// An exactly known, constant state that drives another one.
#[test]
fn a_constant_stays_what_it_is() {
    let model = Linear {
        transition: SMatrix::<f64, 2, 2>::new(0.9, 0.3, 0.0, 1.0),
        noise: SMatrix::<f64, 2, 2>::new(0.2, 0.0, 0.0, 0.0),
        gradient: SVector::from([1.0, 0.5]),
        variance: 0.1,
    };
    let start = Belief::<f64, 2, 3>::independent(SVector::from([0.0, 2.0]), &[1.0, 0.0]);
    check("a constant", ROUNDING, &mut Draws::new(3), start, |_| model);
}
