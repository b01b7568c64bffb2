//! The filter with a frozen gain against Riccati's equation, the full filter, and what freezing costs a sensor.

use nalgebra::{Cholesky, SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, FixedGain, FixedGainState, FixedGainStep, Reading, StepError};
use ohmstrain_model::{Direction, Phase};
use ohmstrain_tests::{Linear, sensor};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const DT_S: f64 = 0.1;

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Runs until the gain is frozen; returns the state and the number of readings that took.
fn settle<M, P: Copy, const N: usize, const L: usize>(
    filter: &FixedGain<M, f64, P>,
    start: Belief<f64, N, L>,
) -> (FixedGainState<f64, N, L>, usize)
where
    M: Dynamics<f64, N, L, Prepared = P> + Channel<f64, N, L>,
{
    let mut state = FixedGainState::from(start);
    for count in 0..10_000 {
        if state.is_frozen() {
            return (state, count);
        }
        let reading = Reading::from((count as f64 * 0.3).sin());
        state = filter.step(&state, DT_S, Some(reading)).unwrap().next;
    }
    panic!("the gain has not settled");
}

fn next<M, P: Copy, const N: usize, const L: usize>(
    filter: &FixedGain<M, f64, P>,
    state: &FixedGainState<f64, N, L>,
    y: f64,
) -> FixedGainStep<f64, N, L>
where
    M: Dynamics<f64, N, L, Prepared = P> + Channel<f64, N, L>,
{
    filter.step(state, DT_S, Some(Reading::from(y))).unwrap()
}

/// The local level has its limit in closed form: P = (Q + √(Q² + 4 Q R))/2 and K = P/(P + R).
#[test]
fn the_local_level_settles_at_its_closed_form() {
    for (q, r) in [(1.0, 1.0), (1e-4, 1.0), (4.0, 0.01)] {
        let model = Linear { transition: matrix![1.0], noise: matrix![q], gradient: vector![1.0], variance: r };
        for tolerance in [1e-2, 1e-5, 1e-9] {
            let filter = FixedGain::new::<1, 1>(model, DT_S, tolerance).unwrap();
            let (state, _) = settle(&filter, Belief::<f64, 1, 1>::independent(vector![0.0], &[100.0]));
            let step = next(&filter, &state, 0.5);
            let p = (q + f64::sqrt(q * q + 4.0 * q * r)) / 2.0;
            let (gain, s) = (p / (p + r), p + r);
            assert!(step.frozen);
            let off = (step.step.update.unwrap().gain[0] - gain).abs() / (p / s).sqrt();
            // K = P/(P + R) moves less than in proportion to P, whose distance from the limit is extrapolated with the
            // ratio of today. From a wide start that ratio still grows, towards (1 - K)²: short of the truth, but after
            // five close steps by less than the whole.
            assert!(off <= 2.0 * tolerance, "Q {q}, R {r}, tolerance {tolerance}: {off}");
        }
    }
}

/// Prior covariance and gain in the limit, by iterating Riccati's equation in its textbook form.
fn riccati<const N: usize>(model: &Linear<f64, N>) -> (SMatrix<f64, N, N>, SVector<f64, N>) {
    let (f, h) = (model.transition, model.gradient);
    let mut p = model.noise;
    for _ in 0..20_000 {
        let s = (h.transpose() * p * h)[0] + model.variance;
        p = f * (p - p * h * h.transpose() * p / s) * f.transpose() + model.noise;
    }
    (p, p * h / ((h.transpose() * p * h)[0] + model.variance))
}

