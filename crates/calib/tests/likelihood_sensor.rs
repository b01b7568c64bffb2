//! Noise and motion of a sensor from its readings alone.

use ohmstrain_calib::CalibrationError;
use ohmstrain_calib::likelihood::{
    Likelihood, LikelihoodProblem, ModelFamily, NoiseFit, NoiseParameter, NoiseStart, Parameter, ReadingSeries,
};
use ohmstrain_ekf::{Belief, StepError};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, ParameterError, Phase, Scalar, StrainRange, SwitchedModel, Transition,
};
use ohmstrain_sensor::{LawParams, MotionParams, NoiseParams};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const STEP_S: f64 = 0.05;
const TRUE_NOISE: NoiseParams =
    NoiseParams { reading_sd: 4e-3, reading_time_s: 0.0, branch_sd: 0.0, baseline_sd: 0.1, baseline_time_s: 10.0 };
const TRUE_MOTION: MotionParams =
    MotionParams { rate_time_s: 0.5, rate_sd_per_s: 0.2, strain_mean: 0.15, strain_sd: 0.08 };
const FREE: [NoiseParameter; 4] =
    [NoiseParameter::ReadingSd, NoiseParameter::BaselineSd, NoiseParameter::RateSd, NoiseParameter::RateTime];

/// Returns a law that is linear and the same in both directions, so that the filter and thus the likelihood are exact;
/// `lean` makes the directions differ.
fn law(lean: f64) -> LawParams {
    LawParams {
        extend_viscosity_s: 0.02,
        retract_viscosity_s: 0.02 - lean * 0.02,
        range: StrainRange { lower: -1.0, upper: 1.5 },
        gauge: Gauge::Polynomial { coefficients: [1.8, 0.0, 0.0] },
        branches: vec![Branch {
            tau_s: 4.0,
            extend_gain: 0.6,
            retract_gain: 0.6 - lean * 0.9,
            extend_gain_slope: 0.0,
            retract_gain_slope: 0.0,
        }],
    }
}

/// Draws readings from the model.
fn simulate(seed: u64, rows: usize) -> (Vec<f64>, Vec<f64>) {
    let MotionParams { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = TRUE_MOTION;
    let motion = Motion::ornstein_uhlenbeck(rate_time_s, rate_sd_per_s, strain_mean, strain_sd).unwrap();
    let model = SwitchedModel::<f64, 1, 4>::new(law(0.0).to_model().unwrap(), motion, TRUE_NOISE.to_model()).unwrap();
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let (mean, variance) = model.initial_distribution();
    let mut state = mean;
    for i in 0..4 {
        state[i] += variance[i].sqrt() * normal();
    }
    let step = model.prepare(STEP_S);
    let direction = Direction::Known(Phase::Extend);
    let (mut time_s, mut value) = (vec![], vec![]);
    for row in 0..rows {
        let observation = model.observe(&state, direction);
        time_s.push(row as f64 * STEP_S);
        value.push(observation.value + observation.variance.sqrt() * normal());
        let transition: Transition<f64, 4, 10> = model.transition(&step, &state, direction);
        // The branch has no noise of its own: strain, rate and branch move in two directions only, hence a square root
        // by eigenvalues.
        let eigen = transition.noise.to_matrix().symmetric_eigen();
        state = transition.mean;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            state += vector * (value.max(0.0).sqrt() * normal());
        }
    }
    (time_s, value)
}

/// Returns a start that is wrong by a factor of two or three everywhere.
fn start() -> NoiseStart {
    NoiseStart {
        noise: NoiseParams {
            reading_sd: 1e-2,
            reading_time_s: 0.0,
            branch_sd: 0.0,
            baseline_sd: 0.03,
            baseline_time_s: 10.0,
        },
        motion: MotionParams { rate_time_s: 1.2, rate_sd_per_s: 0.08, strain_mean: 0.15, strain_sd: 0.08 },
    }
}

fn noise_of(
    recordings: &[ReadingSeries],
    law: &LawParams,
    start: &NoiseStart,
    free: &[NoiseParameter],
) -> Result<NoiseFit, CalibrationError> {
    LikelihoodProblem { recordings, law, start, free }.fit()
}

