//! Comparison of two hypotheses, and their merging.

use crate::kernel::{Lanes, Parts};
use crate::mixture::ALIKE;

/// Moments that determine whether hypotheses are alike.
#[derive(Clone, Copy)]
pub(crate) struct About<V> {
    pub strain: V,
    pub strain_variance: V,
    pub rate: V,
    pub rate_variance: V,
}

impl<V: Lanes> About<V> {
    #[inline(always)]
    pub(crate) const fn of<const B: usize>(parts: &Parts<V, B>) -> Self {
        let Parts { strain, strain_variance, rate, rate_variance, .. } = *parts;
        Self { strain, strain_variance, rate, rate_variance }
    }

    /// Lanes where two hypotheses of one phase are alike, to be merged.
    #[inline(always)]
    pub(crate) fn is_like(&self, other: &Self) -> V::Mask {
        let alike = self.strain.literal(ALIKE);
        // Usually they are not, which the strain shows without a division.
        let apart = self.strain - other.strain;
        let far = (alike * (self.strain_variance + other.strain_variance)).less(apart * apart);
        if V::all(far) {
            return V::without(far, far);
        }
        let strain = self.strain_apart(other);
        let near = V::without(strain.less(alike), far);
        if V::none(near) {
            return near;
        }
        V::both(near, (strain + self.rate_apart(other)).less(alike))
    }

    /// Returns the squared distance of strains and rates, each in units of the larger variance.
    #[inline(always)]
    pub(crate) fn distance(&self, other: &Self) -> V {
        self.strain_apart(other) + self.rate_apart(other)
    }

    #[inline(always)]
    fn strain_apart(&self, other: &Self) -> V {
        apart(self.strain - other.strain, self.strain_variance, other.strain_variance)
    }

    #[inline(always)]
    fn rate_apart(&self, other: &Self) -> V {
        apart(self.rate - other.rate, self.rate_variance, other.rate_variance)
    }
}

/// Returns a squared difference in units of the larger variance.
#[inline(always)]
fn apart<V: Lanes>(difference: V, one: V, other: V) -> V {
    let (none, square) = (difference.nothing(), difference * difference);
    // Exactly known values are either equal or not; without a variance their difference has no scale.
    let differs = none.less(square);
    if V::none(differs) {
        return none;
    }
    V::pick(differs, square.over(V::pick(one.less(other), other, one)), none)
}

/// Merges another hypothesis, preserving the mean and covariance of the pair, whose shares sum to one. Covariances are lower
/// triangles, row by row.
#[inline(always)]
pub(crate) fn merge<'a, V: Lanes + 'a, const N: usize>(
    (mean, covariance): (impl Iterator<Item = &'a mut V>, impl Iterator<Item = &'a mut V>),
    (other_mean, other_covariance): (&[V; N], impl Iterator<Item = &'a V>),
    [mine, theirs]: [V; 2],
) {
    let both = mine * theirs;
    let mut apart = *other_mean;
    // Iterators throughout, because an index could panic.
    for (apart, mine) in apart.iter_mut().zip(mean) {
        *apart -= *mine;
        *mine += *apart * theirs;
    }
    let mut entries = covariance.zip(other_covariance);
    for (i, a) in apart.iter().enumerate() {
        for (b, (p, q)) in apart.iter().take(i + 1).zip(&mut entries) {
            *p = mine * *p + theirs * *q + both * *a * *b;
        }
    }
}
