//! Filters of phase hypotheses: the chain between phases is a Markov chain in continuous time; predictions have the
//! moments of all phase histories; limits count once; stretching and releasing are distinguished.

use nalgebra::{Matrix3, SVector};
use ohmstrain_ekf::{
    Belief, Dwell, Estimator, Evidence, Hypotheses, Imm, Mixture, PhaseMixture, Reading, SignSplit, State,
};
use ohmstrain_model::{Direction, Motion, Phase, StrainRange, SwitchedModel, Symmetric, Transition};
use ohmstrain_tests::switching_sensor;
use proptest::prelude::*;

const ANYWHERE: Evidence<f64> = within(f64::NEG_INFINITY, f64::INFINITY);

const fn within(lower: f64, upper: f64) -> Evidence<f64> {
    Evidence { limits: StrainRange { lower, upper }, tempering: 1.0 }
}

proptest! {
    /// exp(generator · dt) by nalgebra's Padé approximant, and one step equals two.
    #[test]
    fn phases_follow_a_markov_chain(
        hold in 0.1..100.0_f64, moving in 0.1..100.0_f64, reversal in 0.0..1.0_f64, a in 0.0..5.0_f64, b in 0.0..5.0_f64,
    ) {
        let dwell = Dwell::new(hold, moving, reversal).unwrap();
        let matrix = |dt: f64| {
            let rows = dwell.probabilities(dt);
            Matrix3::from_fn(|i, j| rows[i][j])
        };
        let (stop, turn, start) = ((1.0 - reversal) / moving, reversal / moving, 0.5 / hold);
        let generator = Matrix3::new(
            -stop - turn, stop, turn,
            start, -2.0 * start, start,
            turn, stop, -stop - turn,
        );
        prop_assert!((matrix(a) - (generator * a).exp()).amax() < 1e-12);
        prop_assert!((matrix(a + b) - matrix(a) * matrix(b)).amax() < 1e-12);
        for row in dwell.probabilities(a) {
            prop_assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            prop_assert!(row.iter().all(|p| *p >= -1e-16));
        }
    }
}

const DT_S: f64 = 0.2;

/// One history of phases: its probability, its last phase, and the state given the history.
struct History {
    probability: f64,
    phase: Phase,
    belief: Belief<f64, 3, 6>,
}

/// Returns the belief when a moving phase begins: its rate is that of the phase, independent of everything else.
fn enter(from: &Belief<f64, 3, 6>, phase: Phase) -> Belief<f64, 3, 6> {
    let (mut entered, motion) = (*from, *switching_sensor().motion());
    for j in 0..3 {
        entered.covariance[(1, j)] = 0.0;
    }
    entered.mean[1] = if phase == Phase::Retract { -motion.phase_rate() } else { motion.phase_rate() };
    entered.covariance[(1, 1)] = motion.stationary_variance()[1];
    entered
}

/// Returns all 3ⁿ histories of n steps.
fn every_history(dwell: Dwell<f64>, start: History, steps: usize) -> Vec<History> {
    let model = switching_sensor();
    let chain = dwell.probabilities(DT_S);
    let mut histories = vec![start];
    for _ in 0..steps {
        let mut longer = Vec::new();
        for from in &histories {
            for phase in Phase::ALL {
                let begins = phase != Phase::Hold && phase != from.phase;
                let entered = if begins { enter(&from.belief, phase) } else { from.belief };
                let moved: Transition<f64, 3, 6> =
                    model.transition(&model.prepare(DT_S), &entered.mean, Direction::Known(phase));
                let f = moved.jacobian;
                let spread = f * entered.covariance.to_matrix() * f.transpose() + moved.noise.to_matrix();
                longer.push(History {
                    probability: from.probability * chain[from.phase.index()][phase.index()],
                    phase,
                    belief: Belief { mean: moved.mean, covariance: Symmetric::from_lower(&spread) },
                });
            }
        }
        histories = longer;
    }
    histories
}

