//! Smoothing over hypotheses about the phase. While no hypotheses are merged, the smoother is exact: it must agree with
//! conditioning every possible phase history on all readings, one dense Gaussian each.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Dwell, Ekf, Estimator, Evidence, Hypotheses, Imm, Mixture, PastStep, PhaseMixture, Reading, State,
    smooth_back_through,
};
use ohmstrain_model::{
    Branch, Direction, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel, Transition,
};
use ohmstrain_tests::{KnownPhase, rts_smooth};

const N: usize = 4;
const L: usize = 10;
type Model = SwitchedModel<f64, 1, N>;
const STEPS: usize = 4;
/// Number of histories of four steps from one start.
const HISTORIES: usize = 81;
struct Scenario {
    dt_s: [f64; STEPS],
    rate_sd: f64,
    reading_sd: f64,
}

/// Steps whose displacements have a different sum for every history, so that none are merged, and readings that make
/// none negligible.
const APART: Scenario = Scenario { dt_s: [0.9, 2.7, 8.1, 0.3], rate_sd: 1e-3, reading_sd: 3.0 };
/// Equal steps as in a filter, and informative readings.
const EVEN: Scenario = Scenario { dt_s: [0.4; STEPS], rate_sd: 0.05, reading_sd: 0.02 };

const ANYWHERE: Evidence<f64> =
    Evidence { limits: StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY }, tempering: 1.0 };

/// Returns a model that is linear given the phases: constant gains, a straight gauge. Phases move at well-defined
/// speeds.
fn model(&Scenario { rate_sd, reading_sd, .. }: &Scenario) -> Model {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.5, 0.0, 0.0] },
        extend_viscosity_s: 0.05,
        retract_viscosity_s: -0.02,
        branches: [Branch {
            tau_s: 1.0,
            extend_gain: 0.9,
            retract_gain: -0.6,
            extend_gain_slope: 0.0,
            retract_gain_slope: 0.0,
        }],
        range: StrainRange { lower: -10.0, upper: 10.0 },
    };
    let motion = Motion::ornstein_uhlenbeck(3.0, rate_sd, 0.0, 2.0).unwrap().with_phase_rate(0.1).unwrap();
    let noise = ModelNoise { reading_sd, branch_sd: 0.01, baseline_sd: 0.05, baseline_time_s: 5.0 };
    Model::new(law, motion, noise).unwrap()
}

fn dwell() -> Dwell<f64> {
    Dwell::new(1.0, 1.5, 0.4).unwrap()
}

fn start() -> Belief<f64, N, L> {
    Belief::independent(SVector::from([0.1, 0.0, 0.02, 0.0]), &[2.5e-5, 0.0, 1e-4, 2.5e-3])
}

/// The second one is missing.
const READINGS: [Option<f64>; STEPS] = [Some(0.31), None, Some(0.52), Some(0.35)];

