use ohmstrain_model::Phase;

use crate::StepError;
use crate::gaussian::Real;
use crate::mixture::{ALIKE, LEAST_WEIGHT};
use crate::sparse_evidence::Weight;
use crate::sparse_gaussian::Working;
use crate::sparse_mixture::{Share, SignMixture};

/// Collects the children of a step: keeps, merges and drops them as [`Mixture`](crate::Mixture) does.
pub(crate) struct Children<T, const N: usize, const L: usize, const K: usize> {
    kept: SignMixture<T, N, L, K>,
    /// The largest exponent so far; weights are in units of its exponential. What is so much lighter that it has become
    /// zero would be dropped in the end.
    exponent: T,
}

impl<T: Real, const N: usize, const L: usize, const K: usize> Children<T, N, L, K> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { kept: SignMixture::empty(), exponent: T::zero() }
    }

    /// Adds a child: merged with one that says the same, in a free place, or in the place of the lightest.
    pub(crate) fn add(&mut self, child: &Working<T, N>, phase: Phase, weight: Weight<T>, log_inside: T) {
        self.raise_to(weight.exponent);
        let weight = weight.relative_to(self.exponent);
        let like = self.kept.iter_mut().find(|(share, known)| **known == phase && share.is_like(child));
        if let Some((like, _)) = like {
            like.merge(child, weight, log_inside);
            return;
        }
        let share = |child: &Working<T, N>| Share { weight, belief: child.belief(), log_inside };
        if self.kept.shares().len() < K {
            self.kept.push(share(child), phase);
            return;
        }
        let lighter = |a, b| if Self::weight_of(&b) < Self::weight_of(&a) { b } else { a };
        if let Some((place, of)) = self.kept.iter_mut().reduce(lighter).filter(|lightest| lightest.0.weight < weight) {
            (*place, *of) = (share(child), phase);
        }
    }

    fn weight_of(place: &(&mut Share<T, N, L>, &mut Phase)) -> T {
        place.0.weight
    }

    /// Makes room for a larger exponent: the weights so far are given in units of its exponential.
    fn raise_to(&mut self, exponent: T) {
        let first = self.kept.shares().is_empty();
        if first || exponent > self.exponent {
            let fewer = if first { T::one() } else { (self.exponent - exponent).exp() };
            for (share, _) in self.kept.iter_mut() {
                share.weight *= fewer;
            }
            self.exponent = exponent;
        }
    }

    /// Makes the probabilities sum to one and drops what is negligible; the sum before.
    pub(crate) fn normalise(&mut self) -> Result<Weight<T>, StepError> {
        let heaviest = self.kept.shares().iter().fold(T::zero(), |a, b| if b.weight > a { b.weight } else { a });
        let least = heaviest * T::of(LEAST_WEIGHT);
        self.kept.retain(|share| share.weight > least);
        let factor = self.kept.shares().iter().fold(T::zero(), |sum, share| sum + share.weight);
        if !(factor > T::zero() && factor.is_finite()) {
            return Err(StepError::NonFiniteState);
        }
        let per_sum = T::one() / factor;
        for (share, _) in self.kept.iter_mut() {
            share.weight *= per_sum;
        }
        Ok(Weight { factor, exponent: self.exponent })
    }

    pub(crate) fn into_state(self) -> SignMixture<T, N, L, K> {
        self.kept
    }
}

impl<T: Real, const N: usize, const L: usize> Share<T, N, L> {
    /// As hypotheses of one phase count as one in a [`Mixture`](crate::Mixture).
    #[inline(always)]
    fn is_like(&self, other: &Working<T, N>) -> bool {
        let (mean, covariance) = (&self.belief.mean, &self.belief.covariance);
        let distance = |i: usize, variance: T| {
            let apart = mean[i] - other.x[i];
            let variance = if other.p[i][i] > variance { other.p[i][i] } else { variance };
            // What is known exactly is the same or is not; a difference has no size without a unit.
            if apart.is_zero() { T::zero() } else { apart * apart / variance }
        };
        let strain = distance(0, covariance[(0, 0)]);
        strain < T::of(ALIKE) && strain + distance(1, covariance[(1, 1)]) < T::of(ALIKE)
    }

    /// Takes in another one, with the mean and covariance of the pair.
    fn merge(&mut self, other: &Working<T, N>, weight: T, log_inside: T) {
        let total = self.weight + weight;
        if !(total > T::zero()) {
            return;
        }
        let theirs = weight / total;
        let (mine, both) = (self.weight / total, self.weight / total * theirs);
        let apart: [T; N] = core::array::from_fn(|i| other.x[i] - self.belief.mean[i]);
        let mut merged = *other;
        let of_self = Working::of(&self.belief);
        for i in 0..N {
            merged.x[i] = of_self.x[i] + theirs * apart[i];
            for j in 0..=i {
                merged.p[i][j] = mine * of_self.p[i][j] + theirs * other.p[i][j] + both * apart[i] * apart[j];
            }
        }
        *self =
            Self { weight: total, belief: merged.belief(), log_inside: mine * self.log_inside + theirs * log_inside };
    }
}
