//! The state-space model against derivatives from dual numbers, against itself in two halves, and at its corners.

use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
    Transition, Turning,
};
use proptest::prelude::*;

const DIRECTIONS: [Direction<f64>; 5] = [
    Direction::Known(Phase::Extend),
    Direction::Known(Phase::Hold),
    Direction::Known(Phase::Retract),
    Direction::Uncertain { rate_sd: 0.03, persistence: 1.0 },
    Direction::Within { phase: Phase::Retract, turning: Turning { excess: 0.01, variance: 1e-4 } },
];

fn in_duals(direction: Direction<f64>) -> Direction<Dual64> {
    match direction {
        Direction::Known(phase) => Direction::Known(phase),
        Direction::Uncertain { rate_sd, persistence } => {
            Direction::Uncertain { rate_sd: rate_sd.into(), persistence: persistence.into() }
        }
        Direction::Within { phase, turning: Turning { excess, variance } } => {
            Direction::Within { phase, turning: Turning { excess: excess.into(), variance: variance.into() } }
        }
    }
}

fn law<T: Scalar>(gauge: Gauge<T>, slope: f64) -> SensorLaw<T, 2> {
    let branch = |tau_s: f64, sign: f64| Branch {
        tau_s: T::of(tau_s),
        extend_gain: T::of(0.9),
        retract_gain: T::of(-0.6 * sign),
        extend_gain_slope: T::of(-0.8 * slope),
        retract_gain_slope: T::of(0.5 * slope),
    };
    SensorLaw {
        gauge,
        extend_viscosity_s: T::of(0.03),
        retract_viscosity_s: T::of(-0.02),
        branches: [branch(2.0, 1.0), branch(40.0, -1.0)],
        range: StrainRange { lower: T::of(-0.5), upper: T::of(0.5) },
    }
}

fn noise<T: Scalar>() -> ModelNoise<T> {
    ModelNoise {
        reading_sd: T::of(1e-3),
        branch_sd: T::of(4e-3),
        baseline_sd: T::of(0.02),
        baseline_time_s: T::of(30.0),
    }
}

fn polynomial<T: Scalar>() -> Gauge<T> {
    Gauge::Polynomial { coefficients: [T::of(1.4), T::of(-2.0), T::of(0.7)] }
}

fn model<T: Scalar>(gauge: Gauge<T>, slope: f64) -> SwitchedModel<T, 2, 5> {
    let motion = Motion::ornstein_uhlenbeck(T::of(0.8), T::of(0.05), T::of(0.1), T::of(0.12)).unwrap();
    SwitchedModel::new(law(gauge, slope), motion, noise()).unwrap()
}

fn state() -> impl Strategy<Value = SVector<f64, 5>> {
    let wide = -0.2..0.2_f64;
    (0.0..0.3_f64, -0.1..0.1_f64, wide.clone(), wide.clone(), wide)
        .prop_map(|(e, v, c1, c2, b)| SVector::from([e, v, c1, c2, b]))
}

/// The state with a unit derivative in component `j`.
fn seeded(state: &SVector<f64, 5>, j: usize) -> SVector<Dual64, 5> {
    SVector::from_fn(|i, _| if i == j { Dual64::from(state[i]).derivative() } else { state[i].into() })
}

