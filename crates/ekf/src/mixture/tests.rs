#![allow(clippy::unwrap_used, reason = "tests")]

extern crate std;

use core::marker::PhantomData;
use std::vec::Vec;

use nalgebra::{SMatrix, vector};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};
use proptest::prelude::*;

use super::children::Children;
use super::evidence::{Weighed, Weighing, Weight};
use super::spawn::{MixtureStep, Spawns};
use super::state::Share;
use super::*;
use crate::kernel::{Parts, side_of};
use crate::{Estimator, Logistic, Reading, SignSplit, State as _};

/// Strain, rate, baseline.
type One = (f64, Belief<f64, 3, 6>);

fn one() -> impl Strategy<Value = One> {
    let normal = -1.0..1.0_f64;
    (prop::array::uniform3(normal.clone()), prop::array::uniform9(normal), 0.01..1.0_f64).prop_map(|(mean, root, w)| {
        let root = SMatrix::<f64, 3, 3>::from_row_slice(&root);
        let covariance = Symmetric::from_lower(&(root * root.transpose() + SMatrix::identity() * 0.01));
        (w, Belief { mean: SVector::from(mean), covariance })
    })
}

/// Returns total weight, mean and covariance from first and second moments about zero.
fn naive_moments(all: &[One]) -> (f64, SVector<f64, 3>, SMatrix<f64, 3, 3>) {
    let (mut total, mut first, mut second) = (0.0, SVector::zeros(), SMatrix::zeros());
    for (weight, belief) in all {
        total += weight;
        first += belief.mean * *weight;
        second += (belief.covariance.to_matrix() + belief.mean * belief.mean.transpose()) * *weight;
    }
    let mean = first / total;
    (total, mean, second / total - mean * mean.transpose())
}

fn weighed(weight: f64, exponent: f64) -> Weighed<f64> {
    Weighed { weight: Weight { factor: weight, exponent }, more_inside: 1.0, per_inside: 1.0 }
}

fn add<const K: usize>(children: &mut Children<'_, f64, 3, 6, K>, (weight, belief): &One, phase: Phase) {
    children.add(&Parts::<f64, 0>::of(belief), 0, phase, &weighed(*weight, 0.0));
}

fn kept(mixture: &Mixture<f64, 3, 6, 2>) -> Vec<One> {
    mixture.shares().iter().map(|Share { weight, belief, .. }| (*weight, *belief)).collect()
}

/// About thirty rounded sums and products of numbers up to ten.
const ROUNDING: f64 = 1e-13;

proptest! {
    /// Merges hypotheses similar to the first: however many are added, one of that phase remains, and the mixture's
    /// moments and phase probabilities are preserved.
    #[test]
    fn merging_preserves_weight_mean_and_covariance(
        first in one(), others in prop::collection::vec(one(), 1..6), apart in one(),
    ) {
        let mut all = std::vec![first, apart];
        let mut mixture = Mixture::<f64, 3, 6, 2>::empty();
        let mut children = Children::new(&mut mixture, usize::MAX);
        add(&mut children, &first, Phase::Extend);
        add(&mut children, &apart, Phase::Hold);
        for (weight, mut close) in others {
            // Close to the first one in strain and rate, anywhere in the third state.
            let (_, mean, _) = naive_moments(&[&all[..1], &all[2..]].concat());
            for i in 0..2 {
                close.mean[i] = mean[i] + 0.04 * close.mean[i];
            }
            add(&mut children, &(weight, close), Phase::Extend);
            all.push((weight, close));
        }
        let (total, mean, covariance) = naive_moments(&all);
        prop_assert!((children.density().factor - total).abs() < ROUNDING);
        prop_assert!(children.normalise::<0>(&mut ()).is_ok());
        prop_assert_eq!(mixture.shares().len(), 2);
        let (merged_total, merged_mean, merged_covariance) = naive_moments(&kept(&mixture));
        prop_assert!((merged_total - 1.0).abs() < ROUNDING);
        prop_assert!((merged_mean - mean).amax() < ROUNDING);
        prop_assert!((merged_covariance - covariance).amax() < ROUNDING);
        prop_assert!((mixture.phase_probabilities()[1] - apart.0 / total).abs() < ROUNDING);
    }

    /// The mixture of both halves of a truncated belief, weighted with their masses, is the belief. Differences of erfc
    /// lose some digits.
    #[test]
    fn halves_of_a_cut_belief_make_the_whole((_, whole) in one()) {
        let halves = [Phase::Extend, Phase::Retract].map(|phase| {
            let (mut parts, mut half) = (Parts::<f64, 0>::of(&whole), whole);
            let mass = parts.cut_rate::<Logistic, 3>(side_of(phase, 0.0), f64::INFINITY, true);
            parts.put_into(&mut half);
            (mass, half)
        });
        let (total, mean, covariance) = naive_moments(&halves);
        prop_assert!((total - 1.0).abs() < ROUNDING);
        // Far out, the moments of the smaller half are asymptotic, with masses of 1e-8 and less.
        prop_assert!((mean - whole.mean).amax() < 1e-7);
        prop_assert!((covariance - whole.covariance.to_matrix()).amax() < 1e-7);
    }
}

