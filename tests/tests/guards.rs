//! Outliers with any estimator, compared with the plain filter.

use ohmstrain_ekf::{
    Belief, Dwell, Ekf, Estimator, Evidence, Guard, Guarded, Influence, Mixture, Reading, ReadingVerdict, SignSplit,
    Streak,
};
use ohmstrain_model::{Phase, StrainRange, SwitchedModel};
use ohmstrain_tests::sensor;

type Model = SwitchedModel<f64, 1, 4>;
type Kalman = Belief<f64, 4, 10>;
const DT_S: f64 = 0.1;

fn ekf() -> Ekf<Model> {
    Ekf::new(sensor())
}

fn start() -> Kalman {
    Belief::initial(ekf().model())
}

fn sign_split() -> SignSplit<f64, 1, 4, 4> {
    let evidence = Evidence { limits: StrainRange { lower: -0.05, upper: 0.4 }, tempering: 0.8 };
    SignSplit::new(sensor(), DT_S, Some(Dwell::new(2.0, 3.0, 0.5).unwrap()), evidence).unwrap()
}

/// Runs a guard over readings; returns states and verdicts.
fn guarded<E: Estimator<f64, 4, 10>>(
    guard: Guard<f64>,
    estimator: &E,
    start: E::State,
    readings: impl Iterator<Item = Option<f64>>,
) -> (E::State, Vec<ReadingVerdict>) {
    let prepared = estimator.prepare(DT_S);
    let (mut state, mut streak, mut verdicts) = (start, Streak::default(), Vec::new());
    for reading in readings {
        let reading = reading.map(Reading::from);
        let step: Guarded<E::State, f64> = guard.advance(estimator, &state, streak, &prepared, reading).unwrap();
        (state, streak) = (step.advanced.state, step.streak);
        verdicts.push(step.verdict);
    }
    (state, verdicts)
}

fn check_spike<E: Estimator<f64, 4, 10>>(estimator: &E, start: E::State)
where
    E::State: PartialEq + std::fmt::Debug,
{
    let spiked = |spike: Option<f64>| (0..30).map(move |k| if k == 20 { spike } else { Some(0.2) });
    let gate = Guard::none().with_gate(30.0, 3).unwrap();
    let (with_spike, verdicts) = guarded(gate, estimator, start.clone(), spiked(Some(5.0)));
    let (without, _) = guarded(Guard::none(), estimator, start.clone(), spiked(None));
    assert_eq!(with_spike, without);
    assert_eq!(verdicts[20], ReadingVerdict::Rejected);
    assert_eq!(verdicts.iter().filter(|verdict| **verdict == ReadingVerdict::Accepted).count(), 29);
}

#[test]
fn a_rejected_reading_is_a_missing_one() {
    check_spike(&ekf(), start());
    check_spike(&sign_split(), Mixture::single(start(), Phase::Extend));
}

/// After 3 s at one level the readings jump by far more than the state allows: a connector was moved, for example.
/// Without patience the readings are rejected for ever; with patience the state follows once the state itself is
/// doubted.
#[test]
fn a_gate_cannot_lock_the_filter_out() {
    let jump = || (0..80).map(|k| Some(if k < 30 { 0.1 } else { 3.0 }));
    let predicted = |state: &Kalman| ekf().model().observe(&state.mean, ohmstrain_model::Direction::Known(Phase::Hold));
    let (locked, verdicts) = guarded(Guard::none().with_gate(10.8, u32::MAX).unwrap(), &ekf(), start(), jump());
    assert!(verdicts[30..].iter().all(|verdict| *verdict == ReadingVerdict::Rejected));
    assert!((predicted(&locked).value - 3.0).abs() > 1.0);
    let (recovered, verdicts) = guarded(Guard::none().with_gate(10.8, 5).unwrap(), &ekf(), start(), jump());
    assert_eq!(verdicts[30..35], [ReadingVerdict::Rejected; 5]);
    assert_eq!(verdicts[35], ReadingVerdict::Readmitted);
    assert_eq!(verdicts[60..], [ReadingVerdict::Accepted; 20]);
    assert!((predicted(&recovered).value - 3.0).abs() < 0.1);
}