proptest! {
    /// Dual numbers are exact; the analytic Jacobian sums a dozen products, so a dozen ε of the largest one.
    #[test]
    fn jacobian_equals_dual_numbers(state in state(), dt in 0.01..3.0_f64) {
        let exact = model::<f64>(polynomial(), 1.0);
        let dual = model::<Dual64>(polynomial(), 1.0);
        for direction in DIRECTIONS {
            let at: Transition<f64, 5, 15> = exact.transition(&exact.prepare(dt), &state, direction);
            for j in 0..5 {
                let moved: Transition<Dual64, 5, 15> =
                    dual.transition(&dual.prepare(dt.into()), &seeded(&state, j), in_duals(direction));
                for i in 0..5 {
                    let expected = moved.mean[i].eps;
                    prop_assert!(
                        (at.jacobian[(i, j)] - expected).abs() < 1e-13 * (1.0 + expected.abs()),
                        "{direction:?} ∂x{i}/∂x{j}: {} vs {expected}", at.jacobian[(i, j)]
                    );
                }
            }
        }
    }

    #[test]
    fn gradient_of_the_reading_equals_dual_numbers(state in state()) {
        let families: [(Gauge<f64>, Gauge<Dual64>); 3] = [
            (polynomial(), polynomial()),
            (
                Gauge::DecayingExponential { slope: 3.0, decay_strain: 0.2 },
                Gauge::DecayingExponential { slope: 3.0.into(), decay_strain: 0.2.into() },
            ),
            (
                Gauge::Tunnelling { gap: 1.5, barrier: 1.5, path_loss: -4.0 },
                Gauge::Tunnelling { gap: 1.5.into(), barrier: 1.5.into(), path_loss: (-4.0).into() },
            ),
        ];
        for (gauge, dual_gauge) in families {
            let (exact, dual) = (model(gauge, 1.0), model(dual_gauge, 1.0));
            for direction in DIRECTIONS {
                let at = exact.observe(&state, direction);
                for j in 0..5 {
                    let expected = dual.observe(&seeded(&state, j), in_duals(direction)).value.eps;
                    prop_assert!((at.gradient[j] - expected).abs() < 1e-13 * (1.0 + expected.abs()));
                }
            }
        }
    }

    /// Curve, dash-pot, branches and baseline, in every phase; a path there and back adds to it what the law says of both ways.
    #[test]
    fn a_reading_is_that_of_the_law(state in state(), excess in 0.0..0.1_f64) {
        let model = model::<f64>(polynomial(), 1.0);
        let [strain, rate, first, second, baseline] = *state.as_ref();
        let law = |phase| model.law().relative_change(strain, rate, &[first, second], baseline, phase);
        for phase in Phase::ALL {
            let known = model.observe(&state, Direction::Known(phase));
            prop_assert!((known.value - law(phase)).abs() < 1e-15);
            prop_assert_eq!(known.variance, 1e-6);
            if phase == Phase::Hold {
                continue;
            }
            let turning = Turning { excess, variance: 0.04 };
            let turned = model.observe(&state, Direction::Within { phase, turning });
            let there_and_back = model.law().extend_viscosity_s - model.law().retract_viscosity_s;
            prop_assert!((turned.value - law(phase) - there_and_back * 0.5 * excess).abs() < 1e-15);
            prop_assert!((turned.variance - 1e-6 - (there_and_back * 0.5).powi(2) * 0.04).abs() < 1e-18);
        }
    }

    /// One step is two, with constant gains and a given phase: exact in mean, Jacobian and noise.
    #[test]
    fn splitting_a_step_changes_nothing(state in state(), first in 0.001..2.0_f64, second in 0.001..2.0_f64) {
        let model = model::<f64>(polynomial(), 0.0);
        for phase in Phase::ALL {
            let direction = Direction::Known(phase);
            let over = |dt: f64, from: &SVector<f64, 5>| -> Transition<f64, 5, 15> {
                model.transition(&model.prepare(dt), from, direction)
            };
            let whole = over(first + second, &state);
            let a = over(first, &state);
            let b = over(second, &a.mean);
            let noise = a.noise.congruence(&b.jacobian).plus(&b.noise);
            prop_assert!((whole.mean - b.mean).amax() < 1e-13);
            prop_assert!((whole.jacobian - b.jacobian * a.jacobian).amax() < 1e-13);
            for i in 0..5 {
                for j in 0..5 {
                    let scale = (whole.noise[(i, i)] * whole.noise[(j, j)]).sqrt();
                    prop_assert!((whole.noise[(i, j)] - noise[(i, j)]).abs() <= 1e-12 * scale);
                }
            }
        }
    }

    /// The sparse path and the full matrices say the same: both sum at most N² products per entry.
    #[test]
    fn sparse_propagation_equals_the_matrix_formula(state in state(), dt in 0.001..20.0_f64, raw in prop::array::uniform32(-1.0..1.0_f64)) {
        let root = SMatrix::<f64, 5, 5>::from_fn(|i, j| raw[(5 * i + 7 * j) % 32]);
        let covariance = Symmetric::<f64, 5, 15>::from_lower(&(root * root.transpose()));
        let model = model::<f64>(polynomial(), 1.0);
        for direction in DIRECTIONS {
            let step: Transition<f64, 5, 15> = model.transition(&model.prepare(dt), &state, direction);
            let full = covariance.congruence(&step.jacobian).plus(&step.noise);
            let sparse = model.propagate(&covariance, &step);
            let size = full.to_matrix().amax();
            prop_assert!((full.to_matrix() - sparse.to_matrix()).amax() < 25.0 * f64::EPSILON * size);
            if direction != Direction::Known(Phase::Hold) {
                let rate_variance = model.rate_variance(&model.prepare(dt), &covariance);
                prop_assert!((rate_variance - full[(1, 1)]).abs() < 25.0 * f64::EPSILON * size);
            }
        }
    }

    /// The noise of a linearised step is a covariance even where the gain depends on the noisy strain.
    #[test]
    fn noise_is_positive_semi_definite(state in state(), dt in 0.001..20.0_f64) {
        let model = model::<f64>(polynomial(), 3.0);
        for direction in DIRECTIONS {
            let step: Transition<f64, 5, 15> = model.transition(&model.prepare(dt), &state, direction);
            let q: SMatrix<f64, 5, 5> = step.noise.to_matrix();
            let eigenvalues = q.symmetric_eigenvalues();
            prop_assert!(eigenvalues.min() >= -1e-15 * eigenvalues.max());
        }
    }
}