/// Checks that mixing and merging without readings preserve the first two moments of the sum over all histories. Every change of
/// phase has a probability of at least 0.07 here, so no history is lighter than 0.07⁴ = 2.4e-5, and none is dropped as
/// negligible, below e⁻¹² = 6e-6.
fn check_prediction<E: Estimator<f64, 3, 6>>(
    filter: &E,
    from: E::State,
    dwell: Dwell<f64>,
    start: Belief<f64, 3, 6>,
) -> Result<(), TestCaseError> {
    let (mut mixture, prepared) = (from, filter.prepare(DT_S));
    for steps in 1..=4 {
        mixture = filter.advance(&mixture, &prepared, None).unwrap().state;
        let histories = every_history(dwell, History { probability: 1.0, phase: Phase::Hold, belief: start }, steps);
        for phase in Phase::ALL {
            let expected: f64 = histories.iter().filter(|h| h.phase == phase).map(|h| h.probability).sum();
            prop_assert!((mixture.phases().unwrap()[phase.index()] - expected).abs() < 1e-13);
        }
        let mean: SVector<f64, 3> = histories.iter().map(|h| h.belief.mean * h.probability).sum();
        let second: Matrix3<f64> = histories
            .iter()
            .map(|h| (h.belief.covariance.to_matrix() + h.belief.mean * h.belief.mean.transpose()) * h.probability)
            .sum();
        let moments = mixture.moments();
        // Numbers up to one, about 3⁴ sums.
        prop_assert!((moments.mean - mean).amax() < 1e-13);
        prop_assert!((moments.covariance.to_matrix() - (second - mean * mean.transpose())).amax() < 1e-13);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn predictions_have_the_moments_of_all_histories(
        hold in 0.2..0.6_f64, moving in 0.2..0.6_f64, reversal in 0.3..0.7_f64, strain in -0.2..0.2_f64, branch in -0.2..0.2_f64,
    ) {
        let dwell = Dwell::new(hold, moving, reversal).unwrap();
        let start: Belief<f64, 3, 6> = Belief::independent(SVector::from([strain, 0.0, branch]), &[1e-3, 0.0, 1e-3]);
        let imm = Imm::<f64, 1, 3>::new(switching_sensor(), DT_S, dwell, ANYWHERE).unwrap();
        check_prediction(&imm, PhaseMixture::single(start, Phase::Hold), dwell, start)?;
        let hypotheses = Hypotheses::<f64, 1, 3, 81>::new(switching_sensor(), DT_S, dwell, ANYWHERE).unwrap();
        check_prediction(&hypotheses, Mixture::single(start, Phase::Hold), dwell, start)?;
    }
}

/// A body at rest at a limit: the evidence of the limit counts once, not at each of a thousand steps.
#[test]
fn a_thousand_steps_at_rest_on_a_limit_change_nothing() {
    let evidence = within(0.0, 0.3);
    let dwell = Dwell::new(1e9, 1.0, 0.3).unwrap();
    let start: Belief<f64, 3, 6> = Belief::independent(SVector::zeros(), &[1e-4, 0.0, 0.0]);
    let filter = Hypotheses::<f64, 1, 3, 8>::new(switching_sensor(), DT_S, dwell, evidence).unwrap();
    let mut mixture = Mixture::<f64, 3, 6, 8>::single(start, Phase::Hold);
    filter.step(&mut mixture, None).unwrap();
    let first = mixture.moments();
    for _ in 0..1000 {
        filter.step(&mut mixture, None).unwrap();
    }
    let last = mixture.moments();
    assert!((last.mean[0] - first.mean[0]).abs() < 1e-6, "{} {}", last.mean[0], first.mean[0]);
    assert!((last.covariance[(0, 0)] / first.covariance[(0, 0)] - 1.0).abs() < 1e-3);
}

/// Stretching and releasing both raise R here. The sign-split filter must infer the direction.
#[test]
fn sign_split_tells_stretching_from_releasing() {
    let motion = Motion::ornstein_uhlenbeck(0.7, 0.1, 0.15, 0.12).unwrap();
    let law = *switching_sensor().law();
    let noise = *switching_sensor().noise();
    let model = SwitchedModel::<f64, 1, 3>::new(law, motion, noise).unwrap();
    let filter = SignSplit::<f64, 1, 3, 8>::new(model, 0.05, None, within(-0.2, 0.5)).unwrap();
    let start: Belief<f64, 3, 6> = Belief::initial(&model);
    let mut mixture = Mixture::<f64, 3, 6, 8>::single(start, Phase::Extend);
    let mut branch = 0.0;
    let (mut right, mut counted) = (0, 0);
    let mut before = 0.15;
    for k in 0..2000 {
        // A naive sensor: strain a sine, branch by explicit Euler steps of the same law.
        let strain = 0.15 + 0.12 * (f64::from(k) * 0.05).sin();
        let step = strain - before;
        branch += (if step > 0.0 { 1.0 } else { -0.8 }) * step - branch * 0.05 / 3.0;
        before = strain;
        let reading = Some(Reading::from(1.5 * strain + branch));
        filter.step(&mut mixture, reading).unwrap();
        let speed = step.abs() / 0.05;
        if k > 400 && speed > 0.03 {
            let [extends, _, _] = mixture.phase_probabilities();
            right += u32::from((extends > 0.5) == (step > 0.0));
            counted += 1;
        }
    }
    assert!(f64::from(right) > 0.95 * f64::from(counted), "{right} of {counted}");
}
