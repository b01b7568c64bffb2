//! What an estimate says of borders, and what a smoother makes of a prediction that was cut, against closed forms.

use nalgebra::{SVector, vector};
use ohmstrain_ekf::{Belief, Dynamics, Estimate, Estimator, Evidence, Gaussian, Mixture, SignSplit, State};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};

const RANGE: StrainRange<f64> = StrainRange { lower: 0.0, upper: 0.4 };
const TAU_S: f64 = 20.0;

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
        let beyond = |state: &Belief<f64, 4, 10>| Estimate::new(&model, state, &RANGE, 1.0).beyond_border;
        for (strain, expected) in [(0.25, 0.5), (0.30, PHI[0]), (0.20, 1.0 - PHI[0]), (0.15, 1.0 - PHI[1])] {
            let found = beyond(&belief([strain, 0.0, 0.0, 0.0], [0.05, 0.1, 0.01, 0.01]));
            // The complementary error function is good to a few roundings.
            assert!((found - expected).abs() < 1e-14, "{sign} {strain}: {found}");
        }
        // Twice the deviation, as a calibration may ask for.
        let wide = Estimate::new(&model, &belief([0.30, 0.0, 0.0, 0.0], [0.025, 0.1, 0.01, 0.01]), &RANGE, 2.0);
        assert!((wide.beyond_border - PHI[0]).abs() < 1e-14);
    }
    let straight = Estimate::new(&model([1.9, -1.0, 0.0], [0.6, -0.4]), &belief([0.3; 4], [0.1; 4]), &RANGE, 1.0);
    assert_eq!(straight.beyond_border, 0.0);
}

#[test]
fn relaxation_and_baseline_are_told_apart() {
    let belief = belief([0.1, 0.0, 0.02, 0.03], [0.1; 4]);
    let estimate = Estimate::new(&model([1.9, -1.0, 0.0], [0.6, -0.4]), &belief, &RANGE, 1.0);
    assert_eq!((estimate.relaxation.mean, estimate.baseline), (0.02, 0.03));
}

/// On a straight curve a mixture settles at its slope times the strain, with the wander of branch and baseline on top.
#[test]
fn a_held_strain_settles_on_the_curve() {
    let (model, wide) = (model([2.0, 0.0, 0.0], [0.6, -0.4]), StrainRange { lower: -9.0, upper: 9.0 });
    let filter = SignSplit::<_, 1, 4, 4>::new(model, 0.1, None, Evidence::new(wide, 1.0).unwrap()).unwrap();
    let mut state = Mixture::single(belief([0.15, 0.0, 0.02, 0.0], [0.05, 0.1, 0.02, 0.01]), Phase::Extend);
    for reading in [0.32, 0.35, 0.33] {
        filter.step(&mut state, Some(reading.into())).unwrap();
    }
    assert!(state.shares().len() > 1);
    let (estimate, all) = (Estimate::new(&model, &state, &wide, 1.0), state.moments());
    assert!((estimate.settled.mean - 2.0 * all.mean[0]).abs() < 1e-14);
    let expected = 4.0 * all.covariance[(0, 0)] + 0.02 * 0.02 + 5e-3 * 5e-3;
    // The square of a reading of 0.3 is a hundred times larger than what is left.
    assert!((estimate.settled.variance - expected).abs() < 1e-14);
    assert_eq!(estimate.relaxation, Gaussian { mean: all.mean[2], variance: all.covariance[(2, 2)] });
}

/// On a ramp dρ/dε = 1.9 - 5.6 ε + k - c/(τ v), which is zero at one strain.
#[test]
fn the_ramp_border_is_where_the_reading_stops_changing() {
    let model = model([1.9, -2.8, 0.0], [-0.5, -0.2]);
    let near = |strain: f64, rate: f64, relaxed: f64| {
        let belief = belief([strain, rate, relaxed, 0.0], [0.01, 0.02, 1e-3, 1e-3]);
        Estimate::new(&model, &belief, &RANGE, 1.0).near_ramp_border
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
fn knowing_the_rate(belief: &Belief<f64, 4, 10>, told: &Gaussian<f64>) -> Belief<f64, 4, 10> {
    let with_rate: SVector<f64, 4> = SVector::from_fn(|i, _| belief.covariance[(i, 1)]);
    let variance = with_rate[1] + told.variance;
    let mut known = *belief;
    known.mean += with_rate * ((told.mean - belief.mean[1]) / variance);
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
    let told = Gaussian { mean: 0.12, variance: 1e-14 };
    let next = filter.advance(&filtered, &prepared, None).unwrap().state;
    let next = Mixture::single(knowing_the_rate(&next.shares()[0].belief, &told), Phase::Extend);
    let back = filter.smooth_back(&filtered, &prepared, None, &next).unwrap().unwrap().moments();

    let step = Dynamics::<f64, 4, 10>::prepare(&model, 0.2);
    let transition = Dynamics::<f64, 4, 10>::transition(&model, &step, &start, Some(Phase::Extend));
    let (prior, toward) = (start.covariance.to_matrix(), transition.jacobian);
    let predicted = toward * prior * toward.transpose() + transition.noise.to_matrix();
    let with_rate = prior * toward.transpose() * vector![0.0, 1.0, 0.0, 0.0];
    let gain = with_rate / predicted[(1, 1)];
    let mean = start.mean + gain * (told.mean - transition.mean[1]);
    let covariance = prior - gain * with_rate.transpose();
    // The cut half is told its rate through a covariance of 10⁻³ against 10⁻¹⁴; rounding leaves 10⁻¹² of it.
    assert!((back.mean - mean).amax() < 1e-9, "{} {mean}", back.mean);
    assert!((back.covariance.to_matrix() - covariance).amax() < 1e-9, "{} {covariance}", back.covariance.to_matrix());
}
