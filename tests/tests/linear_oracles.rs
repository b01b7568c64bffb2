//! On linear models every path must say the same: our filter and smoother, adskalman, and the joint Gaussian of all
//! states and readings written out densely.

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, LinearStep, Reading, Step, rts_smooth_vec};
use ohmstrain_model::{Observation, Phase, Symmetric, Transition};
use ohmstrain_tests::{Linear, sensor};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

struct Draws(ChaCha12Rng);

impl Draws {
    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    fn matrix<const N: usize>(&mut self) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|_, _| self.normal())
    }
}

/// A stable random model with a full Q that is not small.
fn random_model<const N: usize>(draws: &mut Draws) -> Linear<f64, N> {
    let raw = draws.matrix::<N>();
    let root = draws.matrix::<N>();
    Linear {
        transition: raw * (0.9 / raw.norm()),
        noise: root * root.transpose() + SMatrix::identity() * 0.1,
        gradient: SVector::from_fn(|_, _| draws.normal()),
        variance: 0.3,
    }
}

/// Readings with every fourth one missing.
fn random_readings(draws: &mut Draws, count: usize) -> Vec<Option<f64>> {
    (0..count).map(|k| (k % 4 != 2).then(|| 2.0 * draws.normal())).collect()
}

fn run<M, const N: usize, const L: usize>(
    ekf: &Ekf<M>,
    start: Belief<f64, N, L>,
    readings: &[Option<f64>],
) -> Vec<Step<f64, N, L>>
where
    M: Dynamics<f64, N, L> + Channel<f64, N, L>,
{
    let mut belief = start;
    readings
        .iter()
        .map(|reading| {
            let step = ekf.step(&belief, 0.1, reading.map(Reading::from)).unwrap();
            belief = step.posterior;
            step
        })
        .collect()
}

/// Means and covariances of x₁…x_T given all readings, and the log density of the readings, from one dense Gaussian:
/// x_k = F x_{k-1} + n with x_0 the start.
fn dense<const N: usize>(
    model: &Linear<f64, N>,
    mean: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    readings: &[Option<f64>],
) -> (DVector<f64>, DMatrix<f64>, f64) {
    let count = readings.len();
    let mut joint_mean = DVector::zeros(N * count);
    let mut joint = DMatrix::zeros(N * count, N * count);
    let (mut m, mut p) = (mean, covariance);
    for k in 0..count {
        m = model.transition * m;
        p = model.transition * p * model.transition.transpose() + model.noise;
        joint_mean.rows_mut(N * k, N).copy_from(&m);
        let mut cross = p;
        for later in k..count {
            joint.view_mut((N * k, N * later), (N, N)).copy_from(&cross);
            joint.view_mut((N * later, N * k), (N, N)).copy_from(&cross.transpose());
            cross *= model.transition.transpose();
        }
    }
    let seen: Vec<(usize, f64)> = readings.iter().enumerate().filter_map(|(k, y)| y.map(|y| (k, y))).collect();
    let h = DMatrix::from_fn(seen.len(), N * count, |row, column| {
        if column / N == seen[row].0 { model.gradient[column % N] } else { 0.0 }
    });
    let y = DVector::from_iterator(seen.len(), seen.iter().map(|(_, y)| *y));
    let s = &h * &joint * h.transpose() + DMatrix::identity(seen.len(), seen.len()) * model.variance;
    let inverse = s.clone().try_inverse().unwrap();
    let gain = &joint * h.transpose() * &inverse;
    let innovation = y - &h * &joint_mean;
    let log_density = -0.5
        * (innovation.dot(&(&inverse * &innovation))
            + s.determinant().ln()
            + seen.len() as f64 * std::f64::consts::TAU.ln());
    (joint_mean + &gain * innovation, &joint - gain * h * &joint, log_density)
}

