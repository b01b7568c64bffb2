use nalgebra::SVector;
use ohmstrain_model::{Scalar, Symmetric};

use super::{Lanes, Several};
use crate::Belief;

/// A belief split into motion, branches and baseline. Each propagates differently, no index needs a check, and with one
/// branch there is no loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts<T, const B: usize> {
    pub strain: T,
    pub rate: T,
    pub strain_variance: T,
    /// Covariance of strain and rate.
    pub strain_rate: T,
    pub rate_variance: T,
    pub branches: [Part<T, B>; B],
    /// Meaningless if there is no baseline.
    pub baseline: Part<T, B>,
}

/// A branch, or the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part<T, const B: usize> {
    pub mean: T,
    pub with_strain: T,
    pub with_rate: T,
    /// Covariances with the branches: for a branch, with those before it; for the baseline, with all.
    pub with: [T; B],
    pub variance: T,
}

/// Takes numbers one after another. Their count is known at compile time, so that no test for the end remains.
#[inline(always)]
fn next<'a, V: Lanes + 'a>(numbers: &mut impl Iterator<Item = &'a V>, nothing: V) -> V {
    match numbers.next() {
        Some(number) => *number,
        None => nothing,
    }
}

impl<V: Lanes, const B: usize> Part<V, B> {
    #[inline(always)]
    pub(crate) const fn vacant(nothing: V) -> Self {
        Self { mean: nothing, with_strain: nothing, with_rate: nothing, with: [nothing; B], variance: nothing }
    }

    #[inline(always)]
    fn read<'a>(
        others: usize,
        means: &mut impl Iterator<Item = &'a V>,
        covariances: &mut impl Iterator<Item = &'a V>,
        nothing: V,
    ) -> Self
    where
        V: 'a,
    {
        let mut part = Self::vacant(nothing);
        part.mean = next(means, nothing);
        part.with_strain = next(covariances, nothing);
        part.with_rate = next(covariances, nothing);
        for i in 0..others {
            part.with[i] = next(covariances, nothing);
        }
        part.variance = next(covariances, nothing);
        part
    }

    /// Writes to the layout that [`Self::read`] reads.
    #[inline(always)]
    fn write<'a>(
        &self,
        others: usize,
        means: &mut impl Iterator<Item = &'a mut V>,
        covariances: &mut impl Iterator<Item = &'a mut V>,
    ) where
        V: 'a,
    {
        put(means, self.mean);
        put(covariances, self.with_strain);
        put(covariances, self.with_rate);
        for i in 0..others {
            put(covariances, self.with[i]);
        }
        put(covariances, self.variance);
    }
}

#[inline(always)]
fn put<'a, V: Lanes + 'a>(places: &mut impl Iterator<Item = &'a mut V>, number: V) {
    if let Some(place) = places.next() {
        *place = number;
    }
}

impl<V: Lanes, const B: usize> Parts<V, B> {
    /// Returns parts that are exactly zero (`nothing`).
    pub(crate) const fn certain(nothing: V) -> Self {
        Self {
            strain: nothing,
            rate: nothing,
            strain_variance: nothing,
            strain_rate: nothing,
            rate_variance: nothing,
            branches: [Part::vacant(nothing); B],
            baseline: Part::vacant(nothing),
        }
    }

    /// True if the last of `n` states is a baseline.
    pub(crate) const fn has_baseline(n: usize) -> bool {
        n == B + 3
    }

