//! Readings and parameters that nobody should send, in the precision in which they hurt.

use ohmstrain_ekf::{
    Belief, Compact, Dwell, Ekf, Estimator, Evidence, Gaussian, Guard, Hypotheses, Imm, Influence, Mixture,
    PhaseMixture, Reading, ReadingVerdict, SignSplit, SparseEkf, State, Streak,
};
use ohmstrain_model::{
    Branch, Gauge, ModelNoise, Motion, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
};

const DT_S: f64 = 0.02;

fn model<T: Scalar>(gauge: [f64; 3]) -> SwitchedModel<T, 1, 4> {
    let of = T::of;
    let branch = Branch {
        tau_s: of(20.0),
        extend_gain: of(0.6),
        retract_gain: of(-0.4),
        extend_gain_slope: of(0.0),
        retract_gain_slope: of(0.0),
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: gauge.map(of) },
        extend_viscosity_s: of(0.02),
        retract_viscosity_s: of(-0.01),
        branches: [branch],
        range: StrainRange { lower: of(0.0), upper: of(0.33) },
    };
    let motion = Motion::ornstein_uhlenbeck(of(1.0), of(0.1), of(0.15), of(0.1)).unwrap();
    let noise =
        ModelNoise { reading_sd: of(2e-3), branch_sd: of(5e-3), baseline_sd: of(0.02), baseline_time_s: of(30.0) };
    SwitchedModel::new(law, motion, noise).unwrap()
}

const RISING: [f64; 3] = [1.9, -2.8, 0.0];

fn evidence<T: Scalar>() -> Evidence<T> {
    Evidence { limits: StrainRange { lower: T::of(0.0), upper: T::of(0.33) }, tempering: T::one() }
}

fn split<T: ohmstrain_ekf::Real>() -> SignSplit<T, 1, 4, 8> {
    SignSplit::new(model(RISING), T::of(DT_S), None, evidence()).unwrap()
}

/// After readings that belong to a strain of about 0.15, one far away: the squared innovation over its variance is then
/// large and positive, in either precision, and a gate turns it down.
fn check_far_reading<T: ohmstrain_ekf::Real>(far: f64) {
    let filter = split::<T>();
    let prepared = Estimator::<T, 4, 10>::prepare(&filter, T::of(DT_S));
    let guard = Guard::none().with_gate(T::of(10.8), 10).unwrap();
    let (mut state, mut streak) =
        (Mixture::<T, 4, 10, 8>::single(Belief::initial(filter.model()), Phase::Extend), Streak::default());
    for k in 0..60 {
        // A slow oscillation keeps both directions possible.
        let reading = T::of(0.2 + 0.02 * (0.3 * f64::from(k)).sin());
        let taken = guard.advance(&filter, &state, streak, &prepared, Some(Reading::from(reading))).unwrap();
        (state, streak) = (taken.advanced.state, taken.streak);
    }
    let before = state.moments().mean[0];
    let taken = guard.advance(&filter, &state, streak, &prepared, Some(Reading::from(T::of(far)))).unwrap();
    assert_eq!(taken.verdict, ReadingVerdict::Rejected, "{far}");
    let innovation = taken.advanced.innovation.unwrap();
    // The variance of a reading before it was seen does not depend on how far away the reading is.
    let near = guard.advance(&filter, &state, streak, &prepared, Some(Reading::from(T::of(0.2)))).unwrap();
    let near = near.advanced.innovation.unwrap().variance;
    // Each innovation is rounded by far ε at most, so their standard deviation is too, twice over.
    let rounding = T::of(2.0 * far) * T::default_epsilon() / near.sqrt();
    let ratio = innovation.variance / near;
    assert!((ratio.sqrt() - T::one()).abs() <= rounding, "{far}: {ratio:?} {rounding:?}");
    assert!((taken.advanced.state.moments().mean[0] - before).abs() < T::of(0.05), "{far}");
}

