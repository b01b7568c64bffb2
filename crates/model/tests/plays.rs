//! Plays against a play operator written down as in books, finite differences, and quadrature of the clamp.

use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, ParameterError, Phase, Play, Scalar, SensorLaw, StrainRange,
    SwitchedModel, Symmetric, Transition, WithPlays,
};
use proptest::prelude::*;

const UNCERTAIN: Direction<f64> = Direction::Uncertain { rate_sd: 0.03 };
const HALF_WIDTHS: [f64; 2] = [0.01, 0.04];
const WEIGHTS: [f64; 2] = [0.6, -0.3];

type Model<T> = WithPlays<T, 2, 1, 4, 2, 6>;

fn model<T: Scalar>(rate_sd: f64) -> Model<T> {
    let of = |x: f64| T::of(x);
    let branch = Branch {
        tau_s: of(5.0),
        extend_gain: of(0.8),
        retract_gain: of(-0.5),
        extend_gain_slope: of(-0.6),
        retract_gain_slope: of(0.4),
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [of(1.6), of(-1.2), of(0.5)] },
        extend_viscosity_s: of(0.02),
        retract_viscosity_s: of(-0.01),
        branches: [branch],
        range: StrainRange { lower: of(-0.5), upper: of(0.5) },
    };
    let motion = Motion::ornstein_uhlenbeck(of(1.5), of(rate_sd), of(0.15), of(0.1)).unwrap();
    let noise =
        ModelNoise { reading_sd: of(2e-3), branch_sd: of(5e-3), baseline_sd: of(0.02), baseline_time_s: of(30.0) };
    let play = |i: usize| Play { half_width: of(HALF_WIDTHS[i]), weight: of(WEIGHTS[i]) };
    WithPlays::new(SwitchedModel::new(law, motion, noise).unwrap(), [play(0), play(1)]).unwrap()
}

/// Rates that turn around often enough for small and large loops: two sines of incommensurate periods.
fn rate(k: usize) -> f64 {
    let t = k as f64 * 0.1;
    0.05 * (0.9 * t).sin() + 0.04 * (2.3 * t).cos()
}

/// The largest difference between the model's lags and plays that drag behind the model's own strain, over 600 steps of
/// known motion.
fn against_plays_of_books<T: Scalar>(rate_sd: f64) -> T {
    let model = model::<T>(rate_sd);
    let step = model.inner().prepare(T::of(0.1));
    let mut state = SVector::<T, 6>::zeros();
    let mut plays = [T::zero(); 2];
    let mut worst = T::zero();
    for k in 0..600 {
        state[1] = T::of(rate(k));
        let direction = if rate(k) > 0.0 { Phase::Extend } else { Phase::Retract };
        let next: Transition<T, 6, 21> =
            model.transition(&step, &state, &Symmetric::zeros(), Direction::Known(direction));
        state = next.mean;
        let mut reading = model.inner().observe(&SVector::from_fn(|i, _| state[i]), Direction::Known(direction)).value;
        for i in 0..2 {
            let half_width = T::of(HALF_WIDTHS[i]);
            plays[i] = plays[i].max(state[0] - half_width).min(state[0] + half_width);
            worst = worst.max((plays[i] - state[0] - state[4 + i]).abs());
            reading += T::of(WEIGHTS[i]) * (plays[i] - state[0]);
        }
        worst = worst.max((reading - model.observe(&state, Direction::Known(direction)).value).abs());
    }
    worst
}

/// What chance there is left in a step rounds a corner by at most 0.41 of its deviation (ln 2 / 1.702), here below
/// 1e-10; an `f32` near 0.5 is rounded by 3e-8 in each of 600 steps and never forgotten while a play rests.
#[test]
fn on_known_motion_they_are_play_operators() {
    assert!(against_plays_of_books::<f64>(1e-9) < 1e-9);
    assert!(against_plays_of_books::<f32>(1e-9) < 600.0 * 3e-8);
}

#[test]
fn in_a_hold_nothing_moves() {
    let model = model::<f64>(0.05);
    let state = SVector::from([0.1, 0.02, 0.01, 0.0, 0.009, -0.04]);
    let covariance = Symmetric::from_diagonal(&[0.1; 6]);
    let step = model.inner().prepare(3.0);
    let next: Transition<f64, 6, 21> = model.transition(&step, &state, &covariance, Direction::Known(Phase::Hold));
    assert_eq!((next.mean[4], next.mean[5]), (state[4], state[5]));
    assert_eq!((next.jacobian[(4, 4)], next.noise[(4, 4)], next.noise[(5, 0)]), (1.0, 0.0, 0.0));
}

fn state() -> impl Strategy<Value = SVector<f64, 6>> {
    (-0.1..0.4_f64, -0.1..0.1_f64, -0.05..0.05_f64, -0.02..0.02_f64, -0.01..0.01_f64, -0.04..0.04_f64)
        .prop_map(|(e, v, c, b, u, w)| SVector::from([e, v, c, b, u, w]))
}

/// A covariance of any correlations, with deviations of about 0.02.
fn covariance(raw: &[f64; 32]) -> Symmetric<f64, 6, 21> {
    let root = SMatrix::<f64, 6, 6>::from_fn(|i, j| 0.01 * raw[(5 * i + j) % 32]);
    Symmetric::from_lower(&(root * root.transpose()))
}

