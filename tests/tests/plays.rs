//! Filters of a sensor with hysteresis that does not relax: what a play remembers travels with each hypothesis.

use nalgebra::SVector;
use ohmstrain_ekf::{
    Belief, Channel, Dwell, Dynamics, Ekf, Estimate, Estimator, Evidence, Hypotheses, Imm, Mixture, Reading, SignSplit,
    Unscented, rts_smooth_vec,
};
use ohmstrain_model::{
    Gauge, ModelNoise, Motion, Phase, Play, Scalar, SensorLaw, StrainRange, SwitchedModel, WithPlays,
};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const DT_S: f64 = 0.1;
const STEPS: usize = 1500;
const RUNS: u64 = 8;
const READING_SD: f64 = 2e-3;
const PLAYS: [(f64, f64); 2] = [(0.02, 0.7), (0.05, 0.5)];
const GAUGE: [f64; 3] = [1.6, -0.8, 0.0];
const RATE_TIME_S: f64 = 2.0;
const RATE_SD: f64 = 0.04;
const STRAIN: (f64, f64) = (0.15, 0.08);

type Inner<T> = SwitchedModel<T, 2, 0, 2>;
type Model<T> = WithPlays<T, 2, 0, 2, 2, 4>;
type Known = Belief<f64, 4, 10>;

fn inner<T: Scalar>(reading_sd: f64) -> Inner<T> {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: GAUGE.map(T::of) },
        extend_viscosity_s: T::zero(),
        retract_viscosity_s: T::zero(),
        branches: [],
        range: StrainRange { lower: T::of(-0.3), upper: T::of(0.6) },
    };
    let [time_s, rate_sd, mean, sd] = [RATE_TIME_S, RATE_SD, STRAIN.0, STRAIN.1].map(T::of);
    let motion = Motion::ornstein_uhlenbeck(time_s, rate_sd, mean, sd).unwrap();
    let noise = ModelNoise {
        reading_sd: T::of(reading_sd),
        branch_sd: T::zero(),
        baseline_sd: T::zero(),
        baseline_time_s: T::one(),
    };
    SwitchedModel::new(law, motion, noise).unwrap()
}

fn model<T: Scalar>() -> Model<T> {
    let plays = PLAYS.map(|(half_width, weight)| Play { half_width: T::of(half_width), weight: T::of(weight) });
    WithPlays::new(inner(READING_SD), plays).unwrap()
}

/// One row of a simulated recording.
struct Row {
    reading: f64,
    /// Strain, rate and the lags of the plays.
    state: SVector<f64, 4>,
}

/// Motion in 50 Euler steps per reading, plays `p = clamp(p, ε - r, ε + r)` at every one of them.
fn simulate(seed: u64) -> Vec<Row> {
    const SUBSTEPS: usize = 50;
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let h = DT_S / SUBSTEPS as f64;
    let (mut strain, mut rate) = (STRAIN.0 + STRAIN.1 * normal(), RATE_SD * normal());
    let mut plays = [strain; 2];
    let mut rows = Vec::new();
    for _ in 0..STEPS {
        for _ in 0..SUBSTEPS {
            let pull = -rate / RATE_TIME_S - (RATE_SD / STRAIN.1).powi(2) * (strain - STRAIN.0);
            rate += h * pull + RATE_SD * (2.0 * h / RATE_TIME_S).sqrt() * normal();
            strain += h * rate;
            for (play, (half_width, _)) in plays.iter_mut().zip(PLAYS) {
                *play = play.clamp(strain - half_width, strain + half_width);
            }
        }
        let hysteresis: f64 = plays.iter().zip(PLAYS).map(|(play, (_, weight))| weight * (play - strain)).sum();
        let [a, b, c] = GAUGE;
        let gauge = a * strain + b * strain.powi(2) + c * strain.powi(3);
        let state = SVector::from([strain, rate, plays[0] - strain, plays[1] - strain]);
        rows.push(Row { reading: gauge + hysteresis + READING_SD * normal(), state });
    }
    rows
}

