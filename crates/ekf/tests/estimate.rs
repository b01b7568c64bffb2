//! Borders in an estimate, and smoothing of a prediction that was cut, against closed forms.

use nalgebra::{SVector, vector};
use ohmstrain_ekf::{Belief, Dynamics, Estimate, Estimator, Evidence, Gaussian, Mixture, Settling, SignSplit, State};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};

const RANGE: StrainRange<f64> = StrainRange { lower: 0.0, upper: 0.4 };
const TAU_S: f64 = 20.0;
const SETTLING: Settling<f64> = Settling { horizon_s: 30.0, share: 0.7, share_sd: 0.2, sd: 4e-3 };

fn model(gauge: [f64; 3], gains: [f64; 2]) -> SwitchedModel<f64, 1, 4> {
    let [extend_gain, retract_gain] = gains;
    let branch = Branch { tau_s: TAU_S, extend_gain, retract_gain, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: gauge },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        branches: [branch],
        range: RANGE,
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
    SwitchedModel::new(law, motion, noise).unwrap()
}

fn belief(mean: [f64; 4], sd: [f64; 4]) -> Belief<f64, 4, 10> {
    Belief::independent(SVector::from(mean), &sd.map(|sd| sd * sd))
}

/// Φ(1) and Φ(2) of the standard normal, from tables.
const PHI: [f64; 2] = [0.841_344_746_068_542_9, 0.977_249_868_051_820_8];

/// The curve turns at 0.25, as a peak or as a valley.
#[test]
fn the_border_has_its_probability() {
    for sign in [1.0, -1.0] {
        let model = model([1.9 * sign, -3.8 * sign, 0.0], [0.6, -0.4]);
        let beyond = |state: &Belief<f64, 4, 10>| Estimate::new(&model, state, &RANGE, 1.0, &SETTLING).beyond_border;
        for (strain, expected) in [(0.25, 0.5), (0.30, PHI[0]), (0.20, 1.0 - PHI[0]), (0.15, 1.0 - PHI[1])] {
            let found = beyond(&belief([strain, 0.0, 0.0, 0.0], [0.05, 0.1, 0.01, 0.01]));
            // The complementary error function is good to a few roundings.
            assert!((found - expected).abs() < 1e-14, "{sign} {strain}: {found}");
        }
        // Twice the deviation, as a calibration may ask for.
        let wide =
            Estimate::new(&model, &belief([0.30, 0.0, 0.0, 0.0], [0.025, 0.1, 0.01, 0.01]), &RANGE, 2.0, &SETTLING);
        assert!((wide.beyond_border - PHI[0]).abs() < 1e-14);
    }
    let straight =
        Estimate::new(&model([1.9, -1.0, 0.0], [0.6, -0.4]), &belief([0.3; 4], [0.1; 4]), &RANGE, 1.0, &SETTLING);
    assert_eq!(straight.beyond_border, 0.0);
}

#[test]
fn relaxation_and_baseline_are_distinguished() {
    let belief = belief([0.1, 0.0, 0.02, 0.03], [0.1; 4]);
    let estimate = Estimate::new(&model([1.9, -1.0, 0.0], [0.6, -0.4]), &belief, &RANGE, 1.0, &SETTLING);
    assert_eq!((estimate.relaxation.mean, estimate.baseline), (0.02, 0.03));
}

/// The reading of a mixture in a hold, on a straight curve, is a sum, whose variance is w P wᵀ of all hypotheses together. It falls
/// by a share of the branch's relaxation.
#[test]
fn a_held_strain_settles_by_what_is_left_to_relax() {
    let (model, wide) = (model([2.0, 0.0, 0.0], [0.6, -0.4]), StrainRange { lower: -9.0, upper: 9.0 });
    let filter = SignSplit::<_, 1, 4, 4>::new(model, 0.1, None, Evidence::new(wide, 1.0).unwrap()).unwrap();
    let mut state = Mixture::single(belief([0.15, 0.0, 0.02, 0.0], [0.05, 0.1, 0.02, 0.01]), Phase::Extend);
    for reading in [0.32, 0.35, 0.33] {
        filter.step(&mut state, Some(reading.into())).unwrap();
    }
    assert!(state.shares().len() > 1);
    let (estimate, all) = (Estimate::new(&model, &state, &wide, 1.0, &SETTLING), state.moments());
    let parts = vector![2.0, 0.0, 1.0, 1.0];
    assert!((estimate.held.mean - parts.dot(&all.mean)).abs() < 1e-14);
    let variance = (parts.transpose() * all.covariance.to_matrix() * parts)[0];
    // The square of a reading of 0.3 is a hundred times larger than what is left.
    assert!((estimate.held.variance - variance).abs() < 1e-14);
    let relaxes = all.mean[2] * (1.0 - (-30.0 / TAU_S).exp());
    assert!((estimate.still_relaxes.mean - 0.7 * relaxes).abs() < 1e-15);
    assert!((estimate.still_relaxes.variance - (0.2 * relaxes).powi(2) - 4e-3 * 4e-3).abs() < 1e-15);
    let settled = estimate.settled();
    assert_eq!(settled.mean, estimate.held.mean - estimate.still_relaxes.mean);
    assert_eq!(settled.variance, estimate.held.variance + estimate.still_relaxes.variance);
    assert_eq!(estimate.relaxation, Gaussian { mean: all.mean[2], variance: all.covariance[(2, 2)] });
}