fn fit(seed: u64, rows: usize) -> NoiseFit {
    let (time_s, value) = simulate(seed, rows);
    let recordings = [ReadingSeries { time_s: &time_s, value: &value, extra_sd: &[] }];
    noise_of(&recordings, &law(0.0), &start(), &FREE).unwrap()
}

#[test]
fn known_noise_is_found_within_its_standard_errors() {
    const SEEDS: u64 = 12;
    let truth = [4e-3, 0.1, 0.2, 0.5];
    let (mut within_one, mut within_three, mut all) = (0, 0, 0);
    for seed in 0..SEEDS {
        let found = fit(seed, 3000);
        assert!(found.fit.converged, "{found:?}");
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        for (parameter, truth) in found.fit.parameters.iter().zip(truth) {
            let off = (parameter.value / truth).ln() / parameter.ln_standard_error.unwrap();
            within_one += u32::from(off.abs() <= 1.0);
            within_three += u32::from(off.abs() <= 3.0);
            all += 1;
        }
    }
    // 48 draws. Three standard errors cover 0.9973 of them: more than one miss has a probability of 0.8 %, more than
    // two of 0.03 %. One standard error covers 0.683: 32.8 ± 3.2, three of which are 23 to 42.
    println!("{within_one} within one and {within_three} within three of {all}");
    assert_eq!(all, 48);
    assert!(within_three >= 46, "{within_three}");
    assert!((23..=42).contains(&within_one), "{within_one}");
}

#[test]
fn noise_of_the_electronics_is_not_counted_twice() {
    let (time_s, value) = simulate(1, 1000);
    let at = |own: f64, extra_sd: &[f64]| {
        let mut start = NoiseStart { noise: TRUE_NOISE, motion: TRUE_MOTION };
        start.noise.reading_sd = own;
        let recordings = [ReadingSeries { time_s: &time_s, value: &value, extra_sd }];
        let (law, free) = (law(0.0), [NoiseParameter::ReadingSd]);
        let problem = LikelihoodProblem { recordings: &recordings, law: &law, start: &start, free: &free };
        problem.log_likelihood().unwrap().value
    };
    // 3² + 4² = 5². Half of the rows have no electronics' deviation, and a missing cell adds nothing.
    let split = at(3e-3, &vec![4e-3; 1000]);
    assert!((split - at(5e-3, &[])).abs() < 1e-9 * split.abs());
    assert_eq!(at(3e-3, &[f64::NAN; 10]), at(3e-3, &[]));
    assert_ne!(at(3e-3, &[4e-3; 10]), at(3e-3, &[]));
}

#[test]
fn what_the_readings_do_not_say_is_warned_of() {
    let (time_s, value) = simulate(1, 1000);
    let recordings = [ReadingSeries { time_s: &time_s, value: &value, extra_sd: &[] }];
    let mut start = NoiseStart { noise: TRUE_NOISE, motion: TRUE_MOTION };
    // The simulated branch has no noise.
    start.noise.branch_sd = 1e-3;
    let found = noise_of(&recordings, &law(0.0), &start, &[NoiseParameter::BranchSd]).unwrap();
    assert!(!found.warnings.is_empty() && found.warnings[0].contains("branch_sd"), "{found:?}");
    assert!(found.noise.branch_sd < 1e-3);
    assert_eq!(found.motion, start.motion);
}

/// The sensor with a law whose directions differ, as a family in the white noise and the rate.
struct Switched;

fn switched<T: Scalar>(parameters: &[T]) -> Result<SwitchedModel<T, 1, 4>, ParameterError> {
    let law = law(1.0);
    let branch = law.branches[0];
    let law = ohmstrain_model::SensorLaw {
        gauge: ohmstrain_model::Gauge::Polynomial { coefficients: [1.8, -1.5, 0.4].map(T::of) },
        extend_viscosity_s: T::of(law.extend_viscosity_s),
        retract_viscosity_s: T::of(law.retract_viscosity_s),
        branches: [ohmstrain_model::Branch {
            tau_s: T::of(branch.tau_s),
            extend_gain: T::of(branch.extend_gain),
            retract_gain: T::of(branch.retract_gain),
            extend_gain_slope: T::of(-0.4),
            retract_gain_slope: T::of(0.3),
        }],
        range: ohmstrain_model::StrainRange { lower: T::of(-1.0), upper: T::of(1.5) },
    };
    let motion = Motion::ornstein_uhlenbeck(parameters[2], parameters[1], T::of(0.15), T::of(0.08))?;
    let noise = ModelNoise {
        reading_sd: parameters[0],
        branch_sd: T::of(2e-3),
        baseline_sd: parameters[3],
        baseline_time_s: parameters[4],
    };
    SwitchedModel::new(law, motion, noise)
}