#[test]
fn the_variance_of_a_mixtures_reading_is_not_a_difference_of_squares() {
    check_far_reading::<f32>(30.0);
    check_far_reading::<f32>(1e4);
    check_far_reading::<f64>(30.0);
    check_far_reading::<f64>(1e8);
}

#[test]
fn a_variance_below_zero_is_refused() {
    let reading = Some(Reading { value: 0.2, extra_variance: -1.0 });
    let model = model::<f64>(RISING);
    let start: Belief<f64, 4, 10> = Belief::initial(&model);
    assert!(Ekf::new(model).step(&start, DT_S, reading).is_err());
    // Also one that leaves the innovation's variance positive.
    let slight = Some(Reading { value: 0.2, extra_variance: -1e-9 });
    assert!(Ekf::new(model).step(&start, DT_S, slight).is_err());
    let mut belief = start;
    assert!(SparseEkf::<f64, Compact, 1, 4>::new(model, DT_S).unwrap().step(&mut belief, slight).is_err());
    assert_eq!(belief, start);
    let mut mixture = Mixture::<f64, 4, 10, 8>::single(start, Phase::Extend);
    let split = SignSplit::<f64, 1, 4, 8>::new(model, DT_S, None, evidence()).unwrap();
    assert!(split.step(&mut mixture, slight).is_err());
}

/// A linear congruential generator (Knuth, MMIX), to draw models from.
struct Draws(u64);

impl Draws {
    /// Between 0 and 1.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Between two positive numbers, evenly in the logarithm.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.uniform())
    }
}

/// A model and the length of its steps, s; the same numbers in either precision. `quiet`: what is
/// multiplied with its noise, and with all that makes a reading depend on more than the strain.
fn random_model<T: Scalar>(draws: &mut Draws, quiet: f64) -> (SwitchedModel<T, 2, 5>, T) {
    let of = |number: f64| T::of(f64::from(number as f32));
    let mut between = |low: f64, high: f64| of(draws.between(low, high));
    let mut branch = |low: f64, high: f64| Branch {
        tau_s: between(low, high),
        extend_gain: between(0.1 * quiet, 2.0 * quiet),
        retract_gain: -between(0.1 * quiet, 2.0 * quiet),
        extend_gain_slope: between(0.1 * quiet, 4.0 * quiet),
        retract_gain_slope: -between(0.1 * quiet, 4.0 * quiet),
    };
    let branches = [branch(0.5, 10.0), branch(10.0, 300.0)];
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [between(0.3, 4.0), -between(0.3, 8.0), T::zero()] },
        extend_viscosity_s: between(1e-3 * quiet, 0.1 * quiet),
        retract_viscosity_s: -between(1e-3 * quiet, 0.1 * quiet),
        branches,
        range: StrainRange { lower: T::zero(), upper: of(0.33) },
    };
    let motion =
        Motion::ornstein_uhlenbeck(between(0.1, 5.0), between(0.01, 1.0), of(0.15), between(0.05, 0.5)).unwrap();
    let noise = ModelNoise {
        reading_sd: between(1e-6 * quiet, 1e-3 * quiet),
        branch_sd: between(1e-4 * quiet, 0.05 * quiet),
        baseline_sd: between(1e-3 * quiet, 0.1 * quiet),
        baseline_time_s: between(5.0, 500.0),
    };
    (SwitchedModel::new(law, motion, noise).unwrap(), between(2e-3, 0.2))
}