fn check_against_dense<const N: usize, const L: usize>(seed: u64) {
    let mut draws = Draws(ChaCha12Rng::seed_from_u64(seed));
    let model = random_model::<N>(&mut draws);
    let root = draws.matrix::<N>();
    let start_covariance = root * root.transpose();
    let start_mean = SVector::from_fn(|_, _| draws.normal());
    let readings = random_readings(&mut draws, 23);
    let start = Belief { mean: start_mean, covariance: Symmetric::<f64, N, L>::from_lower(&start_covariance) };
    let steps = run(&Ekf::new(model), start, &readings);
    let smoothed = rts_smooth_vec(&steps);
    let (mean, covariance, log_density) = dense(&model, start_mean, start_covariance, &readings);
    // Condition numbers here are below 1e4; 1e4 · ε · 23 steps is about 5e-11.
    for (k, belief) in smoothed.iter().enumerate() {
        for i in 0..N {
            assert!((belief.mean[i] - mean[N * k + i]).abs() < 1e-10, "n = {N}: mean of step {k}");
            for j in 0..N {
                let expected = covariance[(N * k + i, N * k + j)];
                assert!((belief.covariance[(i, j)] - expected).abs() < 1e-10, "n = {N}: covariance of step {k}");
            }
        }
    }
    let sum: f64 = steps.iter().filter_map(|step| step.update).map(|update| update.log_likelihood).sum();
    assert!((sum - log_density).abs() < 1e-9 * log_density.abs(), "n = {N}: {sum} vs {log_density}");
}

#[test]
fn smoother_and_likelihood_equal_the_dense_joint_gaussian() {
    check_against_dense::<1, 1>(1);
    check_against_dense::<2, 3>(2);
    check_against_dense::<3, 6>(3);
    check_against_dense::<4, 10>(4);
    check_against_dense::<5, 15>(5);
    check_against_dense::<6, 21>(6);
}

/// An exactly known state that never changes makes every prior singular; the smoother must leave it alone.
#[test]
fn an_exactly_known_state_is_no_problem() {
    let model = Linear {
        transition: SMatrix::<f64, 2, 2>::new(0.9, 0.3, 0.0, 1.0),
        noise: SMatrix::<f64, 2, 2>::new(0.2, 0.0, 0.0, 0.0),
        gradient: SVector::from([1.0, 0.5]),
        variance: 0.1,
    };
    let start = Belief::<f64, 2, 3>::independent(SVector::from([0.0, 2.0]), &[1.0, 0.0]);
    let readings: Vec<Option<f64>> = (0..12).map(|k| (k % 3 != 1).then_some(f64::from(k))).collect();
    let smoothed = rts_smooth_vec(&run(&Ekf::new(model), start, &readings));
    // The same problem with the known state put into the readings and the motion by hand, which is regular.
    let (mut known, mut reduced) = (Vec::new(), 0.0);
    let mut covariance = 1.0;
    let mut steps = Vec::new();
    for reading in &readings {
        let (prior_mean, prior) = (0.9 * reduced + 0.6, 0.81 * covariance + 0.2);
        let gain = if reading.is_some() { prior / (prior + 0.1) } else { 0.0 };
        reduced = prior_mean + gain * reading.map_or(0.0, |y| y - 1.0 - prior_mean);
        covariance = prior * (1.0 - gain);
        steps.push((prior_mean, prior, reduced, covariance));
    }
    let (mut mean, mut variance) = (reduced, covariance);
    known.push((mean, variance));
    for k in (0..steps.len() - 1).rev() {
        let gain = steps[k].3 * 0.9 / steps[k + 1].1;
        mean = steps[k].2 + gain * (mean - steps[k + 1].0);
        variance = steps[k].3 + gain * gain * (variance - steps[k + 1].1);
        known.push((mean, variance));
    }
    for (belief, (mean, variance)) in smoothed.iter().zip(known.iter().rev()) {
        assert!((belief.mean[0] - mean).abs() < 1e-12);
        assert!((belief.covariance[(0, 0)] - variance).abs() < 1e-12);
        assert_eq!(belief.mean[1], 2.0);
        assert_eq!(belief.covariance[(1, 1)], 0.0);
    }
}

#[test]
fn an_empty_recording_smooths_to_nothing() {
    assert!(rts_smooth_vec::<f64, 2, 3>(&[]).is_empty());
}

type Linearised = (Transition<f64, 5, 15>, Observation<f64, 5>);