/// Weights `wᵢ exp(xᵢ)` over their sum, in any order; a single one need not be representable.
#[test]
fn no_single_weight_need_be_a_number() {
    let parts = [(0.2, 0.0), (0.5, -1.0), (0.3, 2.0)];
    let total: f64 = parts.iter().map(|(weight, exponent): &(f64, f64)| weight * exponent.exp()).sum();
    for shift in [0.0, -2000.0, 2000.0] {
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            let mut mixture = Mixture::<f64, 3, 6, 3>::empty();
            let mut children = Children::new(&mut mixture, usize::MAX);
            for k in order {
                let belief: Belief<f64, 3, 6> = Belief::independent(vector![k as f64, 0.0, 0.0], &[1e-6; 3]);
                let weighed = weighed(parts[k].0, parts[k].1 + shift);
                children.add(&Parts::<f64, 0>::of(&belief), 0, Phase::Extend, &weighed);
            }
            let density = children.density();
            assert!((density.factor.ln() + density.exponent - shift - total.ln()).abs() < 1e-12, "{shift} {order:?}");
            children.normalise::<0>(&mut ()).unwrap();
            for (share, k) in mixture.shares().iter().zip(order) {
                assert!((share.weight - parts[k].0 * parts[k].1.exp() / total).abs() < 1e-12, "{shift} {order:?}");
            }
        }
    }
}

/// A full mixture merges its lightest hypothesis with the nearest, in units of the wider of the two: here with the one
/// that is already wide from an earlier merge.
#[test]
fn the_lightest_makes_room() {
    let mut mixture = Mixture::<f64, 3, 6, 2>::empty();
    let mut children = Children::new(&mut mixture, usize::MAX);
    for (strain, log_weight) in [(0.1, -1.0_f64), (0.2, -3.0), (0.3, -2.0), (0.4, -4.0)] {
        let belief = Belief::independent(vector![strain, 0.0, 0.0], &[1e-6; 3]);
        add(&mut children, &(log_weight.exp(), belief), Phase::Extend);
    }
    let strains: Vec<f64> = mixture.shares().iter().map(|share| share.belief.mean[0]).collect();
    let weights = [-1.0_f64, -3.0, -4.0].map(f64::exp);
    let merged = (0.1 * weights[0] + 0.2 * weights[1] + 0.4 * weights[2]) / weights.iter().sum::<f64>();
    assert!((strains[0] - merged).abs() < 1e-15 && strains[1] == 0.3, "{strains:?}");
}

/// Two exactly known strains that differ are not alike in any unit.
#[test]
fn exactly_known_states_are_alike_only_if_they_are_equal() {
    for unit in [1e-9, 1.0, 1e9] {
        let mut mixture = Mixture::<f64, 3, 6, 8>::empty();
        let mut children = Children::new(&mut mixture, usize::MAX);
        for strain in [0.1, 0.1, 0.2] {
            let belief = Belief::independent(vector![strain * unit, 0.0, 0.0], &[0.0; 3]);
            add(&mut children, &(1.0, belief), Phase::Hold);
        }
        assert_eq!(mixture.shares().len(), 2);
    }
}

/// Merges hypotheses at a limit that are later found far inside: each regains the weight that the limits had taken.
#[test]
fn what_limits_took_is_given_back_after_merging() {
    let limits = StrainRange { lower: 0.0, upper: 1.0 };
    let weighing = Weighing::new(Evidence::new(limits, 1.0).unwrap());
    let at = |strain: f64, variance: f64, per_inside: f64| {
        let belief: Belief<f64, 3, 6> = Belief::independent(vector![strain, 0.0, 0.0], &[variance, 1.0, 1.0]);
        let parts = Parts::<f64, 0>::of(&belief);
        let [more_inside, per_inside] =
            weighing.of_limits::<f64, Logistic>((parts.strain, parts.strain_variance), per_inside, true);
        (parts, more_inside, per_inside)
    };
    let mut mixture = Mixture::<f64, 3, 6, 2>::empty();
    let mut children = Children::new(&mut mixture, usize::MAX);
    let mut taken = 0.0;
    for (strain, weight) in [(0.0, 0.3), (-0.06, 0.7)] {
        let (parts, more_inside, per_inside) = at(strain, 1e-2, 1.0);
        taken += weight * (1.0 - more_inside);
        children.add(&parts, 0, Phase::Hold, &Weighed { more_inside, per_inside, ..weighed(weight, 0.0) });
    }
    let [merged]: [Share<f64, 3, 6>; 1] = mixture.shares().try_into().unwrap();
    assert!(taken > 0.6 && (merged.weight + taken - 1.0).abs() < 1e-14, "{taken} {}", merged.weight);
    let (_, more_inside, _) = at(0.5, 1e-6, merged.per_inside);
    assert!((merged.weight * more_inside - 1.0).abs() < 1e-14, "{}", merged.weight * more_inside);
}