/// Known moments of |v|: for v ~ N(0, s²) both halves see s/√(2π), within the 0.0095 · s · few of the logistic normal.
#[test]
fn an_uncertain_direction_drives_both_gains() {
    let mut only_extend = law::<f64>(polynomial(), 0.0);
    for branch in &mut only_extend.branches {
        branch.retract_gain = 0.0;
    }
    let motion = Motion::ornstein_uhlenbeck(1e6, 0.05, 0.0, f64::INFINITY).unwrap();
    let model = SwitchedModel::<f64, 2, 5>::new(only_extend, motion, noise()).unwrap();
    let dt = 1e-3;
    let rest = SVector::from([0.1, 0.0, 0.0, 0.0, 0.0]);
    let step: Transition<f64, 5, 15> =
        model.transition(&model.prepare(dt), &rest, Direction::Uncertain { rate_sd: 0.05, persistence: 1.0 });
    let expected = 0.9 * dt * 0.05 / std::f64::consts::TAU.sqrt();
    // ln 2/1.702 = 0.4073 stands for 1/√(2π) = 0.3989.
    assert!((step.mean[2] / expected - 1.0).abs() < 0.022, "{} vs {expected}", step.mean[2]);
    // Where the direction is certain, the split is the sign.
    let moving = SVector::from([0.1, 0.5, 0.0, 0.0, 0.0]);
    let certain: Transition<f64, 5, 15> =
        model.transition(&model.prepare(dt), &moving, Direction::Uncertain { rate_sd: 0.01, persistence: 1.0 });
    let known: Transition<f64, 5, 15> = model.transition(&model.prepare(dt), &moving, Direction::Known(Phase::Extend));
    assert!((certain.mean - known.mean).amax() < 1e-15);
}

/// A rate of deviation s at rest leaves s² (1/4 - 1/(2π)) of the variance of its stretching half unexplained, from the moments
/// of the half-normal distribution: through the dash-pots in the reading, and through all gains in the branches, over the
/// time for which each remembers.
#[test]
fn an_uncertain_direction_leaves_what_the_half_normal_distribution_says() {
    let model = model::<f64>(polynomial(), 0.0);
    let (rate_sd, dt) = (0.05, 0.4);
    let open = rate_sd * rate_sd * (0.25 - 1.0 / std::f64::consts::TAU);
    // At the mean strain, so that nothing pulls.
    let rest = SVector::from([0.1, 0.0, 0.0, 0.0, 0.0]);
    let seen = model.observe(&rest, Direction::Uncertain { rate_sd, persistence: 1.0 });
    assert!((seen.variance - 1e-6 - 0.05_f64.powi(2) * open).abs() < 1e-18);
    let noise = |persistence: f64| {
        let direction = Direction::Uncertain { rate_sd, persistence };
        let step: Transition<f64, 5, 15> = model.transition(&model.prepare(dt), &rest, direction);
        step.noise
    };
    let (once, never) = (noise(1.0), noise(0.0));
    let jump = [(2.0, 0.9 + 0.6), (40.0, 0.9 - 0.6)]
        .map(|(tau_s, gains): (f64, f64)| tau_s * (1.0 - (-dt / tau_s).exp()) * gains);
    for i in 0..5 {
        for j in 0..5 {
            let expected =
                if (2..4).contains(&i) && (2..4).contains(&j) { open * jump[i - 2] * jump[j - 2] } else { 0.0 };
            assert!((once[(i, j)] - never[(i, j)] - expected).abs() < 1e-15, "{i} {j}");
            assert!((noise(3.0)[(i, j)] - never[(i, j)] - 3.0 * expected).abs() < 1e-15, "{i} {j}");
        }
    }
}