/// A correct law predicts the reading of a sensor that is held for that long: a hold of 30 s in steps of a millisecond,
/// ċ = -c/τ by Euler's rule, on a curved gauge.
#[test]
fn a_law_that_is_right_says_what_is_read_after_the_hold() {
    let model = model([1.9, -2.8, 0.0], [0.6, -0.4]);
    let (strain, mut relaxed, baseline) = (0.12, 0.05, 0.01);
    let settling = Settling { share: 1.0, share_sd: 0.0, sd: 0.0, ..SETTLING };
    let state = belief([strain, 0.0, relaxed, baseline], [0.0; 4]);
    let settled = Estimate::new(&model, &state, &RANGE, 1.0, &settling).settled();
    for _ in 0..30_000 {
        relaxed -= 1e-3 * relaxed / TAU_S;
    }
    let read = 1.9 * strain - 2.8 * strain * strain + relaxed + baseline;
    // Euler's rule is off by t dt/(2 τ²) of the relaxation: 30 · 10⁻³/800 of 0.011.
    assert!((settled.mean - read).abs() < 5e-7 && settled.variance == 0.0, "{settled:?} {read}");
}

/// A sensor whose holds nobody has seen: none or all of the relaxation is as likely as what lies between.
#[test]
fn an_unseen_hold_may_relax_by_any_share() {
    let model = model([2.0, 0.0, 0.0], [0.6, -0.4]);
    let unseen = Settling::unseen(model.noise(), 1);
    let state = belief([0.1, 0.0, 0.05, 0.0], [0.0; 4]);
    let falls = Estimate::new(&model, &state, &RANGE, 1.0, &unseen).still_relaxes;
    let relaxes = 0.05 * (1.0 - (-60.0 / TAU_S).exp());
    let wander = 0.02 * 0.02 + 5e-3 * 5e-3;
    assert!((falls.mean - 0.5 * relaxes).abs() < 1e-15);
    assert!((falls.variance - relaxes * relaxes / 12.0 - wander).abs() < 1e-15);
}

/// The ramp border is at the one strain where dρ/dε = 1.9 - 5.6 ε + k - c/(τ v) is zero.
#[test]
fn the_ramp_border_is_where_the_reading_stops_changing() {
    let model = model([1.9, -2.8, 0.0], [-0.5, -0.2]);
    let near = |strain: f64, rate: f64, relaxed: f64| {
        let belief = belief([strain, rate, relaxed, 0.0], [0.01, 0.02, 1e-3, 1e-3]);
        Estimate::new(&model, &belief, &RANGE, 1.0, &SETTLING).near_ramp_border
    };
    for (rate, gain) in [(0.1, -0.5), (-0.1, -0.2)] {
        for relaxed in [-0.3, 0.0, 0.3] {
            let border = (1.9 + gain - relaxed / (TAU_S * rate)) / 5.6;
            assert!(near(border, rate, relaxed) && near(border + 0.019, rate, relaxed), "{rate} {relaxed}");
            assert!(!near(border + 0.021, rate, relaxed) && !near(border - 0.021, rate, relaxed), "{rate} {relaxed}");
        }
        // A rate that may be zero is no ramp.
        assert!(!near((1.9 + gain) / 5.6, 0.39 * rate, 0.0));
    }
}

/// A belief whose rate has been told: regression on it.
fn knowing_the_rate(belief: &Belief<f64, 4, 10>, known_rate: &Gaussian<f64>) -> Belief<f64, 4, 10> {
    let with_rate: SVector<f64, 4> = SVector::from_fn(|i, _| belief.covariance[(i, 1)]);
    let variance = with_rate[1] + known_rate.variance;
    let mut known = *belief;
    known.mean += with_rate * ((known_rate.mean - belief.mean[1]) / variance);
    known.covariance.add_outer(&with_rate, -1.0 / variance);
    known
}

/// A prediction is cut at rate zero; then the rate is told. What that says of the state before is regression on the rate as
/// it was predicted before the cut: `m + P Fᵀ e (v - v̂)/(e F P Fᵀ e + Q)`.
#[test]
fn a_smoother_goes_back_through_the_prediction_before_its_cut() {
    let model = model([1.9, -2.8, 0.0], [0.6, -0.4]);
    let filter = SignSplit::<_, 1, 4, 4>::new(
        model,
        0.2,
        None,
        Evidence::new(StrainRange { lower: -9.0, upper: 9.0 }, 1.0).unwrap(),
    )
    .unwrap();
    let start = belief([0.15, 0.05, 0.02, 0.0], [0.03, 0.06, 0.02, 0.01]);
    let prepared = Estimator::<f64, 4, 10>::prepare(&filter, 0.2);
    let filtered = Mixture::single(start, Phase::Extend);
    let known_rate = Gaussian { mean: 0.12, variance: 1e-14 };
    let next = filter.advance(&filtered, &prepared, None).unwrap().state;
    let next = Mixture::single(knowing_the_rate(&next.shares()[0].belief, &known_rate), Phase::Extend);
    let back = filter.smooth_back(&filtered, &prepared, None, &next).unwrap().moments();

    let step = Dynamics::<f64, 4, 10>::prepare(&model, 0.2);
    let transition = Dynamics::<f64, 4, 10>::transition(&model, &step, &start, Some(Phase::Extend));
    let (prior, toward) = (start.covariance.to_matrix(), transition.jacobian);
    let predicted = toward * prior * toward.transpose() + transition.noise.to_matrix();
    let with_rate = prior * toward.transpose() * vector![0.0, 1.0, 0.0, 0.0];
    let gain = with_rate / predicted[(1, 1)];
    let mean = start.mean + gain * (known_rate.mean - transition.mean[1]);
    let covariance = prior - gain * with_rate.transpose();
    // The cut half is told its rate through a covariance of 10⁻³ against 10⁻¹⁴; rounding leaves 10⁻¹² of it.
    assert!((back.mean - mean).amax() < 1e-9, "{} {mean}", back.mean);
    assert!((back.covariance.to_matrix() - covariance).amax() < 1e-9, "{} {covariance}", back.covariance.to_matrix());
}