fn check_against_riccati<const N: usize, const L: usize>(model: Linear<f64, N>) {
    let (p, gain) = riccati(&model);
    let s = (model.gradient.transpose() * p * model.gradient)[0] + model.variance;
    let tolerance = 1e-8;
    let filter = FixedGain::new::<N, L>(model, DT_S, tolerance).unwrap();
    let (state, _) = settle(&filter, Belief::<f64, N, L>::independent(SVector::zeros(), &[1.0; N]));
    let step = next(&filter, &state, 1.0).step;
    for i in 0..N {
        let off = (step.update.unwrap().gain[i] - gain[i]).abs() / (p[(i, i)] / s).sqrt();
        assert!(off <= 2.0 * tolerance, "gain {i} of {N}: {off}");
        // The covariance converges as fast as the gain; of a direction that is hardly seen it is the larger number.
        let off = (step.prior.covariance[(i, i)] / p[(i, i)] - 1.0).abs();
        assert!(off <= 100.0 * tolerance, "variance {i} of {N}: {off}");
    }
}

/// Position and velocity (the alpha-beta filter), and three coupled states.
#[test]
fn gain_and_covariance_solve_riccatis_equation() {
    check_against_riccati::<2, 3>(Linear {
        transition: matrix![1.0, 0.1; 0.0, 1.0],
        noise: matrix![1e-3 / 3.0, 5e-3; 5e-3, 0.1],
        gradient: vector![1.0, 0.0],
        variance: 0.2,
    });
    check_against_riccati::<3, 6>(coupled());
}

fn coupled() -> Linear<f64, 3> {
    Linear {
        transition: matrix![0.97, 0.09, 0.0; -0.2, 0.85, 0.0; 0.03, 0.08, 0.9],
        noise: matrix![0.02, 0.01, 0.005; 0.01, 0.08, 0.01; 0.005, 0.01, 0.03],
        gradient: vector![1.4, 0.2, 1.0],
        variance: 0.05,
    }
}

/// On a linear model the mean stays as close to the full filter's as the gain is. The difference e of both means goes on
/// as `e' = (I - K H) F e + ΔK ν`; the sum of the powers of that matrix, a number of the model, times the largest ΔK ν
/// bounds it.
#[test]
fn after_convergence_it_is_the_full_filter() {
    let model = coupled();
    let (p, gain) = riccati(&model);
    let s = (model.gradient.transpose() * p * model.gradient)[0] + model.variance;
    let closed = (SMatrix::identity() - gain * model.gradient.transpose()) * model.transition;
    let (mut power, mut sum) = (SMatrix::<f64, 3, 3>::identity(), 0.0);
    for _ in 0..2000 {
        sum += power.norm();
        power *= closed;
    }
    for tolerance in [1e-2, 1e-6, 1e-10] {
        let filter = FixedGain::new::<3, 6>(model, DT_S, tolerance).unwrap();
        let ekf = Ekf::new(model);
        let mut rng = ChaCha12Rng::seed_from_u64(1);
        let mut belief = Belief::<f64, 3, 6>::independent(SVector::zeros(), &[1.0; 3]);
        let mut state = FixedGainState::from(belief);
        let (mut largest, mut off, mut frozen) = (0.0_f64, 0.0_f64, 0);
        for _ in 0..2000 {
            let y = Some(Reading::from(normal(&mut rng)));
            let full = ekf.step(&belief, DT_S, y).unwrap();
            let step = filter.step(&state, DT_S, y).unwrap();
            largest = largest.max(full.update.unwrap().innovation.abs());
            off = off.max((full.posterior.mean - step.step.posterior.mean).norm());
            frozen += usize::from(step.frozen);
            assert!(step.frozen || full == step.step);
            (belief, state) = (full.posterior, step.next);
        }
        let size = SVector::<f64, 3>::from_fn(|i, _| (p[(i, i)] / s).sqrt()).norm();
        // Twice the tolerance as above, and rounding.
        let bound = 2.0 * tolerance * size * largest * sum + 1e-13;
        assert!(frozen > 1800 && off <= bound, "{tolerance}: {frozen} frozen, {off} vs {bound}");
        assert!(off > 0.0);
    }
}

