//! Tests that recorded functions, run operation by operation, give the same bits as the kernel.

#![allow(clippy::unwrap_used, reason = "tests")]

use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel, Turning};
use std::vec::Vec;

use super::{Operation, Piece, Recorded};
use crate::kernel::tail::Tail;
use crate::kernel::{Course, Falls, Parts, RateSpread, side_of};
use crate::mixture::evidence::Weighing;
use crate::mixture::pair::{About, merge};
use crate::{Belief, Compact, Evidence, Gaussian, Reading, SparseEkf};

type Filter = SparseEkf<f32, Compact, 2, 5>;
type State = Belief<f32, 5, 15>;

/// Runs the recorded operations, with truth values as 1 and 0.
pub(super) fn run(recorded: &Recorded, inputs: &[f32]) -> Vec<f32> {
    let truth = |truth: bool| f32::from(u8::from(truth));
    let mut values: Vec<f32> = Vec::new();
    for operation in &recorded.operations {
        let at = |place: usize| values[place];
        let value = match *operation {
            Operation::Input(number) | Operation::Flag(number) => inputs[number],
            Operation::Constant(number) => number,
            Operation::Add(a, b) => at(a) + at(b),
            Operation::Subtract(a, b) => at(a) - at(b),
            Operation::Multiply(a, b) => at(a) * at(b),
            Operation::Divide(a, b) => at(a) / at(b),
            Operation::Negate(a) => -at(a),
            Operation::Root(a) => at(a).sqrt(),
            Operation::Absolute(a) => at(a).abs(),
            Operation::ExponentialLessOne(a) => at(a).exp_m1(),
            Operation::Tangent(a) => at(a).tanh(),
            Operation::AtMost(a, b) => truth(at(a) <= at(b)),
            Operation::Equal(a, b) => truth(at(a) == at(b)),
            Operation::Exponential(a) => at(a).exp(),
            Operation::Falling(a) => at(a).falling(),
            Operation::ToExponent(a) => at(a).to_exponent(),
            Operation::Tail(a) => Tail::above(at(a), true).mass,
            Operation::Hazard(tail) => match recorded.operations[tail] {
                Operation::Tail(a) => Tail::above(at(a), true).hazard,
                _ => f32::NAN,
            },
            Operation::Less(a, b) => truth(at(a) < at(b)),
            Operation::NotNegative(a) => truth(at(a) >= 0.0),
            Operation::Finite(a) => truth(at(a).is_finite()),
            Operation::Both(a, b) => truth(at(a) * at(b) == 1.0),
            Operation::Either(a, b) => truth(at(a) + at(b) > 0.0),
            Operation::Not(a) => 1.0 - at(a),
            Operation::Known(known) => truth(known),
            Operation::Pick(mask, yes, no) => at(if at(mask) == 1.0 { yes } else { no }),
        };
        values.push(value);
    }
    recorded.results.iter().map(|place| values[*place]).collect()
}