    /// Reads parts from means, and from the lower triangle of covariances row by row.
    #[inline(always)]
    pub(crate) fn read<'a, const N: usize>(
        means: &mut impl Iterator<Item = &'a V>,
        covariances: &mut impl Iterator<Item = &'a V>,
        nothing: V,
    ) -> Self
    where
        V: 'a,
    {
        let (strain, rate) = (next(means, nothing), next(means, nothing));
        let strain_variance = next(covariances, nothing);
        let strain_rate = next(covariances, nothing);
        let rate_variance = next(covariances, nothing);
        let mut branches = [Part::vacant(nothing); B];
        for i in 0..B {
            branches[i] = Part::read(i, means, covariances, nothing);
        }
        let mut baseline = Part::vacant(nothing);
        if Self::has_baseline(N) {
            baseline = Part::read(B, means, covariances, nothing);
        }
        Self { strain, rate, strain_variance, strain_rate, rate_variance, branches, baseline }
    }

    #[inline(always)]
    pub(crate) fn write<'a, const N: usize>(
        &self,
        means: &mut impl Iterator<Item = &'a mut V>,
        covariances: &mut impl Iterator<Item = &'a mut V>,
    ) where
        V: 'a,
    {
        put(means, self.strain);
        put(means, self.rate);
        put(covariances, self.strain_variance);
        put(covariances, self.strain_rate);
        put(covariances, self.rate_variance);
        for i in 0..B {
            self.branches[i].write(i, means, covariances);
        }
        if Self::has_baseline(N) {
            self.baseline.write(B, means, covariances);
        }
    }

    /// Lanes with valid numbers after a step: no variance is negative, and nothing is infinite or NaN. `extra` is another number
    /// that must be finite.
    #[inline(always)]
    pub(crate) fn is_sound<const N: usize>(&self, extra: V) -> V::Mask {
        let mut positive = V::both(self.strain_variance.not_negative(), self.rate_variance.not_negative());
        let mut sum = extra + self.strain + self.rate;
        for i in 0..B {
            positive = V::both(positive, self.branches[i].variance.not_negative());
            sum += self.branches[i].mean;
        }
        if Self::has_baseline(N) {
            positive = V::both(positive, self.baseline.variance.not_negative());
            sum += self.baseline.mean;
        }
        // Any non-finite number makes the sum non-finite.
        V::both(positive, sum.finite())
    }

    /// Sum of all variances.
    #[inline(always)]
    pub(crate) fn variances<const N: usize>(&self) -> V {
        let mut sum = self.strain_variance + self.rate_variance;
        if Self::has_baseline(N) {
            sum += self.baseline.variance;
        }
        for i in 0..B {
            sum += self.branches[i].variance;
        }
        sum
    }
}

#[cfg_attr(
    not(all(feature = "simd", any(target_arch = "x86_64", target_feature = "simd128"))),
    expect(dead_code, reason = "only vectors ask")
)]
impl<V: Several, const B: usize> Parts<V, B> {
    /// Gathers one belief per lane.
    #[inline(always)]
    pub(crate) fn gathered<'a, const N: usize, const L: usize>(
        like: V,
        belief: impl Fn(usize) -> &'a Belief<V::Number, N, L>,
    ) -> Self
    where
        V::Number: 'a,
    {
        let nothing = like.nothing();
        let (mut means, mut covariances) = ([nothing; N], [nothing; L]);
        for i in 0..N {
            [means[i]] = like.build(|lane| [belief(lane).mean.as_slice()[i]]);
        }
        for i in 0..L {
            [covariances[i]] = like.build(|lane| [belief(lane).covariance.packed()[i]]);
        }
        Self::read::<N>(&mut means.iter(), &mut covariances.iter(), nothing)
    }

    /// Returns the numbers in a lane.
    #[inline(always)]
    pub(crate) fn in_lane(&self, lane: usize) -> Parts<V::Number, B> {
        let mut branches = [Part::vacant(<V::Number as Scalar>::of(0.0)); B];
        for i in 0..B {
            branches[i] = self.branches[i].in_lane(lane);
        }
        Parts {
            strain: self.strain.at(lane),
            rate: self.rate.at(lane),
            strain_variance: self.strain_variance.at(lane),
            strain_rate: self.strain_rate.at(lane),
            rate_variance: self.rate_variance.at(lane),
            branches,
            baseline: self.baseline.in_lane(lane),
        }
    }
}

impl<V: Several, const B: usize> Part<V, B> {
    #[inline(always)]
    fn in_lane(&self, lane: usize) -> Part<V::Number, B> {
        let mut with = [<V::Number as Scalar>::of(0.0); B];
        for k in 0..B {
            with[k] = self.with[k].at(lane);
        }
        Part {
            mean: self.mean.at(lane),
            with_strain: self.with_strain.at(lane),
            with_rate: self.with_rate.at(lane),
            with,
            variance: self.variance.at(lane),
        }
    }
}

impl<T: Scalar, const B: usize> Parts<T, B> {
    #[inline(always)]
    pub(crate) fn of<const N: usize, const L: usize>(belief: &Belief<T, N, L>) -> Self {
        Self::read::<N>(&mut belief.mean.iter(), &mut belief.covariance.packed().iter(), T::zero())
    }

    /// Returns the belief composed of these parts.
    #[inline(always)]
    pub(crate) fn together<const N: usize, const L: usize>(&self) -> Belief<T, N, L> {
        let mut belief = Belief { mean: SVector::zeros(), covariance: Symmetric::zeros() };
        self.put_into(&mut belief);
        belief
    }

    #[inline(always)]
    pub(crate) fn put_into<const N: usize, const L: usize>(&self, belief: &mut Belief<T, N, L>) {
        self.write::<N>(&mut belief.mean.iter_mut(), &mut belief.covariance.packed_mut().iter_mut());
    }
}
