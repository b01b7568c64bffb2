//! Properties of every step, whatever the model.

use nalgebra::SVector;
use ohmstrain_ekf::{
    AnyCurve, Belief, Compact, Cubic, Curve, Ekf, Estimator, Logistic, Reading, SparseEkf, StepError, Substeps, Switch,
};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, Phase, Scalar, SensorLaw, StrainRange, SwitchedModel, Symmetric,
    Transition, unexplained,
};
use proptest::prelude::*;

/// A sensor whose readings are relative to R₀.
pub fn sensor<T: Scalar>() -> SwitchedModel<T, 2, 5> {
    let of = |x: f64| T::of(x);
    let branch = |tau_s: f64| Branch {
        tau_s: of(tau_s),
        extend_gain: of(0.8),
        retract_gain: of(-0.5),
        extend_gain_slope: of(-0.6),
        retract_gain_slope: of(-0.4),
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [of(1.6), of(-1.2), of(0.5)] },
        extend_viscosity_s: of(0.02),
        retract_viscosity_s: of(-0.01),
        branches: [branch(3.0), branch(40.0)],
        range: StrainRange { lower: of(-0.02), upper: of(0.35) },
    };
    let motion = Motion::ornstein_uhlenbeck(of(1.5), of(0.05), of(0.15), of(0.1)).unwrap();
    let noise =
        ModelNoise { reading_sd: of(2e-3), branch_sd: of(5e-3), baseline_sd: of(0.02), baseline_time_s: of(30.0) };
    SwitchedModel::new(law, motion, noise).unwrap()
}

fn readings() -> impl Strategy<Value = Vec<(f64, Option<f64>)>> {
    prop::collection::vec((0.0..0.4_f64, prop::option::weighted(0.8, -0.1..0.6_f64)), 1..60)
}

proptest! {
    /// A step without a reading is the model's transition and nothing else, and steps of zero seconds do nothing.
    #[test]
    fn missing_readings_are_predictions(rows in readings()) {
        let model = sensor::<f64>();
        let ekf = Ekf::new(model);
        let mut belief: Belief<f64, 5, 15> = Belief::initial(&model);
        for (dt_s, _) in rows {
            let step = ekf.step(&belief, dt_s, None).unwrap();
            prop_assert_eq!(step.prior, step.posterior);
            prop_assert!(step.update.is_none());
            prop_assert_eq!(step.prior.mean, step.transition.mean);
            let stood = ekf.step(&step.posterior, 0.0, None).unwrap();
            prop_assert_eq!(stood.posterior, step.posterior);
            belief = step.posterior;
        }
    }

    #[test]
    fn covariances_stay_positive_semi_definite_in_f32(rows in readings()) {
        let model = sensor::<f32>();
        let ekf = Ekf::new(model);
        let mut belief: Belief<f32, 5, 15> = Belief::initial(&model);
        for (dt_s, reading) in rows {
            belief = ekf.step(&belief, dt_s as f32, reading.map(|y| Reading::from(y as f32))).unwrap().posterior;
        }
        let eigenvalues = belief.covariance.to_matrix().symmetric_eigenvalues();
        prop_assert!(eigenvalues.min() >= -1e-6 * eigenvalues.max());
        for i in 0..5 {
            prop_assert!(belief.covariance[(i, i)] >= 0.0);
        }
    }

    /// A prepared step is the step, as long as that need not be divided.
    #[test]
    fn prepared_steps_are_steps(share in 0.001..1.0_f64, y in 0.0..0.5_f64) {
        let model = sensor::<f64>();
        let dt_s = share * model.longest_step_s();
        let ekf = Ekf::new(model);
        let belief: Belief<f64, 5, 15> = Belief::initial(&model);
        let prepared = model.prepare(dt_s);
        let reading = Some(Reading::from(y));
        prop_assert_eq!(ekf.step(&belief, dt_s, reading).unwrap(), ekf.step_prepared(&belief, &prepared, reading).unwrap());
    }
}

#[test]
fn bad_input_is_refused_by_name() {
    let model = sensor::<f64>();
    let ekf = Ekf::new(model);
    let belief: Belief<f64, 5, 15> = Belief::initial(&model);
    let step = |dt_s: f64, y: f64| ekf.step(&belief, dt_s, Some(Reading::from(y))).unwrap_err();
    assert_eq!(step(-1e-3, 0.1), StepError::NegativeTimeStep);
    assert_eq!(step(f64::NAN, 0.1), StepError::NonFiniteTimeStep);
    assert_eq!(step(f64::INFINITY, 0.1), StepError::NonFiniteTimeStep);
    assert_eq!(step(0.1, f64::NAN), StepError::NonFiniteReading);
    assert_eq!(step(0.1, f64::NEG_INFINITY), StepError::NonFiniteReading);
    let broken = Belief { covariance: Symmetric::from_diagonal(&[-1.0; 5]), ..belief };
    let refused = ekf.step(&broken, 0.0, Some(Reading::from(0.1))).unwrap_err();
    assert_eq!(refused, StepError::NonPositiveInnovationVariance);
    // So far out that its square is beyond the largest number.
    assert_eq!(step(0.1, 1e300), StepError::NonFiniteState);
    let lost = Belief { mean: SVector::repeat(f64::NAN), ..belief };
    assert!(ekf.step(&lost, 0.1, None).is_err());
    // A gap of a day is a prediction, not an overflow.
    assert!(ekf.step(&belief, 86_400.0, Some(Reading::from(0.1))).unwrap().posterior.is_finite());
}