/// A readmission inflates the state's covariance by the factor by which the reading exceeds the gate, at most tenfold, and
/// at most three times in a row.
#[test]
fn readmission_takes_no_more_confidence_than_it_needs() {
    let (ekf, gate, patience) = (ekf(), 10.8, 5);
    let guard = Guard::none().with_gate(gate, patience).unwrap();
    let prepared = Estimator::<f64, 4, 10>::prepare(&ekf, DT_S);
    for jump in [0.9, 1e6] {
        let (mut state, mut streak, mut factors) = (start(), Streak::default(), Vec::new());
        for k in 0..50 {
            let reading = Some(Reading::from(if k < 30 { 0.1 } else { jump }));
            let step: Guarded<Kalman, f64> = guard.advance(&ekf, &state, streak, &prepared, reading).unwrap();
            let factor = step.inflation;
            if step.verdict == ReadingVerdict::Readmitted {
                let nis = step.advanced.innovation.unwrap().nis;
                let expected = if factors.len() < 3 { (nis / gate).min(10.0) } else { 1.0 };
                assert!((factor / expected - 1.0).abs() < 1e-12, "{jump}, readmission {}: {factor}", factors.len());
                factors.push(factor);
            } else {
                assert_eq!(factor, 1.0);
            }
            (state, streak) = (step.advanced.state, step.streak);
        }
        assert!(!factors.is_empty(), "{jump}");
        assert_eq!(factors.len() > 3, jump > 1e3, "{jump}: {factors:?}");
    }
}

/// Huber's ψ: beyond the threshold, the state moves as far as at the threshold.
#[test]
fn huber_bounds_the_influence() {
    let ekf = ekf();
    let prepared = Estimator::<f64, 4, 10>::prepare(&ekf, DT_S);
    let step = |reading: f64, influence: Influence<f64>| {
        let guard = Guard::none().with_influence(influence).unwrap();
        guard.advance(&ekf, &start(), Streak::default(), &prepared, Some(Reading::from(reading))).unwrap()
    };
    let missing = Estimator::<f64, 4, 10>::advance(&ekf, &start(), &prepared, None).unwrap().state;
    let huber = Influence::Huber { threshold: 2.0 };
    let plain = step(1.0, Influence::Full).advanced.innovation.unwrap();
    let sd = plain.variance.sqrt();
    let expected = 1.0 - plain.value;
    let moved = |reading: f64| step(reading, huber).advanced.state.mean - missing.mean;
    let (at_threshold, far) = (moved(expected + 2.0 * sd), moved(expected + 50.0 * sd));
    // The same division in another order.
    assert!((at_threshold - far).amax() <= 1e-12 * at_threshold.amax());
    let inside = step(expected + 1.9 * sd, huber);
    assert_eq!((inside.verdict, inside.advanced.state), {
        let full = step(expected + 1.9 * sd, Influence::Full);
        (ReadingVerdict::Accepted, full.advanced.state)
    });
    // A threshold below one standard deviation bounds from there on, too.
    let small = step(expected + 0.7 * sd, Influence::Huber { threshold: 0.5 });
    let half = step(expected + 0.5 * sd, Influence::Full);
    assert_eq!(small.verdict, ReadingVerdict::Downweighted);
    assert!((small.advanced.state.mean - half.advanced.state.mean).amax() <= 1e-12 * half.advanced.state.mean.amax());
    // Redescending from three standard deviations: weight 9/16 at four, 9/2500 at fifty, full weight at 2.9.
    let redescending = Influence::Redescending { threshold: 3.0 };
    let gain = at_threshold / (2.0 * sd);
    for (deviations, weight) in [(2.9, 1.0), (4.0, 9.0 / 16.0), (50.0, 9.0 / 2500.0)] {
        let moved = step(expected + deviations * sd, redescending).advanced.state.mean - missing.mean;
        assert!((moved - gain * (weight * deviations * sd)).amax() < 1e-12, "{deviations}");
    }
    // Student's t with ν = 4: weight 5 / (4 + 16) at four standard deviations, 5 / (4 + 2500) at fifty, and full weight
    // at one.
    let student = Influence::StudentT { degrees_of_freedom: 4.0 };
    for (deviations, weight) in [(1.0, 1.0), (4.0, 0.25), (50.0, 5.0 / 2504.0)] {
        let moved = step(expected + deviations * sd, student).advanced.state.mean - missing.mean;
        assert!((moved - gain * (weight * deviations * sd)).amax() < 1e-12, "{deviations}");
    }
}