/// A reading that single precision cannot take without a variance below zero must not lock the filter out: no reading that
/// the law itself gives is refused, and the estimate follows.
#[test]
fn single_precision_takes_precise_readings() {
    let mut draws = Draws(1);
    let (mut refused, mut steps, mut stuck) = (0, 0, 0);
    for _ in 0..4000 {
        let (model, dt_s) = random_model::<f32>(&mut draws, 1.0);
        let filter = SparseEkf::<f32, Compact, 2, 5>::new(model, dt_s).unwrap();
        let mut belief: Belief<f32, 5, 15> = Belief::initial(&model);
        let mut last_refused = 0;
        for k in 0..300 {
            let strain = 0.15 + 0.1 * (0.7 * dt_s * k as f32).sin();
            let rho = model.law().gauge_value_and_slope(strain).0 + 1e-3 * (draws.uniform() as f32 - 0.5);
            let taken = filter.step(&mut belief, Some(Reading::from(rho)));
            steps += 1;
            if taken.is_err() {
                refused += 1;
                last_refused += 1;
            } else {
                last_refused = 0;
            }
        }
        stuck += usize::from(last_refused > 100);
    }
    assert_eq!((refused, stuck), (0, 0), "of {steps}");
}

fn wide(belief: &Belief<f32, 5, 15>) -> Belief<f64, 5, 15> {
    let mean = belief.mean.map(f64::from);
    let mut covariance = Symmetric::zeros();
    for i in 0..5 {
        for j in 0..=i {
            covariance[(i, j)] = f64::from(belief.covariance[(i, j)]);
        }
    }
    Belief { mean, covariance }
}

/// Largest difference of two beliefs: of means in the deviations of the prediction, of covariances relative to its diagonal.
fn apart(a: &Belief<f64, 5, 15>, b: &Belief<f64, 5, 15>, prediction: &Belief<f64, 5, 15>) -> f64 {
    let sd: [f64; 5] = std::array::from_fn(|i| prediction.covariance[(i, i)].sqrt());
    let mean = (0..5).map(|i| (a.mean[i] - b.mean[i]).abs() / sd[i]);
    let pairs = (0..5).flat_map(|i| (0..=i).map(move |j| (i, j)));
    let covariance = pairs.map(|(i, j)| (a.covariance[(i, j)] - b.covariance[(i, j)]).abs() / (sd[i] * sd[j]));
    mean.chain(covariance).fold(0.0, f64::max)
}

/// A reading that is too exact for single precision is taken again with more noise *from where the step began*: what comes out is
/// a step in double precision, with the reading as it is or with sixteen times the noise, once or more often.
#[test]
fn a_repeated_reading_starts_from_the_same_belief() {
    let mut draws = Draws(1);
    let (mut repeated, mut most) = (0, 0.0_f64);
    for _ in 0..MODELS {
        let (of_double, dt_s) = random_model::<f64>(&mut Draws(draws.0), QUIET);
        let double = SparseEkf::<f64, Compact, 2, 5>::new(of_double, dt_s).unwrap();
        let (model, dt_s) = random_model::<f32>(&mut draws, QUIET);
        let filter = SparseEkf::<f32, Compact, 2, 5>::new(model, dt_s).unwrap();
        let mut belief: Belief<f32, 5, 15> = Belief::initial(&model);
        for k in 0..300 {
            let strain = 0.15 + 0.1 * (0.7 * dt_s * k as f32).sin();
            let value = model.law().gauge_value_and_slope(strain).0 + 1e-3 * (draws.uniform() as f32 - 0.5);
            let (before, value) = (wide(&belief), f64::from(value));
            let residual = filter.step(&mut belief, Some(Reading::from(value as f32))).unwrap().unwrap();
            let step = |reading| {
                let mut after = before;
                double.step(&mut after, reading).unwrap();
                after
            };
            let prediction = step(None);
            // In units of what rounding leaves: of covariances ε, of a mean that of the reading in its deviations.
            let unit = f64::from(f32::EPSILON) * (1.0 + 1.0 / f64::from(residual.variance).sqrt());
            let apart = |extra_variance| {
                apart(&wide(&belief), &step(Some(Reading { value, extra_variance })), &prediction) / unit
            };
            let variance = of_double.noise().reading_sd.powi(2) + f64::from(f32::EPSILON).powi(2);
            let coarser = std::iter::successors(Some(0.0), |noise| Some(16.0 * (noise + variance))).take(13);
            let (tries, least) = coarser.map(apart).enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            repeated += usize::from(tries > 0 && apart(0.0) > ROUNDING);
            most = most.max(least);
        }
    }
    assert!(repeated > 0);
    assert!(most < ROUNDING, "{most:e}");
}