/// The variance that electronics add to a reading makes it count for less.
#[test]
fn a_coarser_reading_moves_the_belief_less() {
    let model = sensor::<f64>();
    let ekf = Ekf::new(model);
    let belief: Belief<f64, 5, 15> = Belief::initial(&model);
    let moved = |extra_variance: f64| {
        let step = ekf.step(&belief, 0.1, Some(Reading { value: 0.5, extra_variance })).unwrap();
        (step.posterior.mean - step.prior.mean).norm()
    };
    assert!(moved(0.0) > moved(1e-3) && moved(1e-3) > moved(1.0));
}

/// Forward and back, over an even and an odd number of them; with a reading at the end.
#[test]
fn a_long_step_is_many_short_ones() {
    let model = sensor::<f64>();
    let (ekf, substeps) = (Ekf::new(model), Substeps(Ekf::new(model)));
    let start: Belief<f64, 5, 15> = Belief::initial(&model);
    let short_s = model.longest_step_s();
    let short = Estimator::<f64, 5, 15>::prepare(&ekf, short_s);
    let reading = Some(Reading::from(0.2));
    // A length divided and multiplied again is off by a rounding, and ten steps by some hundreds.
    let same = |a: &Belief<f64, 5, 15>, b: &Belief<f64, 5, 15>| {
        (a.mean - b.mean).amax() < 1e-12 && (a.covariance.to_matrix() - b.covariance.to_matrix()).amax() < 1e-12
    };
    for count in 2..=9 {
        let dt_s = f64::from(count) * short_s;
        let mut states = vec![start];
        for k in 1..=count {
            let taken = ekf.advance(&states[k as usize - 1], &short, reading.filter(|_| k == count)).unwrap();
            states.push(taken.state);
        }
        let prepared = Estimator::<f64, 5, 15>::prepare(&substeps, dt_s);
        let whole = substeps.advance(&start, &prepared, reading).unwrap().state;
        assert!(same(&whole, &states[count as usize]), "{count}");
        assert!(same(&ekf.step(&start, dt_s, reading).unwrap().posterior, &whole), "{count}");
        let smoothed = Belief { mean: whole.mean * 1.1, covariance: whole.covariance.scaled(0.5) };
        let (mut back, mut last_reading) = (smoothed, reading);
        for state in states[..count as usize].iter().rev() {
            back = ekf.smooth_back(state, &short, last_reading, &back).unwrap();
            last_reading = None;
        }
        assert!(same(&substeps.smooth_back(&start, &prepared, reading, &smoothed).unwrap(), &back), "{count}");
    }
}

/// The kernel's own curves, within the range and along the tangents beyond; Horner's scheme rounds a few times.
#[test]
fn the_kernels_curves_are_those_of_the_law() {
    let range = StrainRange { lower: -0.1, upper: 0.3 };
    let cubic = Gauge::Polynomial { coefficients: [1.4, -2.0, 0.7] };
    let peak = Gauge::DecayingExponential { slope: 3.0, decay_strain: 0.2 };
    let tunnel = Gauge::Tunnelling { gap: 1.5, barrier: 1.5, path_loss: -4.0 };
    for gauge in [cubic, peak, tunnel] {
        let law = SensorLaw::<f64, 0> { gauge, extend_viscosity_s: 0.0, retract_viscosity_s: 0.0, branches: [], range };
        let (any, only) = (AnyCurve::new(&gauge, &range).unwrap(), Cubic::new(&gauge, &range));
        assert_eq!(only.is_some(), gauge == cubic);
        for k in -60..=60 {
            let strain = 0.01 * f64::from(k);
            let (value, slope) = law.gauge_value_and_slope(strain);
            for found in [Some(any.value_and_slope(strain)), only.map(|only| only.value_and_slope(strain))] {
                let (of_value, of_slope) = found.unwrap_or((value, slope));
                assert!((of_value - value).abs() < 1e-14 && (of_slope - slope).abs() < 1e-14, "{gauge:?} at {strain}");
            }
        }
    }
}

/// The variance at rest is that of half a normal distribution; elsewhere it is the model's.
#[test]
fn a_compact_split_leaves_the_variance_of_its_probabilities() {
    for sd in [0.02_f64, 3.0] {
        let split = |u: f64| Compact::blend(u * sd, Compact::width(sd * sd));
        assert!((split(0.0).variance / (sd * sd * (0.25 - 1.0 / std::f64::consts::TAU)) - 1.0).abs() < 1e-14);
        for u in [-2.5, -0.8, 0.4, 1.9] {
            let found = split(u);
            let expected = unexplained(found.extend_probability, found.retract_probability, sd * sd);
            assert!((found.variance / expected - 1.0).abs() < 1e-14, "{u}");
        }
    }
}

/// Many deviations from zero a rate drives as if its direction were known, in the branches and in the dash-pots.
#[test]
fn a_clear_direction_is_a_known_one() {
    let model = sensor::<f64>();
    let sparse = SparseEkf::<f64, Logistic, 2, 5>::new(model, 0.01).unwrap();
    for (rate, phase) in [(1.0, Phase::Extend), (-1.0, Phase::Retract)] {
        let start = SVector::from([0.15, rate, 0.02, -0.01, 0.0]);
        let known: Transition<f64, 5, 15> = model.transition(&model.prepare(0.01), &start, Direction::Known(phase));
        let mut belief = Belief::<f64, 5, 15>::independent(start, &[1e-4; 5]);
        let mut predicted = belief;
        sparse.step(&mut predicted, None).unwrap();
        assert!((predicted.mean - known.mean).amax() < 1e-15, "{phase:?}");
        let residual = sparse.step(&mut belief, Some(Reading::from(0.3))).unwrap().unwrap();
        let expected = model.observe(&known.mean, Direction::Known(phase)).value;
        assert!((residual.innovation - (0.3 - expected)).abs() < 1e-14, "{phase:?}");
    }
}
