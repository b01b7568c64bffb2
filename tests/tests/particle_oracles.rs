//! The particle filter on a linear model, moving or standing, compared with the Kalman filter; the random difference falls
//! with the square root of the number of particles.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Dwell, Evidence, Reading};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};
use ohmstrain_tests::particles::{ParticleCloud, Particles};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const ANYWHERE: Evidence<f64> =
    Evidence { limits: StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY }, tempering: 1.0 };

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

type Model = SwitchedModel<f64, 2, 5>;
type Cloud = ParticleCloud<f64, 5, 15>;

/// Parameters of the linear sensor for the oracle.
const GAUGE: f64 = 1.5;
const VISCOSITY_S: f64 = 0.03;
const TAUS_S: [f64; 2] = [2.0, 15.0];
const GAINS: [f64; 2] = [0.8, 0.4];
const RATE_TIME_S: f64 = 1.5;
const RATE_SD: f64 = 0.05;
const STRAIN_SD: f64 = 0.1;
const NOISE: ModelNoise<f64> =
    ModelNoise { reading_sd: 5e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
const DT_S: f64 = 0.1;

/// Returns a linear Gaussian model: gains do not depend on direction or strain, and the mean strain is zero.
fn linear() -> Model {
    let branch = |i: usize| Branch {
        tau_s: TAUS_S[i],
        extend_gain: GAINS[i],
        retract_gain: GAINS[i],
        extend_gain_slope: 0.0,
        retract_gain_slope: 0.0,
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [GAUGE, 0.0, 0.0] },
        extend_viscosity_s: VISCOSITY_S,
        retract_viscosity_s: VISCOSITY_S,
        branches: [branch(0), branch(1)],
        range: StrainRange { lower: -10.0, upper: 10.0 },
    };
    let motion = Motion::ornstein_uhlenbeck(RATE_TIME_S, RATE_SD, 0.0, STRAIN_SD).unwrap();
    SwitchedModel::new(law, motion, NOISE).unwrap()
}

/// The textbook Kalman filter of the same sensor, from its differential equations: dense matrices, discretised by Van
/// Loan's exponential (*IEEE Trans. Autom. Control* 23 (1978) 395).
struct Kalman {
    f: SMatrix<f64, 5, 5>,
    q: SMatrix<f64, 5, 5>,
    h: SMatrix<f64, 1, 5>,
    x: SVector<f64, 5>,
    p: SMatrix<f64, 5, 5>,
    log_likelihood: f64,
}

impl Kalman {
    /// Discretises the model; `moves` = false is a standing body with unknown strain.
    fn new(moves: bool) -> Self {
        let mut a = SMatrix::<f64, 5, 5>::zeros();
        let mut density = SMatrix::<f64, 5, 5>::zeros();
        let mut p = SMatrix::<f64, 5, 5>::zeros();
        p[(0, 0)] = STRAIN_SD.powi(2);
        if moves {
            a[(0, 1)] = 1.0;
            a[(1, 0)] = -(RATE_SD / STRAIN_SD).powi(2);
            a[(1, 1)] = -1.0 / RATE_TIME_S;
            density[(1, 1)] = 2.0 * RATE_SD.powi(2) / RATE_TIME_S;
            p[(1, 1)] = RATE_SD.powi(2);
        }
        for (i, (sd, time_s)) in
            [(NOISE.branch_sd, TAUS_S[0]), (NOISE.branch_sd, TAUS_S[1]), (NOISE.baseline_sd, NOISE.baseline_time_s)]
                .into_iter()
                .enumerate()
        {
            let k = 2 + i;
            a[(k, k)] = -1.0 / time_s;
            density[(k, k)] = 2.0 * sd * sd / time_s;
            p[(k, k)] = sd * sd;
            if moves && i < 2 {
                a[(k, 1)] = GAINS[i];
            }
        }
        let mut joint = SMatrix::<f64, 10, 10>::zeros();
        joint.fixed_view_mut::<5, 5>(0, 0).copy_from(&-a);
        joint.fixed_view_mut::<5, 5>(0, 5).copy_from(&density);
        joint.fixed_view_mut::<5, 5>(5, 5).copy_from(&a.transpose());
        let joint = (joint * DT_S).exp();
        let f = joint.fixed_view::<5, 5>(5, 5).transpose();
        let q = f * joint.fixed_view::<5, 5>(0, 5);
        let h = SMatrix::<f64, 1, 5>::new(GAUGE, VISCOSITY_S, 1.0, 1.0, 1.0);
        Self { f, q: (q + q.transpose()) / 2.0, h, x: SVector::zeros(), p, log_likelihood: 0.0 }
    }

    fn step(&mut self, reading: Option<f64>) {
        self.x = self.f * self.x;
        self.p = self.f * self.p * self.f.transpose() + self.q;
        let Some(y) = reading else { return };
        let s = (self.h * self.p * self.h.transpose())[0] + NOISE.reading_sd.powi(2);
        let k = self.p * self.h.transpose() / s;
        let innovation = y - (self.h * self.x)[0];
        self.x += k * innovation;
        self.p -= k * s * k.transpose();
        self.log_likelihood -= 0.5 * (innovation * innovation / s + (std::f64::consts::TAU * s).ln());
    }

    /// Simulates readings of such a sensor, every seventh one missing.
    fn simulate(&self, steps: usize, seed: u64) -> (SVector<f64, 5>, Vec<Option<f64>>) {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut draw = |covariance: &SMatrix<f64, 5, 5>| {
            let eigen = covariance.symmetric_eigen();
            let scaled = SVector::from_fn(|i, _| eigen.eigenvalues[i].max(0.0).sqrt() * normal(&mut rng));
            eigen.eigenvectors * SVector::<f64, 5>::from(scaled)
        };
        let mut x = draw(&self.p);
        let mut states = Vec::new();
        for _ in 0..steps {
            x = self.f * x + draw(&self.q);
            states.push(x);
        }
        let readings = states
            .iter()
            .enumerate()
            .map(|(k, x)| (k % 7 != 6).then(|| (self.h * x)[0] + NOISE.reading_sd * normal(&mut rng)))
            .collect();
        (x, readings)
    }
}