fn filter(gauge: Gauge<f32>) -> Filter {
    let branch = |tau_s, extend_gain, retract_gain| Branch {
        tau_s,
        extend_gain,
        retract_gain,
        extend_gain_slope: 0.7,
        retract_gain_slope: -0.3,
    };
    let law = SensorLaw {
        gauge,
        extend_viscosity_s: 0.03,
        retract_viscosity_s: -0.02,
        branches: [branch(0.6, 0.9, -0.6), branch(30.0, 0.4, -0.2)],
        range: StrainRange { lower: 0.0, upper: 0.3 },
    };
    let motion = Motion::ornstein_uhlenbeck(0.8, 0.1, 0.15, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
    SparseEkf::new(SwitchedModel::new(law, motion, noise).unwrap(), 0.05).unwrap()
}

/// Returns the states of a body that stretches beyond the law's range, turns and returns.
fn states(filter: &Filter) -> Vec<State> {
    let mut belief: State = Belief::initial(filter.model());
    let state = |k: i32| {
        let reading = (k % 4 != 3).then(|| Reading::from(0.6 - 0.6 * (0.1 * k as f32).cos()));
        filter.step(&mut belief, reading).unwrap();
        belief
    };
    (0..80).map(state).collect()
}

#[track_caller]
fn compare(filter: &Filter, piece: Piece, state: &State, more: &[f32], expected: &[f32]) {
    assert_eq!(more.len(), piece.inputs(Filter::carried()));
    let mut inputs: Vec<f32> = state.mean.iter().chain(state.covariance.packed()).copied().collect();
    inputs.extend(more);
    inputs.extend(filter.step_numbers());
    let found = run(&filter.record(piece), &inputs);
    // Zeros of both signs are equal here: a branch that no lane takes adds nothing, not even zero.
    assert!(found == expected, "{piece:?}: {found:?}, expected {expected:?}");
}

fn numbers(parts: &Parts<f32, 2>, state: &State) -> Vec<f32> {
    let mut state = *state;
    parts.put_into(&mut state);
    state.mean.iter().chain(state.covariance.packed()).copied().collect()
}

#[test]
fn what_is_written_down_is_what_the_kernel_does() {
    let gauges = [
        Gauge::Polynomial { coefficients: [1.9, -2.8, 1.0] },
        Gauge::DecayingExponential { slope: 3.0, decay_strain: 0.25 },
        Gauge::Tunnelling { gap: 0.8, barrier: 1.2, path_loss: -2.0 },
    ];
    for filter in gauges.map(filter) {
        let mut clear = 0;
        for state in states(&filter) {
            let predicted = |course| {
                let mut parts = Parts::of(&state);
                filter.predict::<_, Compact>(&mut parts, course);
                numbers(&parts, &state)
            };
            for phase in Phase::ALL {
                compare(&filter, Piece::Predict(phase), &state, &[], &predicted(Course::Known(phase)));
            }
            for phase in [Phase::Extend, Phase::Retract] {
                let turning = Turning { excess: 2e-3, variance: 3e-5 };
                let expected = predicted(Course::Within(phase, turning));
                let more = [turning.excess, turning.variance];
                compare(&filter, Piece::PredictTurning(phase), &state, &more, &expected);
                compare_side(&filter, &state, side_of(phase, 0.0));
            }
            compare(&filter, Piece::PredictOpen, &state, &[], &predicted(Course::Uncertain));
            for phase in Phase::ALL.map(Some).into_iter().chain([None]) {
                let mut parts = Parts::of(&state);
                let reading = Reading { value: 0.3, extra_variance: 1e-6 };
                let spread = RateSpread::<_, Compact>::new(parts.rate_variance);
                let (taken, sound) = filter.update(&mut parts, reading, phase, spread, true, |_| true);
                assert!(sound);
                let mut expected = numbers(&parts, &state);
                expected.extend([taken.innovation, taken.variance, taken.nis, 1.0]);
                compare(&filter, Piece::Take(phase), &state, &[0.3, 1e-6], &expected);
            }
            let mut parts = Parts::of(&state);
            parts.renew_rate(Gaussian { mean: 0.4, variance: 0.1 }, true);
            compare(&filter, Piece::Renew, &state, &[0.4, 0.1], &numbers(&parts, &state));
            compare(&filter, Piece::Sound, &state, &[], &[1.0]);
            clear += usize::from(state.mean[1].powi(2) > 9.0 * state.covariance[(1, 1)]);
        }
        // Rates with a certain direction, and others.
        assert!(clear > 5 && clear < 70, "{clear}");
    }
}

/// Compares the pieces for a side of zero with the kernel, on a state.
fn compare_side(filter: &Filter, state: &State, side: f32) {
    let (parts, clear) = (Parts::of(state), -2.0 * f32::EPSILON.ln());
    let truth = |truth: bool| f32::from(u8::from(truth));
    let turning = filter.turning::<_, Compact>(side, &parts, true);
    compare(filter, Piece::Turns, state, &[side], &[turning.excess, turning.variance]);
    compare(filter, Piece::Hopeless, state, &[side], &[truth(filter.is_hopeless(side, &parts))]);
    let (certain, cut) = parts.certain_of_side(side, clear, true);
    compare(filter, Piece::CertainOfSide, state, &[side], &[certain, truth(cut)]);
    if cut {
        let mut left = parts;
        let mass = left.cut_off::<Compact, 5>(side, true);
        let mut expected = numbers(&left, state);
        expected.push(mass);
        compare(filter, Piece::CutOff, state, &[side], &expected);
    }
}

/// States of the same motion, near each other and far apart, with limits around, at and short of the states.
#[test]
fn what_is_written_down_of_pairs_and_limits_is_what_hypotheses_do() {
    let filter = filter(Gauge::Polynomial { coefficients: [1.9, -2.8, 1.0] });
    let states = states(&filter);
    let truth = |truth: bool| f32::from(u8::from(truth));
    let (mut alike, mut near) = (0, 0);
    for (k, state) in states.iter().enumerate() {
        let other = &states[(k + 1 + 7 * (k % 2)) % states.len()];
        let (parts, others): (Parts<f32, 2>, Parts<f32, 2>) = (Parts::of(state), Parts::of(other));
        let mut more: Vec<f32> = other.mean.iter().chain(other.covariance.packed()).copied().collect();
        let is_alike = About::of(&parts).is_like(&About::of(&others));
        compare(&filter, Piece::Alike, state, &more, &[truth(is_alike)]);
        let distance = About::of(&parts).distance(&About::of(&others));
        compare(&filter, Piece::Distance, state, &more, &[distance]);
        let mut pair = *state;
        let own = (pair.mean.iter_mut(), pair.covariance.packed_mut().iter_mut());
        merge(own, (&other.mean.into(), other.covariance.packed().iter()), [0.3, 0.7]);
        more.extend([0.3, 0.7]);
        compare(&filter, Piece::Merge, state, &more, &numbers(&Parts::of(&pair), state));
        let limits = StrainRange { lower: 0.01, upper: 0.2 };
        let weighing = Weighing::new(Evidence { limits, tempering: 1.0 });
        let strain = (parts.strain, parts.strain_variance);
        let expected = weighing.of_limits::<_, Compact>(strain, 1.5, true);
        compare(&filter, Piece::OfLimits, state, &[1.5, limits.lower, limits.upper], &expected);
        alike += usize::from(is_alike);
        near += usize::from(expected[1] != 1.0);
    }
    assert!(alike > 2 && alike < 75 && near > 5 && near < 75, "{alike} {near}");
    for border in [-5.0, -0.3, 0.4, 2.0, 7.0, f32::INFINITY] {
        let Tail { mass, hazard } = Tail::above(border, true);
        compare(&filter, Piece::Tail, &states[0], &[border], &[hazard, mass]);
    }
}

#[test]
fn a_state_that_is_none_is_not_sound() {
    let filter = filter(Gauge::Polynomial { coefficients: [1.9, -2.8, 1.0] });
    let mut state = states(&filter)[3];
    state.covariance[(2, 2)] = -1e-9;
    compare(&filter, Piece::Sound, &state, &[], &[0.0]);
    state.covariance[(2, 2)] = f32::NAN;
    compare(&filter, Piece::Sound, &state, &[], &[0.0]);
}

/// Setting the numbers of another step length one by one gives the filter of that length.
#[test]
fn a_step_of_other_numbers_is_a_step_of_another_length() {
    let mut filter = filter(Gauge::Polynomial { coefficients: [1.9, -2.8, 1.0] });
    let mut longer = filter;
    longer.retime(0.07).unwrap();
    filter.set_step(0.07, &longer.step_numbers());
    assert_eq!(filter, longer);
    let names = filter.step_names();
    assert_eq!(names.len(), filter.step_numbers().len());
    for name in ["to_strain_1", "b0_decay_0", "b1_decay_0", "b1_branch_noise_1", "b1_per_reach_0"] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
}
