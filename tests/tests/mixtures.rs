//! Filters of phase hypotheses: where phases make no difference they are the Kalman filter; the chain between phases is
//! a Markov chain in continuous time; limits count once; and on data simulated from their own model their phase
//! probabilities mean what they say.

use nalgebra::{Matrix3, SMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Dwell, Dynamics, Ekf, Evidence, Hypotheses, Imm, Mixture, Phased, Reading, SignSplit, Ukf, Unscented,
};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel, Symmetric, Transition,
};
use ohmstrain_tests::Linear;
use proptest::prelude::*;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

const ANYWHERE: Evidence<f64> = within(f64::NEG_INFINITY, f64::INFINITY);

const fn within(lower: f64, upper: f64) -> Evidence<f64> {
    Evidence { limits: StrainRange { lower, upper }, tempering: 1.0 }
}

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn uniform(rng: &mut ChaCha12Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

fn random_model<const N: usize>(rng: &mut ChaCha12Rng) -> Linear<f64, N> {
    let raw = SMatrix::<f64, N, N>::from_fn(|_, _| normal(rng));
    let root = SMatrix::<f64, N, N>::from_fn(|_, _| normal(rng));
    Linear {
        transition: raw * (0.9 / raw.norm()),
        noise: root * root.transpose() + SMatrix::identity() * 0.1,
        gradient: SVector::from_fn(|_, _| normal(rng)),
        variance: 0.3,
    }
}

/// A model of one phase: hypotheses about phases are about nothing, so every filter must be the Kalman filter.
fn check_one_phase<const N: usize, const L: usize>(seed: u64) {
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let model = random_model::<N>(&mut rng);
    let dwell = Dwell::new(1.0, 2.0, 0.3).unwrap();
    let (ekf, imm) = (Ekf::new(model), Imm::new(model, dwell, ANYWHERE));
    let (iterated, ukf) = (ekf.iterated(3), Ukf::new(Unscented::new(model)));
    let histories = Hypotheses::new(model, dwell, ANYWHERE);
    let mut belief: Belief<f64, N, L> = Belief::independent(SVector::from_fn(|_, _| normal(&mut rng)), &[1.0; N]);
    let mut modes = Mixture::<f64, N, L, 3>::single(belief, Phase::Hold);
    let mut single = Mixture::<f64, N, L, 1>::single(belief, Phase::Hold);
    for k in 0..25 {
        let reading = (k % 4 != 2).then(|| Reading::from(2.0 * normal(&mut rng)));
        let step = ekf.step(&belief, 0.1, reading).unwrap();
        let iterated = iterated.step(&belief, 0.1, reading).unwrap().posterior;
        let unscented = ukf.step(&belief, 0.1, reading).unwrap().posterior;
        belief = step.posterior;
        let imm_step = imm.step_prepared(&modes, &(), 0.1, reading).unwrap();
        modes = imm_step.posterior;
        single = histories.step_prepared(&single, &(), 0.1, reading).unwrap().posterior;
        for other in [iterated, unscented, modes.moments(), single.moments()] {
            assert!((other.mean - belief.mean).amax() < 1e-11, "n = {N}, step {k}");
            assert!((other.covariance.to_matrix() - belief.covariance.to_matrix()).amax() < 1e-11, "n = {N}, step {k}");
        }
        let update = step.update;
        let log_likelihood = update.map_or(0.0, |update| update.log_likelihood);
        assert!((imm_step.log_likelihood - log_likelihood).abs() < 1e-11);
        assert_eq!(imm_step.nis.is_some(), update.is_some());
        if let (Some(nis), Some(update)) = (imm_step.nis, update) {
            assert!((nis - update.nis).abs() < 1e-10 * (1.0 + update.nis));
        }
    }
}

#[test]
fn on_a_model_of_one_phase_they_are_the_kalman_filter() {
    check_one_phase::<2, 3>(2);
    check_one_phase::<3, 6>(3);
    check_one_phase::<4, 10>(4);
    check_one_phase::<5, 15>(5);
    check_one_phase::<6, 21>(6);
}

proptest! {
    /// exp(generator · dt) by nalgebra's Padé approximant, and one step equals two.
    #[test]
    fn phases_follow_a_markov_chain(
        hold in 0.1..100.0_f64, moving in 0.1..100.0_f64, reversal in 0.0..1.0_f64, a in 0.0..5.0_f64, b in 0.0..5.0_f64,
    ) {
        let dwell = Dwell::new(hold, moving, reversal).unwrap();
        let matrix = |dt: f64| {
            let rows = dwell.probabilities(dt);
            Matrix3::from_fn(|i, j| rows[i][j])
        };
        let (stop, turn, start) = ((1.0 - reversal) / moving, reversal / moving, 0.5 / hold);
        let generator = Matrix3::new(
            -stop - turn, stop, turn,
            start, -2.0 * start, start,
            turn, stop, -stop - turn,
        );
        prop_assert!((matrix(a) - (generator * a).exp()).amax() < 1e-12);
        prop_assert!((matrix(a + b) - matrix(a) * matrix(b)).amax() < 1e-12);
        for row in dwell.probabilities(a) {
            prop_assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            prop_assert!(row.iter().all(|p| *p >= -1e-16));
        }
    }
}

/// A linear sensor whose branch tells stretching from releasing.
fn sensor() -> SwitchedModel<f64, 2, 1, 3> {
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
    let motion = Motion::ornstein_uhlenbeck(2.0, 0.03, 0.0, f64::INFINITY).unwrap().with_phase_rate(0.1);
    SwitchedModel::new(law, motion, noise).unwrap()
}

const DT_S: f64 = 0.2;

/// The sensor's own stochastic process: a chain of phases, and within each the model's transition and noise.
struct Process {
    model: SwitchedModel<f64, 2, 1, 3>,
    dwell: Dwell<f64>,
    rng: ChaCha12Rng,
    phase: Phase,
    state: SVector<f64, 3>,
}

impl Process {
    fn new(dwell: Dwell<f64>, seed: u64) -> Self {
        let rng = ChaCha12Rng::seed_from_u64(seed);
        Self { model: sensor(), dwell, rng, phase: Phase::Hold, state: SVector::zeros() }
    }

    /// The next phase and reading.
    fn step(&mut self) -> (Phase, f64) {
        let mut draw = uniform(&mut self.rng);
        let row = self.dwell.probabilities(DT_S)[self.phase.index()];
        let next = *Phase::ALL
            .iter()
            .find(|phase| {
                draw -= row[phase.index()];
                draw < 0.0
            })
            .unwrap_or(&self.phase);
        if next != Phase::Hold && next != self.phase {
            let known: Belief<f64, 3, 6> = Belief::independent(self.state, &[0.0; 3]);
            let entered = self.model.enter(&known, next);
            self.state = entered.mean;
            self.state[1] += entered.covariance[(1, 1)].sqrt() * normal(&mut self.rng);
        }
        self.phase = next;
        let transition: Transition<f64, 3, 6> =
            self.model.transition(&self.model.prepare(DT_S), &self.state, Direction::Known(next));
        self.state = transition.mean + draw_from(&transition.noise, &mut self.rng);
        let observation = self.model.observe(&self.state, Direction::Known(next));
        (next, observation.value + observation.variance.sqrt() * normal(&mut self.rng))
    }
}

/// A draw from N(0, Q) for a Q that may be singular.
fn draw_from(covariance: &Symmetric<f64, 3, 6>, rng: &mut ChaCha12Rng) -> SVector<f64, 3> {
    let eigen = covariance.to_matrix().symmetric_eigen();
    let scaled = SVector::<f64, 3>::from_fn(|i, _| eigen.eigenvalues[i].max(0.0).sqrt() * normal(rng));
    eigen.eigenvectors * scaled
}

/// Reliability: of the steps at which a filter gives a phase a probability between p and p + 0.2, a share of about the
/// mean probability must have that phase. Runs are independent; a bin's count of successes has at most the variance of
/// steps that are all alike within a dwell of ~10 steps, and 99.9 % are 3.29 deviations.
fn check_reliability(what: &str, probabilities: impl Fn(u64) -> Vec<(Phase, [f64; 3])>) {
    const CORRELATED_STEPS: f64 = 10.0;
    let mut bins = [[0.0_f64; 3]; 5];
    for seed in 0..200 {
        for (truth, probability) in probabilities(seed) {
            for phase in Phase::ALL {
                let p = probability[phase.index()];
                let bin = ((p * 5.0) as usize).min(4);
                bins[bin][0] += 1.0;
                bins[bin][1] += p;
                bins[bin][2] += f64::from(u8::from(truth == phase));
            }
        }
    }
    for [count, expected, seen] in bins {
        let (p, share) = (expected / count, seen / count);
        let deviation = (p * (1.0 - p) * CORRELATED_STEPS / count).sqrt();
        assert!((share - p).abs() < 3.29 * deviation + 0.01, "{what}: said {p:.3}, happened {share:.3} of {count}");
    }
}

#[test]
fn phase_probabilities_mean_what_they_say() {
    let dwell = Dwell::new(2.0, 2.0, 0.3).unwrap();
    let start: Belief<f64, 3, 6> = Belief::independent(SVector::zeros(), &[1e-8, 1e-8, 1e-8]);
    let prepared = Dynamics::<f64, 3, 6>::prepare(&sensor(), DT_S);
    let evidence = within(-100.0, 100.0);
    check_reliability("imm", |seed| {
        let imm = Imm::new(sensor(), dwell, evidence);
        let mut mixture = Mixture::<f64, 3, 6, 3>::single(start, Phase::Hold);
        let mut process = Process::new(dwell, seed);
        (0..50)
            .map(|_| {
                let (phase, reading) = process.step();
                mixture = imm.step_prepared(&mixture, &prepared, DT_S, Some(Reading::from(reading))).unwrap().posterior;
                (phase, mixture.phase_probabilities())
            })
            .collect()
    });
    check_reliability("hypotheses", |seed| {
        let filter = Hypotheses::new(sensor(), dwell, evidence);
        let mut mixture = Mixture::<f64, 3, 6, 24>::single(start, Phase::Hold);
        let mut process = Process::new(dwell, seed);
        (0..50)
            .map(|_| {
                let (phase, reading) = process.step();
                let step = filter.step_prepared(&mixture, &prepared, DT_S, Some(Reading::from(reading))).unwrap();
                mixture = step.posterior;
                (phase, mixture.phase_probabilities())
            })
            .collect()
    });
}

/// A body at rest on a limit: the evidence of the limit counts once, not at each of a thousand steps.
#[test]
fn a_thousand_steps_at_rest_on_a_limit_change_nothing() {
    let evidence = within(0.0, 0.3);
    let dwell = Dwell::new(1e9, 1.0, 0.3).unwrap();
    let prepared = Dynamics::<f64, 3, 6>::prepare(&sensor(), DT_S);
    let start: Belief<f64, 3, 6> = Belief::independent(SVector::zeros(), &[1e-4, 0.0, 0.0]);
    let filter = Hypotheses::new(sensor(), dwell, evidence);
    let mut mixture = Mixture::<f64, 3, 6, 8>::single(start, Phase::Hold);
    let first = filter.step_prepared(&mixture, &prepared, DT_S, None).unwrap().posterior.moments();
    for _ in 0..1000 {
        mixture = filter.step_prepared(&mixture, &prepared, DT_S, None).unwrap().posterior;
    }
    let last = mixture.moments();
    assert!((last.mean[0] - first.mean[0]).abs() < 1e-6, "{} {}", last.mean[0], first.mean[0]);
    assert!((last.covariance[(0, 0)] / first.covariance[(0, 0)] - 1.0).abs() < 1e-3);
}

/// Stretching and releasing both raise R here. The sign-split filter, told nothing about direction, must know it.
#[test]
fn sign_split_tells_stretching_from_releasing() {
    let motion = Motion::smooth(0.1, 0.15, 0.15, 0.12).unwrap();
    let law = *sensor().law();
    let noise = *sensor().noise();
    let model = SwitchedModel::<f64, 3, 1, 4>::new(law, motion, noise).unwrap();
    let filter = SignSplit::new(model, None, within(-0.2, 0.5));
    let prepared = Dynamics::<f64, 4, 10>::prepare(&model, 0.05);
    let start: Belief<f64, 4, 10> = Belief::initial(&model);
    let mut mixture = Mixture::<f64, 4, 10, 8>::single(start, Phase::Extend);
    let mut branch = 0.0;
    let (mut right, mut counted) = (0, 0);
    let mut before = 0.15;
    for k in 0..2000 {
        // A naive sensor: strain a sine, branch by explicit Euler steps of the same law.
        let strain = 0.15 + 0.12 * (f64::from(k) * 0.05).sin();
        let step = strain - before;
        branch += (if step > 0.0 { 1.0 } else { -0.8 }) * step - branch * 0.05 / 3.0;
        before = strain;
        let reading = Some(Reading::from(1.5 * strain + branch));
        mixture = filter.step_prepared(&mixture, &prepared, 0.05, reading).unwrap().posterior;
        let speed = step.abs() / 0.05;
        if k > 400 && speed > 0.03 {
            let [extends, _, _] = mixture.phase_probabilities();
            right += u32::from((extends > 0.5) == (step > 0.0));
            counted += 1;
        }
    }
    assert!(f64::from(right) > 0.95 * f64::from(counted), "{right} of {counted}");
}