type Split = SignSplit<f64, 0, 3, 4>;
type State = Mixture<f64, 3, 6, 4>;

fn split() -> Split {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.5, 0.0, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [],
        range: StrainRange { lower: -1.0, upper: 1.0 },
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.01, 0.0, f64::INFINITY).unwrap();
    let noise = ModelNoise { reading_sd: 1e-3, branch_sd: 0.0, baseline_sd: 0.02, baseline_time_s: 30.0 };
    let model = SwitchedModel::new(law, motion, noise).unwrap();
    Split::new(model, 0.1, None, Evidence::new(StrainRange { lower: -9.0, upper: 9.0 }, 1.0).unwrap()).unwrap()
}

/// Returns a state with strains 0, -0.5 and 0.5, with room for the children of two.
fn of(weights: &[f64]) -> State {
    let mut state = State::empty();
    for (strain, weight) in [0.0, -0.5, 0.5].into_iter().zip(weights.iter().copied()) {
        let (share, phase) = state.one_more().unwrap();
        share.belief = Belief::independent(vector![strain, 0.0, 0.0], &[1e-4, 1e-4, 4e-4]);
        (share.weight, *phase) = (weight, Phase::Extend);
    }
    state
}

fn back(state: &State, next: &State) -> State {
    let split = split();
    split.smooth_back(state, &split, None, next).unwrap()
}

fn weights(state: &State) -> Vec<f64> {
    state.shares().iter().map(|share| share.weight).collect()
}

/// Two hypotheses have weights within the margin in which neither counts as lighter. The children that came first are kept,
/// those of the heavier one are merged with the nearest. After the step the strain is known to be that of the first, so it
/// was that before.
#[test]
fn a_smoother_goes_back_along_what_ran_forward_at_a_tie() {
    let state = of(&[0.998, 1e-3 * (1.0 - 0.5 * LIGHTER), 1e-3]);
    let mut next = state;
    split().step(&mut next, None).unwrap();
    for (share, _) in next.iter_mut() {
        share.weight = if (share.belief.mean[0] + 0.5).abs() < 0.1 { 0.5 } else { 1e-12 };
    }
    assert_eq!(weights(&next), [1e-12, 1e-12, 0.5, 0.5], "the first are kept");
    let back = back(&state, &next);
    let weights = weights(&back);
    assert!(weights[1] > 0.999 && weights[2] < 1e-9, "{weights:?}");
    assert!((back.shares()[1].belief.mean[0] + 0.5).abs() < 0.01);
}

/// Negligible hypotheses are dropped after a step, and the others move up: of two, the smoother follows the second.
#[test]
fn what_moves_up_is_followed() {
    let state = of(&[1e-8, 1.0]);
    let mut next = state;
    split().step(&mut next, None).unwrap();
    assert!(next.shares().iter().all(|share| (share.belief.mean[0] + 0.5).abs() < 0.1), "the first is not dropped");
    let back = back(&state, &next);
    let weights = weights(&back);
    assert!(weights[0] < 1e-6 && weights[1] > 0.999, "{weights:?}");
    let (known, smoothed) = (&state.shares()[1].belief, &back.shares()[1].belief);
    assert!((known.mean - smoothed.mean).amax() < 1e-9, "{smoothed:?}");
}

/// A step without new information changes no weight, by the law of total probability. Without a reading nothing is lost: a
/// hypothesis without room is merged with the nearest, whether it was displaced (the last is the heavier) or came too late (the
/// last is the lighter).
#[test]
fn what_was_merged_is_followed() {
    for filtered in [[0.997, 1e-3, 2e-3], [0.997, 2e-3, 1e-3]] {
        let state = of(&filtered);
        let mut next = state;
        split().step(&mut next, None).unwrap();
        for (back, filtered) in weights(&back(&state, &next)).iter().zip(filtered) {
            assert!((back / filtered - 1.0).abs() < 1e-9, "{back} after all, {filtered} before");
        }
    }
}

/// Recorder that forces the filter to step every child separately.
struct Listener;