impl ModelFamily<4, 10> for Switched {
    type Model<T: Scalar> = SwitchedModel<T, 1, 4>;
    fn model<T: Scalar>(&self, parameters: &[T]) -> Result<Self::Model<T>, ParameterError> {
        switched(parameters)
    }
    fn start<T: Scalar>(&self, model: &Self::Model<T>) -> Belief<T, 4, 10> {
        Belief::initial(model)
    }
}

const POINT: [f64; 5] = [3e-3, 0.25, 0.4, 0.015, 2.0];

/// Compares exact derivatives with central differences of the log-likelihood, in the logarithms.
fn check_derivatives<F: ModelFamily<4, 10>>(family: &F) {
    let (time_s, mut value) = simulate(3, 300);
    value[40..60].fill(f64::NAN);
    let recordings = [ReadingSeries { time_s: &time_s, value: &value, extra_sd: &[] }];
    let parameters = ["reading", "rate", "time", "baseline", "baseline time"].map(|name| Parameter::around(name, 1.0));
    let likelihood = Likelihood::<_, 4, 10> { family, parameters: &parameters, recordings: &recordings };
    let at = |point: &[f64; 5]| likelihood.log_likelihood(point).unwrap().value;
    let moved = |i: usize, by: f64| {
        let mut point = POINT;
        point[i] *= by.exp();
        point
    };
    let exact = likelihood.derivatives(&POINT).unwrap();
    assert!((exact.log_likelihood.value - at(&POINT)).abs() < 1e-9 * exact.log_likelihood.value.abs());
    // Curvatures are of the order of the number of readings, 280, and so are third and fourth derivatives. A step h has
    // an error of h²/6 of those, 3e-8 of them, and of 1e-12 · value / h by rounding, 1e-6.
    let h = 4e-4;
    let size = exact.hessian.amax();
    for i in 0..5 {
        let slope = (at(&moved(i, h)) - at(&moved(i, -h))) / (2.0 * h);
        assert!((exact.gradient[i] - slope).abs() < 1e-6 * size, "{i}: {} vs {slope}", exact.gradient[i]);
        let up = likelihood.derivatives(&moved(i, h)).unwrap().gradient;
        let down = likelihood.derivatives(&moved(i, -h)).unwrap().gradient;
        for j in 0..5 {
            let curvature = (up[j] - down[j]) / (2.0 * h);
            let got = exact.hessian[(i, j)];
            assert!((got - curvature).abs() < 1e-6 * size, "{i} {j}: {got} vs {curvature}");
        }
    }
}

#[test]
fn derivatives_are_exact() {
    check_derivatives(&Switched);
}

#[test]
fn errors_name_the_culprit() {
    let time_s = [0.0, 0.1, 0.2];
    let value = [0.3, f64::INFINITY, 0.3];
    let recordings = [ReadingSeries { time_s: &time_s, value: &value, extra_sd: &[] }];
    let at = |recordings: &[ReadingSeries], free: &[NoiseParameter]| {
        noise_of(recordings, &law(0.0), &start(), free).unwrap_err()
    };
    let failed = |time_s: f64, source: StepError| CalibrationError::Filter { time_s, source };
    assert_eq!(at(&recordings, &FREE), failed(0.1, StepError::NonFiniteReading));
    let backwards = [ReadingSeries { time_s: &[0.0, 0.2, 0.1], value: &[0.3; 3], extra_sd: &[] }];
    assert_eq!(at(&backwards, &FREE), failed(0.1, StepError::NegativeTimeStep));
    assert!(at(&recordings, &[]).to_string().contains("no parameter is free"));
    assert!(at(&recordings, &[NoiseParameter::BranchSd]).to_string().contains("branch_sd"));
    let mut five = law(0.0);
    five.branches = vec![five.branches[0]; 5];
    let refused = noise_of(&recordings, &five, &start(), &FREE).unwrap_err();
    assert!(refused.to_string().contains("a law with 5 branches"), "{refused}");
}