/// Returns posterior and log-likelihood after all readings.
fn run(filter: &Particles<f64, Model>, phase: Phase, readings: &[Option<f64>]) -> (Cloud, f64) {
    let prepared = filter.model().prepare(DT_S);
    let mut cloud: Cloud = filter.start(&Belief::initial(filter.model()), phase);
    let mut log_likelihood = 0.0;
    for reading in readings {
        let step = filter.step_prepared(&cloud, &prepared, DT_S, reading.map(Reading::from)).unwrap();
        cloud = step.posterior;
        log_likelihood += step.log_likelihood;
    }
    (cloud, log_likelihood)
}

/// Number of runs with different random numbers, for averages and spreads.
const RUNS: usize = 64;

/// Returns mean and standard deviation over the runs.
fn over_runs(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = values.collect();
    let mean = values.iter().sum::<f64>() / RUNS as f64;
    (mean, (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (RUNS - 1) as f64).sqrt())
}

/// Returns four standard errors of an average over the runs, with a probability of 6e-5 in all.
fn four_errors(sd: f64) -> f64 {
    4.0 * sd / (RUNS as f64).sqrt()
}

fn runs(count: usize, hold: Option<Dwell<f64>>, phase: Phase, readings: &[Option<f64>]) -> Vec<(Cloud, f64)> {
    (0..RUNS as u64).map(|seed| run(&Particles::new(linear(), hold, ANYWHERE, count, seed), phase, readings)).collect()
}

/// Compares averages over the runs with the Kalman filter for each entry of the state, and returns the spread of each
/// mean.
///
/// Normalising the weights biases a mean of N particles by σ C/N; its own spread is s = σ √(C/N), so the bias is s²/σ.
/// The cloud's variance lacks the spread of the mean, s², as in any sample; the weights' bias takes σ C/N from the
/// standard deviation, which is 2 s² of the variance.
fn check_moments(kalman: &Kalman, runs: &[(Cloud, f64)], states: std::ops::Range<usize>) -> Vec<f64> {
    let moments: Vec<_> = runs.iter().map(|(cloud, _)| cloud.moments()).collect();
    states
        .map(|i| {
            let exact = kalman.p[(i, i)];
            let (mean, mean_sd) = over_runs(moments.iter().map(|m| m.mean[i]));
            let bias = mean_sd * mean_sd / exact.sqrt();
            assert!((mean - kalman.x[i]).abs() < four_errors(mean_sd) + bias, "state {i}: {mean} {}", kalman.x[i]);
            let (variance, variance_sd) = over_runs(moments.iter().map(|m| m.covariance[(i, i)]));
            let missing = 3.0 * mean_sd * mean_sd;
            assert!((variance - exact).abs() < four_errors(variance_sd) + missing, "P[{i}]: {variance} {exact}");
            let (covariance, covariance_sd) = over_runs(moments.iter().map(|m| m.covariance[(i, 0)]));
            let missing = 3.0 * mean_sd * over_runs(moments.iter().map(|m| m.mean[0])).1;
            assert!((covariance - kalman.p[(i, 0)]).abs() < four_errors(covariance_sd) + missing, "P[{i}, 0]");
            mean_sd
        })
        .collect()
}

#[test]
fn on_a_linear_model_it_is_the_kalman_filter_but_for_chance() {
    let mut kalman = Kalman::new(true);
    let (_, readings) = kalman.simulate(60, 1);
    for reading in &readings {
        kalman.step(*reading);
    }
    let few = runs(1000, None, Phase::Extend, &readings);
    let many = runs(9000, None, Phase::Extend, &readings);
    let spread = (check_moments(&kalman, &few, 0..5), check_moments(&kalman, &many, 0..5));
    for (i, (few, many)) in spread.0.iter().zip(&spread.1).enumerate() {
        // Nine times the particles give a ninth of the variance. A ratio of two estimates with 63 degrees of freedom
        // each lies between 1/2.7 and 2.7 in 99.99 % of cases.
        let ratio = (few / many).powi(2) / 9.0;
        assert!(ratio > 1.0 / 2.7 && ratio < 2.7, "state {i}: {ratio}");
    }
    // The likelihood itself, not its logarithm, has the exact expectation, with any number of particles and with
    // resampling when needed (Del Moral, *Feynman-Kac Formulae* (2004), 7.4.1).
    for runs in [&few, &many] {
        let (ratio, sd) = over_runs(runs.iter().map(|(_, log)| (log - kalman.log_likelihood).exp()));
        assert!((ratio - 1.0).abs() < four_errors(sd), "{ratio} ± {sd}");
    }
}

/// A body that stands for 300 s. If holds never end, the posterior is that of a Kalman filter for a constant strain. The
/// kernel that keeps particles apart must not widen, narrow or shift it.
#[test]
fn in_a_hold_without_end_it_is_the_kalman_filter() {
    let mut kalman = Kalman::new(false);
    let (_, readings) = kalman.simulate(3000, 5);
    for reading in &readings {
        kalman.step(*reading);
    }
    let endless = Dwell::new(1e12, 1.0, 0.3).unwrap();
    let runs = runs(500, Some(endless), Phase::Hold, &readings);
    // State 1, the rate, is zero in all of them.
    check_moments(&kalman, &runs, 0..1);
    check_moments(&kalman, &runs, 2..5);
}