/// After anything out of the ordinary the full filter goes on from the frozen covariance, and freezes again.
#[test]
fn a_gap_falls_back_to_the_full_filter() {
    let model = coupled();
    let filter = FixedGain::new::<3, 6>(model, DT_S, 1e-6).unwrap();
    let (state, _) = settle(&filter, Belief::<f64, 3, 6>::independent(SVector::zeros(), &[1.0; 3]));
    let other_variance = Reading { value: 0.4, extra_variance: 0.3 };
    let ordinary = Some(Reading::from(0.4));
    for (dt_s, reading) in [(DT_S, None), (0.25, ordinary), (0.0, ordinary), (DT_S, Some(other_variance))] {
        let gap = filter.step(&state, dt_s, reading).unwrap();
        assert!(!gap.frozen && !gap.next.is_frozen());
        let ekf = Ekf::new(model);
        assert_eq!(gap.step, ekf.step(state.belief(), dt_s, reading).unwrap());
        let (mut state, mut count) = (gap.next, 0);
        while !state.is_frozen() {
            let full = ekf.step(state.belief(), DT_S, ordinary).unwrap();
            let step = next(&filter, &state, 0.4);
            assert_eq!(step.step, full);
            (state, count) = (step.next, count + 1);
        }
        // A covariance, a change, and five more changes to compare with the one before.
        assert!((7..200).contains(&count), "{count}");
        assert!(next(&filter, &state, 0.4).frozen);
    }
    // Jitter within the tolerance is none.
    assert!(filter.step(&state, DT_S * (1.0 + 5e-7), ordinary).unwrap().frozen);
    assert!(!filter.step(&state, DT_S * (1.0 + 2e-6), ordinary).unwrap().frozen);
}

#[test]
fn errors_leave_the_state_as_it_was() {
    let filter = FixedGain::new::<3, 6>(coupled(), DT_S, 1e-6).unwrap();
    let start = Belief::<f64, 3, 6>::independent(SVector::zeros(), &[1.0; 3]);
    for state in [FixedGainState::from(start), settle(&filter, start).0] {
        let before = state;
        let refused = |dt_s: f64, y: f64| filter.step(&state, dt_s, Some(Reading::from(y))).unwrap_err();
        assert_eq!(refused(-0.1, 0.0), StepError::NegativeTimeStep);
        assert_eq!(refused(f64::NAN, 0.0), StepError::NonFiniteTimeStep);
        assert_eq!(refused(DT_S, f64::NAN), StepError::NonFiniteReading);
        assert_eq!(refused(DT_S, 1e300), StepError::NonFiniteState);
        let extra = Reading { value: 0.0, extra_variance: f64::NAN };
        assert_eq!(filter.step(&state, DT_S, Some(extra)).unwrap_err(), StepError::NonFiniteReading);
        assert_eq!(state, before);
    }
    assert!(FixedGain::new::<3, 6>(coupled(), 0.0, 1e-6).is_err());
    assert!(FixedGain::new::<3, 6>(coupled(), f64::INFINITY, 1e-6).is_err());
    assert!(FixedGain::new::<3, 6>(coupled(), DT_S, 1.0).is_err());
    assert!(FixedGain::new::<3, 6>(coupled(), DT_S, f64::NAN).is_err());
}

/// In `f32` changes end in rounding; that is a limit too.
#[test]
fn it_settles_in_f32() {
    let model = Linear {
        transition: matrix![1.0_f32, 0.01; 0.0, 0.999],
        noise: matrix![1e-7, 0.0; 0.0, 1e-3],
        gradient: vector![1.5, 0.0],
        variance: 0.01,
    };
    let filter = FixedGain::new::<2, 3>(model, 0.01, 1e-6).unwrap();
    let mut state = FixedGainState::from(Belief::<f32, 2, 3>::independent(SVector::zeros(), &[1.0; 2]));
    let settled = (0..5000).position(|_| {
        state = filter.step(&state, 0.01, Some(Reading::from(0.1))).unwrap().next;
        state.is_frozen()
    });
    assert!(settled.is_some());
}