/// A rate with white acceleration correlates as exp(-t/T) and its direction as the square of that: over steps of h that sums
/// up to `h Σ exp(-2 |k| h/T)`, of which every step shall have as much that the whole is T, whatever h.
#[test]
fn what_a_direction_leaves_grows_at_one_rate_whatever_the_step() {
    let model = model::<f64>(polynomial(), 0.0);
    for h in [1e-4, 0.01, 0.3, 2.0] {
        let all: f64 = 1.0 + 2.0 * (1..400_000).map(|k| (-2.0 * f64::from(k) * h / 0.8).exp()).sum::<f64>();
        // Below a thousandth of T the sum is one, which is off by x²/3 < 4e-7.
        assert!((model.prepare(h).averaging() * h * all / 0.8 - 1.0).abs() < 4e-7, "{h}");
    }
}

/// After a minute nothing is left of the start.
#[test]
fn motion_tends_to_its_means() {
    let motion =
        |strain_sd| Motion::ornstein_uhlenbeck(0.8, 0.05, 0.1, strain_sd).unwrap().with_phase_rate(0.04).unwrap();
    let law = SensorLaw { range: StrainRange { lower: -0.2, upper: 0.3 }, ..law(polynomial(), 0.0) };
    let model = |strain_sd| SwitchedModel::<f64, 2, 5>::new(law, motion(strain_sd), noise()).unwrap();
    let late = |model: &SwitchedModel<f64, 2, 5>, direction| -> SVector<f64, 5> {
        let from = SVector::from([0.2, 0.3, 0.0, 0.0, 0.0]);
        model.transition::<15>(&model.prepare(60.0), &from, direction).mean
    };
    let (bound, free) = (model(0.12), model(f64::INFINITY));
    for (direction, rate) in DIRECTIONS.into_iter().zip([0.04, 0.0, -0.04, 0.0, -0.04]) {
        assert!((late(&free, direction)[1] - rate).abs() < 1e-15, "{direction:?}");
        if direction != Direction::Known(Phase::Hold) {
            // The push of a phase's rate is held by the pull toward the mean strain.
            let pushed = rate / (0.8 * (0.05_f64 / 0.12).powi(2));
            assert!((late(&bound, direction)[0] - 0.1 - pushed).abs() < 1e-3, "{direction:?}");
        }
    }
    // Where strain has no mean, the law's range says what is likely.
    assert_eq!(free.initial_distribution().1[0], 0.25);
    assert_eq!(bound.initial_distribution().1[0], 0.12 * 0.12);
}

/// Beyond the range gains keep their border values.
#[test]
fn gains_are_affine_within_the_range() {
    let law = law::<f64>(polynomial(), 1.0);
    for (strain, at, slope) in [(-0.7, -0.5, 0.0), (-0.5, -0.5, 1.0), (0.2, 0.2, 1.0), (0.5, 0.5, 1.0), (0.7, 0.5, 0.0)]
    {
        assert_eq!(law.gain(0, strain, Phase::Extend), (0.9 - 0.8 * at, -0.8 * slope));
        assert_eq!(law.gain(1, strain, Phase::Retract), (0.6 + 0.5 * at, 0.5 * slope));
        assert_eq!(law.gain(1, strain, Phase::Hold), (0.0, 0.0));
    }
}

#[test]
fn a_hold_holds() {
    let model = model::<f64>(polynomial(), 1.0);
    let state = SVector::from([0.2, 0.05, 0.3, -0.1, 0.02]);
    let step: Transition<f64, 5, 15> = model.transition(&model.prepare(10.0), &state, Direction::Known(Phase::Hold));
    assert_eq!(step.mean[0], 0.2);
    assert_eq!(step.mean[1], 0.0);
    assert!((step.mean[2] - 0.3 * (-5.0_f64).exp()).abs() < 1e-16);
    assert!((step.mean[3] + 0.1 * (-0.25_f64).exp()).abs() < 1e-16);
    assert_eq!(step.noise[(0, 0)], 0.0);
}