proptest! {
    #[test]
    fn jacobian_equals_finite_differences(
        state in state(), dt in 0.01..2.0_f64, raw in prop::array::uniform32(-1.0..1.0_f64),
    ) {
        let model = model::<f64>(0.05);
        let (step, covariance) = (model.inner().prepare(dt), covariance(&raw));
        for direction in [Direction::Known(Phase::Extend), Direction::Known(Phase::Retract), UNCERTAIN] {
            let go = |state: &SVector<f64, 6>| model.transition::<21>(&step, state, &covariance, direction);
            let next = go(&state);
            // The clamp bends over the deviation of the lag, about 0.01 and hardly ever below 0.002, so its third derivative is
            // at most of order 1/sd² = 2.5e5: central differences are off by h²/6 of that, 4e-8.
            let h = 1e-6;
            for j in 0..6 {
                let mut ahead = SVector::zeros();
                ahead[j] = h;
                let slope = (go(&(state + ahead)).mean - go(&(state - ahead)).mean) / (2.0 * h);
                for u in 4..6 {
                    prop_assert!((slope[u] - next.jacobian[(u, j)]).abs() < 1e-6, "{u} {j}: {slope} {next:?}");
                }
            }
            // What plays leave alone is what the model does without them.
            let inner: Transition<f64, 4, 10> =
                model.inner().transition(&step, &state.fixed_rows::<4>(0).into_owned(), direction);
            prop_assert_eq!(next.mean.fixed_rows::<4>(0), inner.mean);
            prop_assert_eq!(next.jacobian.fixed_view::<4, 4>(0, 0), inner.jacobian);
        }
    }

    #[test]
    fn sparse_propagation_equals_the_matrix_formula(
        state in state(), dt in 0.001..20.0_f64, raw in prop::array::uniform32(-1.0..1.0_f64),
    ) {
        let model = model::<f64>(0.05);
        let before = covariance(&raw);
        let next = model.transition(&model.inner().prepare(dt), &state, &before, UNCERTAIN);
        let sparse = model.propagate(&before, &next).to_matrix();
        let full = next.jacobian * before.to_matrix() * next.jacobian.transpose() + next.noise.to_matrix();
        // Sums of at most 36 products of numbers below 0.1, rounded.
        prop_assert!((sparse - full).amax() < 1e-16 * 36.0);
    }

    /// Noise is a covariance, and no lag has more variance than a value between -r and r can have.
    #[test]
    fn noise_is_positive_semi_definite(
        state in state(), dt in 0.001..20.0_f64, raw in prop::array::uniform32(-1.0..1.0_f64),
    ) {
        let model = model::<f64>(0.05);
        let before = covariance(&raw);
        let next = model.transition(&model.inner().prepare(dt), &state, &before, UNCERTAIN);
        let noise = next.noise.to_matrix();
        prop_assert!(noise.symmetric_eigenvalues().min() > -1e-15 * noise.norm());
        let after = model.propagate(&before, &next);
        for (u, half_width) in [4, 5].into_iter().zip(HALF_WIDTHS) {
            // The logistic slope of a wide Gaussian is 0.85 r/sd instead of 0.80 r/sd, so its square is all that r² allows.
            prop_assert!(next.mean[u].abs() <= half_width && after[(u, u)] <= half_width * half_width * (1.0 + 1e-9));
        }
    }

    /// Mean, slope and variance of a clamped Gaussian by quadrature.
    #[test]
    fn the_clamp_is_linearised_over_the_gaussian(mean in -0.02..0.02_f64, sd in 0.0005..0.04_f64) {
        let model = model::<f64>(1e-9);
        let mut before = Symmetric::<f64, 6, 21>::zeros();
        before[(4, 4)] = sd * sd;
        let mut state = SVector::zeros();
        (state[0], state[4]) = (0.15, mean);
        // A moment without motion: the lag itself is clamped.
        let next = model.transition(&model.inner().prepare(1e-9), &state, &before, UNCERTAIN);
        let (mut sums, nodes) = ([0.0; 4], 4001);
        for k in 0..nodes {
            let z = -8.0 + 16.0 * f64::from(k) / f64::from(nodes - 1);
            let clamped = (mean + sd * z).clamp(-HALF_WIDTHS[0], HALF_WIDTHS[0]);
            for (sum, value) in sums.iter_mut().zip([1.0, clamped, clamped * z, clamped * clamped]) {
                *sum += (-0.5 * z * z).exp() * value;
            }
        }
        let [total, first, with_z, squares] = sums;
        let (first, slope) = (first / total, with_z / total / sd);
        let variance = squares / total - first * first;
        // The logistic distribution differs from the normal one by 0.0095, its integral by 0.0156 sd, at each of two
        // corners. (Quadrature over kinks is good to (16/4000)², far below.)
        prop_assert!((next.mean[4] - first).abs() < 2.0 * 0.0156 * sd);
        prop_assert!((next.jacobian[(4, 4)] - slope).abs() < 2.0 * 0.0095);
        // The variance of the clamped value is bounded by r² and by sd²; half of the smaller one is what a slope that is
        // wrong by 0.019 and a residual without its higher Hermite coefficients may be off together.
        let after = model.propagate(&before, &next)[(4, 4)];
        prop_assert!((after - variance).abs() < 0.5 * (HALF_WIDTHS[0].powi(2)).min(sd * sd), "{after} {variance}");
    }
}

#[test]
fn wrong_plays_are_named() {
    let inner = *model::<f64>(0.05).inner();
    let with = |half_width: f64, weight: f64| {
        WithPlays::<f64, 2, 1, 4, 1, 5>::new(inner, [Play { half_width, weight }]).map(|_| ())
    };
    let named = |result: Result<(), ParameterError>| result.unwrap_err().parameter;
    assert_eq!(named(with(0.0, 1.0)), "half_width");
    assert_eq!(named(with(f64::INFINITY, 1.0)), "half_width");
    assert_eq!(named(with(0.1, f64::NAN)), "weight");
    assert!(with(0.1, -1.0).is_ok());
}