/// Three minutes of the two-branch sensor at 20 Hz, drawn from its own law and prior. Strain and reading.
fn recording(seed: u64) -> Vec<(f64, f64)> {
    let model = sensor::<f64, 2, 5>();
    let prepared = model.prepare(0.05);
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let (mut state, _) = model.initial_distribution();
    (0..3600)
        .map(|_| {
            let direction = Direction::Known(if state[1] > 0.0 { Phase::Extend } else { Phase::Retract });
            let transition = model.transition::<15>(&prepared, &state, direction);
            let root = Cholesky::new(transition.noise.to_matrix()).unwrap().l();
            state = transition.mean + root * SVector::from_fn(|_, _| normal(&mut rng));
            let direction = Direction::Known(if state[1] > 0.0 { Phase::Extend } else { Phase::Retract });
            let reading = model.observe(&state, direction);
            (state[0], reading.value + reading.variance.sqrt() * normal(&mut rng))
        })
        .collect()
}

/// RMSE of strain and share of rows within 1.96 reported deviations.
fn score(errors: &[(f64, f64)]) -> (f64, f64) {
    let count = errors.len() as f64;
    let rmse = (errors.iter().map(|(error, _)| error * error).sum::<f64>() / count).sqrt();
    (rmse, errors.iter().filter(|(error, sd)| error.abs() <= 1.96 * sd).count() as f64 / count)
}

/// The figures in the module's documentation.
#[test]
fn what_freezing_costs_a_sensor() {
    let model = sensor::<f64, 2, 5>();
    let ekf = Ekf::new(model);
    let recordings: Vec<_> = (0..20).map(recording).collect();
    let mut full = Vec::new();
    for rows in &recordings {
        let mut belief: Belief<f64, 5, 15> = Belief::initial(&model);
        for (strain, y) in rows {
            belief = ekf.step(&belief, 0.05, Some(Reading::from(*y))).unwrap().posterior;
            full.push(error(&belief, *strain));
        }
    }
    assert_figures(score(&full), (0.0268, 0.749));
    for (tolerance, share, rmse, coverage) in
        [(0.03, 0.01, 0.0268, 0.747), (0.1, 0.55, 0.0346, 0.710), (0.2, 0.84, 0.0463, 0.589)]
    {
        let (errors, frozen) = with_frozen_gain(tolerance, &recordings);
        assert_figures(score(&errors), (rmse, coverage));
        assert!((frozen - share).abs() < 0.02, "tolerance {tolerance}: {frozen}");
    }
    // Any gain will do: the branches drift away.
    assert!(score(&with_frozen_gain(0.5, &recordings).0).0 > 0.1);
}

/// Sums over 72 000 rows are the same on every machine but for rounding, which a filter that loses its direction may
/// amplify at single steps.
fn assert_figures(got: (f64, f64), expected: (f64, f64)) {
    assert!((got.0 / expected.0 - 1.0).abs() < 0.02 && (got.1 - expected.1).abs() < 0.01, "{got:?}");
}

/// Errors and their deviations, and the share of steps with a frozen gain.
fn with_frozen_gain(tolerance: f64, recordings: &[Vec<(f64, f64)>]) -> (Vec<(f64, f64)>, f64) {
    let model = sensor::<f64, 2, 5>();
    let filter = FixedGain::new::<5, 15>(model, 0.05, tolerance).unwrap();
    let (mut errors, mut frozen) = (Vec::new(), 0);
    for rows in recordings {
        let mut state = FixedGainState::from(Belief::<f64, 5, 15>::initial(&model));
        for (strain, y) in rows {
            let step = filter.step(&state, 0.05, Some(Reading::from(*y))).unwrap();
            frozen += usize::from(step.frozen);
            state = step.next;
            errors.push(error(state.belief(), *strain));
        }
    }
    let share = frozen as f64 / errors.len() as f64;
    (errors, share)
}

fn error(belief: &Belief<f64, 5, 15>, strain: f64) -> (f64, f64) {
    (belief.mean[0] - strain, belief.covariance[(0, 0)].sqrt())
}