/// Models, and how quiet they are: enough to meet such readings.
const MODELS: usize = 400;
const QUIET: f64 = 1e-5;
/// Some thirty operations of a step, one after the other, on sums of up to ten terms.
const ROUNDING: f64 = 300.0;

/// Filters of hypotheses take precise readings, too, however quiet the model: after cuts at rate zero and merging, rounded correlations
/// exceed one, and no noise of a reading mends that.
#[test]
fn mixtures_take_precise_readings_too() {
    for quiet in [1.0, 3e-2, 1e-2, 1e-3, 1e-4] {
        let mut draws = Draws(1);
        let (mut refused, mut steps) = ([0; 3], 0);
        for _ in 0..MODELS / 2 {
            let (model, dt_s) = random_model::<f32>(&mut draws, quiet);
            let evidence = Evidence { limits: StrainRange { lower: -1.0, upper: 2.0 }, tempering: 1.0 };
            let dwell = Dwell::new(2.0, 2.0, 0.3).unwrap();
            let start: Belief<f32, 5, 15> = Belief::initial(&model);
            let split = SignSplit::<f32, 2, 5, 4>::new(model, dt_s, None, evidence).unwrap();
            let histories = Hypotheses::<f32, 2, 5, 4>::new(model, dt_s, dwell, evidence).unwrap();
            let imm = Imm::<f32, 2, 5>::new(model, dt_s, dwell, evidence).unwrap();
            let mut phases = PhaseMixture::<f32, 5, 15>::single(start, Phase::Hold);
            let mut signs = Mixture::<f32, 5, 15, 4>::single(start, Phase::Extend);
            let mut known = Mixture::<f32, 5, 15, 4>::single(start, Phase::Hold);
            for k in 0..200 {
                let strain = 0.15 + 0.1 * (0.7 * dt_s * k as f32).sin();
                let reading = Some(Reading::from(model.law().gauge_value_and_slope(strain).0)).filter(|_| k % 7 > 0);
                refused[0] += u32::from(split.step(&mut signs, reading).is_err());
                refused[1] += u32::from(histories.step(&mut known, reading).is_err());
                refused[2] += u32::from(imm.step(&mut phases, reading).is_err());
                steps += 1;
            }
        }
        assert_eq!(refused, [0; 3], "quiet {quiet}, of {steps}");
    }
}

/// However often a step is tried again from smaller correlations: one that is refused in the end leaves the state as it was.
#[test]
fn what_is_refused_every_time_leaves_the_state() {
    let model = model::<f32>(RISING);
    let mut start: Belief<f32, 4, 10> = Belief::initial(&model);
    for i in 0..4 {
        for j in 0..=i {
            // The strain's variance overflows over the step, whatever correlations there are.
            start.covariance[(i, j)] = if i == j { f32::MAX } else { 0.5 * f32::MAX };
        }
    }
    let dwell = Dwell::new(2.0, 2.0, 0.3).unwrap();
    let imm = Imm::<f32, 1, 4>::new(model, DT_S as f32, dwell, evidence()).unwrap();
    let phases = PhaseMixture::<f32, 4, 10>::single(start, Phase::Extend);
    let mut phases_after = phases;
    assert!(imm.step(&mut phases_after, None).is_err());
    assert_eq!(phases_after, phases);
    let mixture = Mixture::<f32, 4, 10, 8>::single(start, Phase::Extend);
    let mut after = mixture;
    assert!(split::<f32>().step(&mut after, None).is_err());
    assert_eq!(after, mixture);
    let histories = Hypotheses::<f32, 1, 4, 8>::new(model, DT_S as f32, dwell, evidence()).unwrap();
    assert!(histories.step(&mut after, None).is_err());
    assert_eq!(after, mixture);
}