/// Dense Gaussian of one history over the states at times 0…STEPS, conditioned on all readings.
struct Dense {
    log_weight: f64,
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// Stacks the states of a history, each an affine function of the one before plus noise, and conditions them at once.
fn dense(phases: &[Phase], scenario: &Scenario) -> Dense {
    let (model, dt_s) = (model(scenario), scenario.dt_s);
    let size = N * (STEPS + 1);
    let (mut mean, mut covariance) = (DVector::zeros(size), DMatrix::zeros(size, size));
    mean.rows_mut(0, N).copy_from(&start().mean);
    covariance.view_mut((0, 0), (N, N)).copy_from(&start().covariance.to_matrix());
    let (mut log_weight, mut before) = (0.0, Phase::Hold);
    for (k, &phase) in phases.iter().enumerate() {
        let step = model.prepare(dt_s[k]);
        log_weight += dwell().probabilities(dt_s[k])[before.index()][phase.index()].ln();
        let at: SVector<f64, N> = mean.fixed_rows::<N>(N * k).into_owned();
        // When a movement begins, its rate is redrawn: the column of the rate is zero, with a constant and a variance
        // instead.
        let mut keep = SMatrix::<f64, N, N>::identity();
        let mut redrawn = SVector::<f64, N>::zeros();
        let mut spread = SMatrix::<f64, N, N>::zeros();
        if phase != Phase::Hold && phase != before {
            keep[(1, 1)] = 0.0;
            redrawn[1] = if phase == Phase::Extend { 0.1 } else { -0.1 };
            spread[(1, 1)] = scenario.rate_sd.powi(2);
        }
        let entered = keep * at + redrawn;
        let transition: Transition<f64, N, L> = model.transition(&step, &entered, Direction::Known(phase));
        let (jacobian, noise) = (transition.jacobian, transition.noise.to_matrix());
        mean.rows_mut(N * (k + 1), N).copy_from(&transition.mean);
        let through = jacobian * keep;
        let so_far = covariance.view((N * k, 0), (N, N * (k + 1))).into_owned();
        let cross = through * so_far;
        covariance.view_mut((N * (k + 1), 0), (N, N * (k + 1))).copy_from(&cross);
        covariance.view_mut((0, N * (k + 1)), (N * (k + 1), N)).copy_from(&cross.transpose());
        let own = covariance.view((N * k, N * k), (N, N)).into_owned();
        let new = through * own * through.transpose() + jacobian * spread * jacobian.transpose() + noise;
        covariance.view_mut((N * (k + 1), N * (k + 1)), (N, N)).copy_from(&new);
        before = phase;
    }
    let rows: Vec<usize> = (0..STEPS).filter(|&k| READINGS[k].is_some()).collect();
    let mut gradient = DMatrix::zeros(rows.len(), size);
    let mut residual = DVector::zeros(rows.len());
    for (row, &k) in rows.iter().enumerate() {
        let viscosity = model.law().viscosity_s(phases[k]);
        for (i, slope) in [1.5, viscosity, 1.0, 1.0].into_iter().enumerate() {
            gradient[(row, N * (k + 1) + i)] = slope;
        }
        residual[row] = READINGS[k].unwrap();
    }
    residual -= &gradient * &mean;
    let innovation = &gradient * &covariance * gradient.transpose()
        + DMatrix::identity(rows.len(), rows.len()) * scenario.reading_sd.powi(2);
    let inverse = innovation.clone().try_inverse().unwrap();
    log_weight -= 0.5 * (residual.transpose() * &inverse * &residual)[0] + 0.5 * innovation.determinant().ln();
    let gain = &covariance * gradient.transpose() * inverse;
    mean += &gain * residual;
    covariance -= &gain * gradient * &covariance;
    Dense { log_weight, mean, covariance }
}

/// Returns mean, covariance and phase probabilities at time k (0 is the start) over all histories.
fn enumerated(scenario: &Scenario, k: usize) -> (SVector<f64, N>, SMatrix<f64, N, N>, [f64; 3]) {
    let histories: Vec<(Vec<Phase>, Dense)> = (0..HISTORIES)
        .map(|number| (0..STEPS).map(|k| Phase::ALL[number / 3_usize.pow(k as u32) % 3]).collect())
        .map(|phases: Vec<Phase>| (phases.clone(), dense(&phases, scenario)))
        .collect();
    let total: f64 = histories.iter().map(|(_, history)| history.log_weight.exp()).sum();
    let (mut mean, mut second, mut phase_probabilities) = (SVector::zeros(), SMatrix::zeros(), [0.0; 3]);
    for (phases, history) in &histories {
        let weight = history.log_weight.exp() / total;
        let here: SVector<f64, N> = history.mean.fixed_rows::<N>(N * k).into_owned();
        mean += here * weight;
        second += (history.covariance.fixed_view::<N, N>(N * k, N * k) + here * here.transpose()) * weight;
        let phase = if k == 0 { Phase::Hold } else { phases[k - 1] };
        phase_probabilities[phase.index()] += weight;
    }
    (mean, second - mean * mean.transpose(), phase_probabilities)
}

/// Filters, then smooths; returns the smoothed states at times 0…STEPS.
fn smoothed<E: Estimator<f64, N, L>>(estimator: &E, scenario: &Scenario, start: E::State) -> Vec<E::State> {
    let (mut state, mut steps) = (start, Vec::new());
    for (reading, dt_s) in READINGS.into_iter().zip(scenario.dt_s) {
        let (reading, prepared) = (reading.map(Reading::from), estimator.prepare(dt_s));
        let advanced = estimator.advance(&state, &prepared, reading).unwrap();
        steps.push(PastStep { from: std::mem::replace(&mut state, advanced.state), prepared, reading });
    }
    let mut states = vec![state.clone()];
    smooth_back_through(estimator, &state, steps.iter().rev(), |state| {
        states.push(state.clone());
        true
    })
    .unwrap();
    states.reverse();
    states
}

#[test]
fn without_merging_it_is_the_sum_over_all_histories() {
    let filter = Hypotheses::<f64, 1, N, HISTORIES>::new(model(&APART), 0.0, dwell(), ANYWHERE).unwrap();
    let states = smoothed(&filter, &APART, Mixture::single(start(), Phase::Hold));
    assert_eq!(states[STEPS].shares().len(), HISTORIES, "histories were merged or dropped");
    for (k, state) in states.iter().enumerate() {
        let (mean, covariance, phases) = enumerated(&APART, k);
        let moments = state.moments();
        // About 81 · 20 operations on numbers below one, amplified by the condition number of a dense innovation
        // covariance (below 10): 1e-12 leaves two digits.
        assert!((moments.mean - mean).amax() < 1e-12, "time {k}");
        assert!((moments.covariance.to_matrix() - covariance).amax() < 1e-12, "time {k}");
        for (found, expected) in state.phase_probabilities().iter().zip(phases) {
            assert!((found - expected).abs() < 1e-12, "time {k}: {found} {expected}");
        }
    }
}

/// Interacting multiple models mix before every step, which is an approximation; smoothing must still reduce the error
/// of past states.
#[test]
fn the_imm_smoother_comes_nearer_than_its_filter() {
    let imm = Imm::<f64, 1, N>::new(model(&EVEN), 0.0, dwell(), ANYWHERE).unwrap();
    let states = smoothed(&imm, &EVEN, PhaseMixture::single(start(), Phase::Hold));
    let prepared = Estimator::<f64, N, L>::prepare(&imm, EVEN.dt_s[0]);
    let mut filtered = PhaseMixture::single(start(), Phase::Hold);
    let (mut smoother_error, mut filter_error) = (0.0, 0.0);
    for k in 1..STEPS {
        filtered = imm.advance(&filtered, &prepared, READINGS[k - 1].map(Reading::from)).unwrap().state;
        let (mean, _, phases) = enumerated(&EVEN, k);
        let strain_error = |state: &PhaseMixture<f64, N, L>| (state.moments().mean[0] - mean[0]).abs();
        assert!(strain_error(&states[k]) < 0.5 * strain_error(&filtered), "time {k}");
        let phase_error = |state: &PhaseMixture<f64, N, L>| {
            state
                .phase_probabilities()
                .iter()
                .zip(phases)
                .map(|(found, expected)| (found - expected).abs())
                .sum::<f64>()
        };
        smoother_error += phase_error(&states[k]);
        filter_error += phase_error(&filtered);
    }
    assert!(smoother_error < 0.5 * filter_error, "{smoother_error} {filter_error}");
}

/// Checks that with one phase every smoother is the Rauch-Tung-Striebel smoother of that phase, with a dense filter.
fn check_one_phase<E: Estimator<f64, N, L>>(estimator: &E, from: E::State, phase: Phase) {
    let ekf = Ekf::new(KnownPhase { model: model(&EVEN), phase });
    let mut belief = start();
    let prepared = estimator.prepare(0.1);
    let (mut state, mut steps, mut past) = (from, Vec::new(), Vec::new());
    for k in 0..12 {
        let reading =
            (k % 5 != 3).then(|| Reading::from(0.2 + 0.02 * f64::from(k) + 0.01 * (0.7 * f64::from(k)).sin()));
        let step = ekf.step(&belief, 0.1, reading).unwrap();
        belief = step.posterior;
        steps.push(step);
        let advanced = estimator.advance(&state, &prepared, reading).unwrap();
        past.push(PastStep { from: std::mem::replace(&mut state, advanced.state), prepared, reading });
    }
    let expected = rts_smooth(&steps);
    let mut row = expected.len() - 1;
    smooth_back_through(estimator, &state, past[1..].iter().rev(), |state| {
        row -= 1;
        let moments = state.moments();
        assert!((moments.mean - expected[row].mean).amax() < 1e-11, "{phase:?}, row {row}");
        let difference = moments.covariance.to_matrix() - expected[row].covariance.to_matrix();
        assert!(difference.amax() < 1e-11, "{phase:?}, row {row}");
        true
    })
    .unwrap();
    assert_eq!(row, 0);
}

/// A phase that lasts for ever: other phases have negligible weight.
#[test]
fn in_one_phase_it_is_rauch_tung_striebel() {
    let (model, dwell) = (model(&EVEN), Dwell::new(1e200, 1e200, 0.0).unwrap());
    for phase in [Phase::Extend, Phase::Hold] {
        let imm = Imm::<f64, 1, N>::new(model, 0.0, dwell, ANYWHERE).unwrap();
        check_one_phase(&imm, PhaseMixture::single(start(), phase), phase);
        let histories = Hypotheses::<f64, 1, N, 5>::new(model, 0.0, dwell, ANYWHERE).unwrap();
        check_one_phase(&histories, Mixture::single(start(), phase), phase);
    }
}

/// Filters and smooths readings of a wave with a gap of half a minute, and returns the largest smoothed standard deviation of
/// any state, divided by the largest filtered one.
fn widest_after_smoothing<E: Estimator<f64, N, L>>(
    estimator: &E,
    from: E::State,
    covariance: impl Fn(&E::State) -> SMatrix<f64, N, N>,
) -> f64 {
    let prepared = estimator.prepare(0.05);
    let widest = |state: &E::State, so_far: SVector<f64, N>| so_far.sup(&covariance(state).diagonal().map(f64::sqrt));
    let (mut state, mut past, mut filtered) = (from, Vec::new(), SVector::zeros());
    for k in 0..800 {
        let wave = 0.3 + 0.2 * (0.06 * f64::from(k)).sin();
        let reading = (!(100..700).contains(&k)).then(|| Reading::from(wave));
        let advanced = estimator.advance(&state, &prepared, reading).unwrap();
        past.push(PastStep { from: std::mem::replace(&mut state, advanced.state), prepared, reading });
        filtered = widest(&state, filtered);
    }
    let mut smoothed = SVector::zeros();
    smooth_back_through(estimator, &state, past.iter().rev(), |state| {
        smoothed = widest(state, smoothed);
        true
    })
    .unwrap();
    smoothed.component_div(&filtered).max()
}

/// In a gap, a smoother is no less certain than its filter, except for the distances between the means of histories. A gap carries
/// no information on decaying states, and an excess of variance from approximate merging would grow e-fold per time constant in the
/// backward pass; the gap has 30 time constants.
#[test]
fn a_gap_does_not_lead_a_smoother_astray() {
    let imm = Imm::<f64, 1, N>::new(model(&EVEN), 0.0, dwell(), ANYWHERE).unwrap();
    let of_imm = widest_after_smoothing(&imm, PhaseMixture::single(start(), Phase::Hold), |state| {
        state.moments().covariance.to_matrix()
    });
    let histories = Hypotheses::<f64, 1, N, 8>::new(model(&EVEN), 0.0, dwell(), ANYWHERE).unwrap();
    let of_histories = widest_after_smoothing(&histories, Mixture::single(start(), Phase::Hold), |state| {
        state.moments().covariance.to_matrix()
    });
    println!("{of_imm} {of_histories}");
    assert!(of_imm < 2.0 && of_histories < 2.0, "{of_imm} {of_histories}");
}