/// One linearised step of the sensor's own law.
fn linearised() -> (Belief<f64, 5, 15>, Linearised) {
    let model = sensor::<f64, 2, 5>();
    let start = Belief::<f64, 5, 15>::initial(&model);
    let prepared = Dynamics::<f64, 5, 15>::prepare(&model, 0.05);
    let transition = Dynamics::transition(&model, &prepared, &start, Some(Phase::Extend));
    let prior = Belief { mean: transition.mean, covariance: start.covariance };
    (start, (transition, Channel::observe(&model, &prior, Some(Phase::Extend))))
}

/// The linearised law as a linear model of ours, around the same points.
struct Frozen {
    from: SVector<f64, 5>,
    step: Linearised,
}

impl Dynamics<f64, 5, 15> for Frozen {
    type Prepared = ();

    fn prepare(&self, _: f64) {}

    fn transition(&self, (): &(), at: &Belief<f64, 5, 15>, _: Option<Phase>) -> Transition<f64, 5, 15> {
        let (transition, _) = self.step;
        Transition { mean: transition.mean + transition.jacobian * (at.mean - self.from), ..transition }
    }
}

impl Channel<f64, 5, 15> for Frozen {
    fn observe(&self, at: &Belief<f64, 5, 15>, _: Option<Phase>) -> Observation<f64, 5> {
        let (transition, observation) = self.step;
        let value = observation.value + observation.gradient.dot(&(at.mean - transition.mean));
        Observation { value, ..observation }
    }
}

#[test]
fn filter_and_smoother_agree_with_adskalman() {
    let (start, step) = linearised();
    let bridge = LinearStep::new(start.mean, &step.0, step.0.mean, &[step.1]);
    let mut draws = Draws(ChaCha12Rng::seed_from_u64(9));
    let readings: Vec<Option<f64>> =
        (0..40).map(|k| (k % 5 != 3).then(|| step.1.value + 0.05 * draws.normal())).collect();
    let observations: Vec<SVector<f64, 1>> = readings.iter().map(|y| SVector::from([y.unwrap_or(f64::NAN)])).collect();
    let filter = KalmanFilterNoControl::new(&bridge, &bridge);
    let theirs =
        filter.filter(&StateAndCovariance::new(start.mean, start.covariance.to_matrix()), &observations).unwrap();
    let steps = run(&Ekf::new(Frozen { from: start.mean, step }), start, &readings);
    for (ours, theirs) in steps.iter().zip(&theirs) {
        assert_same(&ours.posterior, theirs);
    }
    // adskalman's smoother knows linear transitions without offset only: smooth deviations from a path that follows
    // the offset.
    let mut path = start.mean;
    let mut deviations = Vec::new();
    let mut paths = Vec::new();
    for theirs in &theirs {
        path = step.0.mean + step.0.jacobian * (path - start.mean);
        deviations.push(StateAndCovariance::new(theirs.state() - path, *theirs.covariance()));
        paths.push(path);
    }
    let smoothed = filter_without_offset(&step, &deviations);
    for ((ours, theirs), path) in rts_smooth_vec(&steps).iter().zip(&smoothed).zip(&paths) {
        assert_same(ours, &StateAndCovariance::new(theirs.state() + path, *theirs.covariance()));
    }
}

/// adskalman's smoother on the homogeneous part of the step.
fn filter_without_offset(
    step: &Linearised,
    filtered: &[StateAndCovariance<f64, nalgebra::Const<5>>],
) -> Vec<StateAndCovariance<f64, nalgebra::Const<5>>> {
    let homogeneous = Transition { mean: SVector::zeros(), ..step.0 };
    let bridge = LinearStep::new(SVector::zeros(), &homogeneous, SVector::zeros(), &[step.1]);
    KalmanFilterNoControl::new(&bridge, &bridge).smooth_from_filtered(filtered.to_vec()).unwrap()
}

fn assert_same(ours: &Belief<f64, 5, 15>, theirs: &StateAndCovariance<f64, nalgebra::Const<5>>) {
    for i in 0..5 {
        assert!((ours.mean[i] - theirs.state()[i]).abs() < 1e-10);
        for j in 0..5 {
            assert!((ours.covariance[(i, j)] - theirs.covariance()[(i, j)]).abs() < 1e-10);
        }
    }
}