/// Long-run variances stay what they are: P = F P Fᵀ + Q.
#[test]
fn the_initial_distribution_is_stationary() {
    let motion = Motion::ornstein_uhlenbeck(0.8, 0.05, 0.1, 0.12).unwrap();
    let mut relaxed = law::<f64>(polynomial(), 0.0);
    for branch in &mut relaxed.branches {
        (branch.extend_gain, branch.retract_gain) = (0.0, 0.0);
    }
    let model = SwitchedModel::<f64, 2, 5>::new(relaxed, motion, noise()).unwrap();
    let (mean, variance) = model.initial_distribution();
    let step: Transition<f64, 5, 15> = model.transition(&model.prepare(0.7), &mean, Direction::Known(Phase::Extend));
    let mut covariance = Symmetric::<f64, 5, 15>::from_diagonal(&variance);
    for _ in 0..2000 {
        covariance = covariance.congruence(&step.jacobian).plus(&step.noise);
    }
    for (i, variance) in variance.iter().enumerate() {
        assert!((covariance[(i, i)] / variance - 1.0).abs() < 1e-9, "{i}: {} vs {variance}", covariance[(i, i)]);
    }
    assert!((step.mean - mean).amax() < 1e-15);
}

#[test]
fn wrong_parameters_are_named() {
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.05, 0.0, 0.1).unwrap();
    let refuse = |law: SensorLaw<f64, 2>, noise: ModelNoise<f64>| {
        SwitchedModel::<f64, 2, 5>::new(law, motion, noise).unwrap_err().parameter
    };
    let good = law::<f64>(polynomial(), 1.0);
    let mut bad = good;
    bad.branches[1].tau_s = 0.0;
    assert_eq!(refuse(bad, noise()), "tau_s");
    bad.branches[1].tau_s = f64::INFINITY;
    assert_eq!(refuse(bad, noise()), "tau_s");
    bad.branches[1] = Branch { tau_s: 0.5, retract_gain_slope: f64::NAN, ..good.branches[1] };
    assert_eq!(refuse(bad, noise()), "branch gain");
    assert_eq!(refuse(SensorLaw { retract_viscosity_s: f64::NAN, ..good }, noise()), "viscosity_s");
    let without = SwitchedModel::<f64, 2, 4>::new(good, motion, noise());
    assert_eq!(without.unwrap_err().parameter, "baseline_sd");
    assert!(SwitchedModel::<f64, 2, 4>::new(good, motion, ModelNoise { baseline_sd: 0.0, ..noise() }).is_ok());
    assert_eq!(Motion::ornstein_uhlenbeck(f64::INFINITY, 0.05, 0.0, 0.1).unwrap_err().parameter, "rate_time_s");
    for (mean, sd, culprit) in [(f64::NAN, 0.1, "strain_mean"), (0.0, 0.0, "strain_sd"), (0.0, -0.1, "strain_sd")] {
        assert_eq!(Motion::<f64>::ornstein_uhlenbeck(1.0, 0.05, mean, sd).unwrap_err().parameter, culprit);
    }
    assert_eq!(
        refuse(SensorLaw { gauge: Gauge::DecayingExponential { slope: 1.0, decay_strain: 0.0 }, ..good }, noise()),
        "gauge.decay_strain"
    );
    assert_eq!(refuse(SensorLaw { extend_viscosity_s: f64::NAN, ..good }, noise()), "viscosity_s");
    assert_eq!(refuse(SensorLaw { range: StrainRange { lower: 1.0, upper: 1.0 }, ..good }, noise()), "range");
    assert_eq!(refuse(good, ModelNoise { branch_sd: -1.0, ..noise() }), "branch_sd");
    assert_eq!(refuse(good, ModelNoise { reading_sd: f64::NAN, ..noise() }), "reading_sd");
    assert_eq!(refuse(good, ModelNoise { baseline_time_s: 0.0, ..noise() }), "baseline_time_s");
    assert_eq!(Motion::<f64>::ornstein_uhlenbeck(1.0, -0.05, 0.0, 0.1).unwrap_err().parameter, "rate_sd");
    assert_eq!(Motion::<f64>::ornstein_uhlenbeck(f64::NAN, 0.05, 0.0, 0.1).unwrap_err().parameter, "rate_time_s");
}