impl super::lineage::Recorder<f64, 2> for Listener {}

/// A body that moves to and fro with rests, near both limits; some readings are missing or outliers.
fn reading_at(k: usize) -> Option<Reading<f64>> {
    let t = k as f64;
    let slow = 0.22 + 0.24 * (t * 0.01).sin().clamp(-0.8, 0.8);
    let wild = if k % 97 == 5 { 0.4 } else { 0.0 };
    let noise = 1e-3 * ((t * 2.9).sin() + (t * 7.3).cos());
    (k % 7 != 3).then_some(Reading { value: slow + noise + wild, extra_variance: 1e-7 })
}

fn in_vectors_and_one_by_one<F: Spawns<f64, 2, 5>>(filter: &F, start: &Belief<f64, 5, 15>) -> usize {
    let mut state = Mixture::<f64, 5, 15, 8>::single(*start, Phase::Hold);
    let (mut together, mut alone, mut most) = (Mixture::empty(), Mixture::empty(), 0);
    for k in 0..3000 {
        let step = |next, listens: bool| {
            let step =
                MixtureStep { filter, state: &state, reading: reading_at(k), next, open: false, branches: PhantomData };
            if listens { step.done(&mut Listener) } else { step.done(&mut ()) }
        };
        assert_eq!(step(&mut together, false), step(&mut alone, true), "row {k}");
        // Unused places keep their previous content.
        assert_eq!((together.shares(), together.phases()), (alone.shares(), alone.phases()), "row {k}");
        state = alone;
        most = most.max(state.shares().len());
    }
    most
}

/// Vectors give the same result as scalars, to the last bit: no result may depend on the processor's vectors, or on a
/// recorder. On a processor without vectors the test has no effect.
#[test]
fn vectors_give_the_bits_of_numbers() {
    let branch = |tau_s, slope| Branch {
        tau_s,
        extend_gain: 0.3,
        retract_gain: -0.2,
        extend_gain_slope: slope,
        retract_gain_slope: -0.1,
    };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.4] },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        branches: [branch(4.0, -0.2), branch(60.0, 0.1)],
        range: StrainRange { lower: 0.0, upper: 0.3 },
    };
    let motion = Motion::ornstein_uhlenbeck(0.5, 0.1, 0.15, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
    let model = SwitchedModel::<f64, 2, 5>::new(law, motion, noise).unwrap();
    let start = Belief::initial(&model);
    let dwell = Dwell::new(0.7, 1.5, 0.3).unwrap();
    for tempering in [1.0, 0.5] {
        let evidence = Evidence { limits: StrainRange { lower: 0.0, upper: 0.2 }, tempering };
        for hold in [Some(dwell), None] {
            let split = SignSplit::<_, 2, 5, 8>::new(model, 0.01, hold, evidence).unwrap();
            assert!(in_vectors_and_one_by_one(&split, &start) > 4);
        }
        let histories = Hypotheses::<_, 2, 5, 8>::new(model, 0.01, dwell, evidence).unwrap();
        assert!(in_vectors_and_one_by_one(&histories, &start) > 4);
    }
}

/// An added state gets the free place, or that of the lightest, with its share; the ratios of the others are preserved.
#[test]
fn what_is_followed_too_has_its_share_and_the_others_keep_theirs() {
    let belief = |strain: f64| Belief::<f64, 3, 6>::independent(vector![strain, 0.0, 0.0], &[1e-4; 3]);
    let mut mixture = Mixture::<f64, 3, 6, 2>::empty();
    let mut children = Children::new(&mut mixture, usize::MAX);
    for (weight, strain) in [(0.25, 0.1), (1.0, 0.9)] {
        add(&mut children, &(weight, belief(strain)), Phase::Extend);
    }
    let other = Mixture::single(belief(0.5), Phase::Hold);
    let components = |mixture: &Mixture<f64, 3, 6, 2>| -> Vec<(f64, f64, Phase)> {
        let phases = mixture.phases().iter();
        mixture.shares().iter().zip(phases).map(|(share, phase)| (share.belief.mean[0], share.weight, *phase)).collect()
    };
    // No place is free: the lighter one is dropped.
    assert_eq!(components(&mixture.beside(&other, 0.25)), [(0.5, 0.25, Phase::Hold), (0.9, 0.75, Phase::Extend)]);
    let alone = Mixture::<f64, 3, 6, 2>::single(belief(0.1), Phase::Extend);
    assert_eq!(components(&alone.beside(&other, 0.25)), [(0.1, 0.75, Phase::Extend), (0.5, 0.25, Phase::Hold)]);
    // One Gaussian has no room.
    assert_eq!(belief(0.1).beside(&belief(0.5), 0.25), belief(0.1));
}
