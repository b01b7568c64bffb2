extern crate std;

use std::vec::Vec;

use nalgebra::SMatrix;
use proptest::prelude::*;

use super::*;

type Three = Component<f64, 3, 6>;

fn component() -> impl Strategy<Value = Three> {
    let normal = -1.0..1.0_f64;
    (prop::array::uniform3(normal.clone()), prop::array::uniform9(normal), 0.01..1.0_f64).prop_map(|(mean, root, w)| {
        let root = SMatrix::<f64, 3, 3>::from_row_slice(&root);
        let covariance = Symmetric::from_lower(&(root * root.transpose() + SMatrix::identity() * 0.01));
        let belief = Belief { mean: SVector::from(mean), covariance };
        Component { log_weight: w.ln(), phase: Phase::Extend, belief, per_inside: 1.0 }
    })
}

/// Total weight, mean and covariance by first and second moments about zero.
fn naive_moments(components: &[Three]) -> (f64, SVector<f64, 3>, SMatrix<f64, 3, 3>) {
    let (mut total, mut first, mut second) = (0.0, SVector::zeros(), SMatrix::zeros());
    for Component { log_weight, belief, .. } in components {
        let weight = log_weight.exp();
        total += weight;
        first += belief.mean * weight;
        second += (belief.covariance.to_matrix() + belief.mean * belief.mean.transpose()) * weight;
    }
    let mean = first / total;
    (total, mean, second / total - mean * mean.transpose())
}

/// Some thirty rounded sums and products of numbers of at most ten.
const ROUNDING: f64 = 1e-13;

proptest! {
    /// Hypotheses of which each is like the first: however many are added, one of that phase is left, and what the
    /// mixture says of the state and of the phases is the same.
    #[test]
    fn merging_preserves_weight_mean_and_covariance(
        first in component(), others in prop::collection::vec(component(), 1..6), apart in component(),
    ) {
        let apart = Component { phase: Phase::Hold, ..apart };
        let mut all = std::vec![first, apart];
        let mut mixture = Mixture::<f64, 3, 6, 2>::empty();
        mixture.add(&first);
        mixture.add(&apart);
        for other in others {
            // Close to what is there already in strain and rate, anywhere in the third state.
            let mut close = other;
            for i in 0..2 {
                close.belief.mean[i] = mixture.components()[0].belief.mean[i] + 0.04 * other.belief.mean[i];
            }
            mixture.add(&close);
            all.push(close);
        }
        prop_assert_eq!(mixture.components().len(), 2);
        let (total, mean, covariance) = naive_moments(&all);
        let (merged_total, merged_mean, merged_covariance) = naive_moments(mixture.components());
        prop_assert!((merged_total - total).abs() < ROUNDING);
        prop_assert!((merged_mean - mean).amax() < ROUNDING);
        prop_assert!((merged_covariance - covariance).amax() < ROUNDING);
        let Ok(log_sum) = mixture.normalise(&mut ()) else { return Err(TestCaseError::fail("weights are finite")) };
        prop_assert!((log_sum - total.ln()).abs() < ROUNDING);
        let moments = mixture.moments();
        prop_assert!((moments.mean - mean).amax() < ROUNDING);
        prop_assert!((moments.covariance.to_matrix() - covariance).amax() < ROUNDING);
        let extends: f64 = all.iter().filter(|c| c.phase == Phase::Extend).map(|c| c.log_weight.exp()).sum();
        prop_assert!((mixture.phase_probabilities()[0] - extends / total).abs() < ROUNDING);
    }

    /// Both halves of a belief, weighted with their masses, are the belief. Differences of erfc lose some digits.
    #[test]
    fn halves_of_a_cut_belief_make_the_whole(whole in component()) {
        let infinite = f64::INFINITY;
        let halves = [(0.0, infinite), (-infinite, 0.0)].map(|(lower, upper)| {
            let mut belief = whole.belief;
            let mass = keep_rate_in(&mut belief, &StrainRange { lower, upper });
            Component { log_weight: mass.ln(), belief, ..whole }
        });
        let (total, mean, covariance) = naive_moments(&halves);
        prop_assert!((total - 1.0).abs() < ROUNDING);
        // Far out, the moments of the smaller half are asymptotes, of mass 1e-8 and less.
        prop_assert!((mean - whole.belief.mean).amax() < 1e-7);
        prop_assert!((covariance - whole.belief.covariance.to_matrix()).amax() < 1e-7);
    }
}

/// In no unit are two exactly known strains that differ the same strain.
#[test]
fn exactly_known_states_are_alike_only_if_they_are_equal() {
    for unit in [1e-9, 1.0, 1e9] {
        let known = |strain: f64| Component {
            log_weight: 0.0,
            phase: Phase::Hold,
            belief: Belief::<f64, 2, 3>::independent(SVector::from([strain * unit, 0.0]), &[0.0; 2]),
            per_inside: 1.0,
        };
        assert!(known(0.1).is_like(&known(0.1)));
        assert!(!known(0.1).is_like(&known(0.2)));
    }
}

/// A mixture that is full merges its lightest hypothesis with the nearest, in units of the wider of the two: here with the
/// one that is wide already because it has been merged.
#[test]
fn the_lightest_makes_room() {
    let far = |strain: f64, log_weight: f64| Component {
        log_weight,
        phase: Phase::Extend,
        belief: Belief::<f64, 2, 3>::independent(SVector::from([strain, 0.0]), &[1e-6; 2]),
        per_inside: 1.0,
    };
    let mut mixture = Mixture::<f64, 2, 3, 2>::empty();
    for (strain, log_weight) in [(0.1, -1.0), (0.2, -3.0), (0.3, -2.0), (0.4, -4.0)] {
        mixture.add(&far(strain, log_weight));
    }
    let kept: Vec<f64> = mixture.components().iter().map(|c| c.belief.mean[0]).collect();
    let weights = [-1.0_f64, -3.0, -4.0].map(f64::exp);
    let merged = (0.1 * weights[0] + 0.2 * weights[1] + 0.4 * weights[2]) / weights.iter().sum::<f64>();
    assert!((kept[0] - merged).abs() < 1e-15 && kept[1] == 0.3, "{kept:?}");
}

/// Hypotheses on a limit that are merged, and found to be far inside later: what the limits had taken from each is given
/// back, whether they were merged or not.
#[test]
fn what_limits_took_is_given_back_after_merging() {
    let limits = StrainRange { lower: 0.0, upper: 1.0 };
    let at = |strain: f64, weight: f64| {
        let covariance = Symmetric::from_diagonal(&[1e-2, 1.0, 1.0]);
        let belief = Belief { mean: SVector::from([strain, 0.0, 0.0]), covariance };
        let mut component = Component { log_weight: weight.ln(), phase: Phase::Hold, belief, per_inside: 1.0 };
        component.weigh_limits(&limits);
        component
    };
    let inside = |mut component: Three| {
        component.belief.mean[0] = 0.5;
        component.belief.covariance[(0, 0)] = 1e-6;
        component.weigh_limits(&limits);
        component.log_weight.exp()
    };
    let (a, b) = (at(0.0, 0.3), at(-0.06, 0.7));
    assert!((a.log_weight.exp() - 0.15).abs() < 1e-15, "half of it is outside");
    let apart = inside(a) + inside(b);
    assert!((apart - 1.0).abs() < 1e-14, "{apart}");
    let merged = inside(a.merged(&b));
    assert!((merged - 1.0).abs() < 1e-14, "{merged}");
}