fn root_mean_square(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Errors of the strain, whether they are within 1.96 of the filter's deviations, and the NIS, row by row.
fn run<M, const N: usize, const L: usize>(model: M, start: Belief<f64, N, L>, rows: &[Row]) -> [Vec<f64>; 3]
where
    M: Dynamics<f64, N, L> + Channel<f64, N, L>,
{
    let ekf = Ekf::new(model);
    let (mut belief, mut out) = (start, [vec![], vec![], vec![]]);
    for row in rows {
        let step = ekf.step(&belief, DT_S, Some(Reading::from(row.reading))).unwrap();
        belief = step.posterior;
        let error = belief.mean[0] - row.state[0];
        out[0].push(error);
        out[1].push(f64::from(u8::from(error.abs() < 1.96 * belief.covariance[(0, 0)].sqrt())));
        out[2].push(step.update.unwrap().nis);
    }
    out
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn a_filter_that_knows_the_plays_does_better_and_knows_how_well() {
    let (mut with, mut without, mut covered, mut nis) = (vec![], vec![], vec![], vec![]);
    for seed in 0..RUNS {
        let rows = simulate(seed);
        let start = Known::initial(&model());
        let [errors, inside, surprise] = run(model::<f64>(), start, &rows);
        let unscented = run(Unscented::new(model::<f64>()), start, &rows)[0].clone();
        with.push([errors, unscented]);
        covered.extend(inside);
        nis.extend(surprise);
        // The fair rival counts hysteresis as noise of the reading, of the size that it has.
        let hysteresis: Vec<f64> =
            rows.iter().map(|row| PLAYS[0].1 * row.state[2] + PLAYS[1].1 * row.state[3]).collect();
        let rival = inner::<f64>(READING_SD.hypot(root_mean_square(&hysteresis)));
        without.extend(run(rival, Belief::<f64, 2, 3>::initial(&rival), &rows)[0].clone());
    }
    let without = root_mean_square(&without);
    for estimator in 0..2 {
        let errors: Vec<f64> = with.iter().flat_map(|run| run[estimator].clone()).collect();
        // Measured: 0.0054 and 0.0250. Half is what a filter would gain that knew only one of two equal loops.
        assert!(root_mean_square(&errors) < 0.5 * without, "{} {without}", root_mean_square(&errors));
    }
    // NIS of a filter that is right are independent χ² with one degree of freedom; their mean at 99.9 %.
    let bound = 3.2905 * (2.0 / nis.len() as f64).sqrt();
    assert!((mean(&nis) - 1.0).abs() < bound, "{} ± {bound}", mean(&nis));
    // Errors of the strain are correlated over about the rate's time, so there are so many independent ones.
    let independent = RUNS as f64 * STEPS as f64 * DT_S / (2.0 * RATE_TIME_S);
    let share = mean(&covered);
    assert!((share - 0.95).abs() < 3.2905 * (0.95 * 0.05 / independent).sqrt(), "{share}");
}

/// The same filter in `f32` says the same, to a tenth of its own deviation (and to 1e-6 where that is zero: a dragged lag).
#[test]
fn single_precision_is_enough() {
    let (double, single) = (Ekf::new(model::<f64>()), Ekf::new(model::<f32>()));
    let mut belief = Known::initial(&model());
    let mut other: Belief<f32, 4, 10> = Belief::initial(&model::<f32>());
    for row in simulate(0) {
        belief = double.step(&belief, DT_S, Some(Reading::from(row.reading))).unwrap().posterior;
        other = single.step(&other, DT_S as f32, Some(Reading::from(row.reading as f32))).unwrap().posterior;
        for i in 0..4 {
            let sd = belief.covariance[(i, i)].sqrt();
            assert!((f64::from(other.mean[i]) - belief.mean[i]).abs() < 0.1 * sd + 1e-6, "{i}: {belief:?} {other:?}");
            assert!(other.covariance[(i, i)] >= 0.0);
        }
    }
}

/// From a rest in the middle of the loops, without a reading that could tell, a hypothesis that stretches remembers a
/// strain that has risen, and one that releases the opposite.
fn check_memories<E, const K: usize>(estimator: &E)
where
    E: Estimator<f64, 4, 10, State = Mixture<f64, 4, 10, K>>,
{
    let start = Known::independent(SVector::from([STRAIN.0, 0.0, 0.0, 0.0]), &[1e-6, RATE_SD.powi(2), 0.0, 0.0]);
    let mut mixture = Mixture::single(start, Phase::Hold);
    let prepared = estimator.prepare(DT_S);
    let mut before = mixture;
    for _ in 0..6 {
        before = mixture;
        mixture = estimator.advance(&mixture, &prepared, None).unwrap().state;
    }
    let lag = |phase: Phase| {
        let of_phase: Vec<_> = mixture.components().iter().filter(|component| component.phase == phase).collect();
        let weight: f64 = of_phase.iter().map(|component| component.log_weight.exp()).sum();
        assert!(weight > 0.0, "{phase:?} is not followed");
        of_phase.iter().map(|component| component.log_weight.exp() * component.belief.mean[2]).sum::<f64>() / weight
    };
    let (stretched, released) = (lag(Phase::Extend), lag(Phase::Retract));
    // Half a second at the mean speed of |v|, 0.03/s, is 0.016 of the slack of 0.02; a third of the slack leaves room for
    // those that have turned around.
    assert!(stretched < -PLAYS[0].0 / 3.0 && released > PLAYS[0].0 / 3.0, "{stretched} {released}");
    // And the smoother takes it back: a step without a reading says nothing new of the state before.
    let smoothed = estimator.smooth_back(&before, &prepared, None, &mixture).unwrap().unwrap();
    assert!((smoothed.moments().mean - before.moments().mean).amax() < 1e-2 * PLAYS[0].0);
}

#[test]
fn every_hypothesis_has_a_memory_of_its_own() {
    let evidence = Evidence { limits: StrainRange { lower: -1.0, upper: 1.0 }, tempering: 1.0 };
    let dwell = Dwell::new(0.5, 2.0, 0.2).unwrap();
    check_memories(&SignSplit::<f64, _, 8>::new(model::<f64>(), None, evidence));
    check_memories(&SignSplit::<f64, _, 8>::new(model::<f64>(), Some(dwell), evidence));
    check_memories(&Hypotheses::<f64, _, 16>::new(model::<f64>(), dwell, evidence));
    check_memories(&Imm::new(model::<f64>(), dwell, evidence));
}

#[test]
fn the_smoother_finds_strain_and_lags_better_than_the_filter() {
    let (mut filtered, mut smoothed) = ([vec![], vec![], vec![]], [vec![], vec![], vec![]]);
    for seed in 0..RUNS {
        let ekf = Ekf::new(model::<f64>());
        let rows = simulate(seed);
        let start = Known::initial(ekf.model());
        let mut belief = start;
        let mut steps = Vec::new();
        for row in &rows {
            let step = ekf.step(&belief, DT_S, Some(Reading::from(row.reading))).unwrap();
            belief = step.posterior;
            steps.push(step);
        }
        let better = rts_smooth_vec(&steps);
        for ((row, step), better) in rows.iter().zip(&steps).zip(&better) {
            for (place, i) in [0, 2, 3].into_iter().enumerate() {
                filtered[place].push(step.posterior.mean[i] - row.state[i]);
                smoothed[place].push(better.mean[i] - row.state[i]);
            }
        }
    }
    for (filtered, smoothed) in filtered.iter().zip(&smoothed) {
        let (filtered, smoothed) = (root_mean_square(filtered), root_mean_square(smoothed));
        assert!(smoothed < filtered, "{smoothed} {filtered}");
    }
}

/// A state that goes on with lags has no baseline there, and a reading at rest keeps what the plays have kept.
#[test]
fn an_estimate_does_not_take_a_lag_for_a_baseline() {
    let (strain, lags) = (0.1, [-0.02, 0.03]);
    let mut belief = Known::independent(SVector::from([strain, 0.0, lags[0], lags[1]]), &[1e-4, 1e-4, 2e-5, 3e-5]);
    belief.covariance[(2, 0)] = -1e-5;
    let limits = StrainRange { lower: -1.0, upper: 1.0 };
    let estimate = Estimate::new(&model::<f64>(), &belief, &limits, 1.0);
    let (gauge, slope) = (GAUGE[0] * strain + GAUGE[1] * strain * strain, GAUGE[0] + 2.0 * GAUGE[1] * strain);
    let [w, u] = [PLAYS[0].1, PLAYS[1].1];
    let variance = slope * slope * 1e-4 + 2.0 * slope * w * -1e-5 + w * w * 2e-5 + u * u * 3e-5;
    assert_eq!((estimate.baseline, estimate.relaxation.mean), (0.0, 0.0));
    assert!((estimate.settled.mean - (gauge + w * lags[0] + u * lags[1])).abs() < 1e-12);
    assert!((estimate.settled.variance - variance).abs() < 1e-12);
}