#[test]
fn what_limits_say_is_no_evidence_of_a_reading() {
    let model = model::<f64>(RISING);
    let inside =
        |limits| Hypotheses::<_, 1, 4, 16>::new(model, DT_S, dwell(), Evidence { limits, tempering: 1.0 }).unwrap();
    // The start is wider than the limits.
    let start = Mixture::single(Belief::<f64, 4, 10>::initial(&model), Phase::Hold);
    let (narrow, wide) = (StrainRange { lower: 0.1, upper: 0.2 }, StrainRange { lower: -1e3, upper: 1e3 });
    let reading = Some(Reading::from(0.3));
    let step = |limits| inside(limits).step(&mut start.clone(), reading).unwrap().unwrap().log_likelihood();
    let (near, far) = (step(narrow), step(wide));
    assert!((near - far).abs() < 1e-12, "{near} {far}");
    // Nor does it matter how many hypotheses there is room for afterwards.
    let few = Hypotheses::<_, 1, 4, 2>::new(model, DT_S, dwell(), Evidence { limits: wide, tempering: 1.0 }).unwrap();
    let mut start = Mixture::single(Belief::<f64, 4, 10>::initial(&model), Phase::Hold);
    let crowded = few.step(&mut start, reading).unwrap().unwrap().log_likelihood();
    assert!((crowded - far).abs() < 1e-12, "{crowded} {far}");
}

fn dwell() -> Dwell<f64> {
    Dwell::new(0.05, 0.05, 0.3).unwrap()
}

#[test]
fn exactly_known_values_lie_on_one_side() {
    assert_eq!(Gaussian { mean: 2.0_f64, variance: 0.0 }.probability_above(1.0), 1.0);
    assert_eq!(Gaussian { mean: 2.0_f64, variance: 4.0 }.probability_above(2.0), 0.5);
}

#[test]
fn a_chain_that_never_moves_stays() {
    for dwell in [Dwell::new(f64::INFINITY, 1.0, 1.0).unwrap(), Dwell::new(f64::INFINITY, f64::INFINITY, 0.3).unwrap()]
    {
        let chain = dwell.probabilities(0.1);
        for row in chain {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-15, "{chain:?}");
        }
        assert_eq!(chain[1], [0.0, 1.0, 0.0]);
    }
}

#[test]
fn parameters_without_meaning_are_refused() {
    let limits = StrainRange { lower: 0.0, upper: 0.3 };
    for tempering in [f64::NAN, -0.1, 1.1] {
        assert!(Evidence::new(limits, tempering).is_err());
    }
    assert!(Evidence::new(StrainRange { lower: 0.3, upper: 0.0 }, 1.0).is_err());
    assert!(Evidence::new(limits, 0.5).is_ok());
    for parameter in [f64::NAN, 0.0, -1.0] {
        assert!(Guard::none().with_gate(parameter, 3).is_err());
        assert!(Guard::none().with_influence(Influence::Huber { threshold: parameter }).is_err());
        assert!(Guard::none().with_influence(Influence::StudentT { degrees_of_freedom: parameter }).is_err());
    }
}

/// Readings beyond the range of the numbers are rejected like any other outlier, without a gate too, and the step is a prediction.
#[test]
fn no_reading_ends_a_run() {
    let model = model::<f64>(RISING);
    let ekf = Ekf::new(model);
    let prepared = Estimator::<f64, 4, 10>::prepare(&ekf, DT_S);
    let start: Belief<f64, 4, 10> = Belief::initial(&model);
    let ahead = Estimator::advance(&ekf, &start, &prepared, None).unwrap().state;
    for guard in [Guard::none(), Guard::none().with_gate(10.8, 0).unwrap()] {
        for far in [1e200, -1e300] {
            let taken = guard.advance(&ekf, &start, Streak::default(), &prepared, Some(Reading::from(far))).unwrap();
            assert_eq!((taken.verdict, taken.advanced.state), (ReadingVerdict::Rejected, ahead));
        }
    }
}
