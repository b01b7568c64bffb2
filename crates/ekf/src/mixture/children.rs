use ohmstrain_model::Phase;

use crate::Real;
use crate::kernel::{Falls, Parts, Several};
use crate::mixture::evidence::{Weighed, Weight};
use crate::mixture::lineage::Recorder;
use crate::mixture::pair::{self, About};
use crate::mixture::state::{Mixture, Share};
use crate::mixture::{Added, LEAST_WEIGHT, LIGHTER};
use crate::{Belief, StepError};

/// Collects the children of a step: keeps, merges and drops them.
pub(crate) struct Children<'a, T, const N: usize, const L: usize, const K: usize> {
    kept: &'a mut Mixture<T, N, L, K>,
    /// Largest exponent so far; weights are in units of its exponential. A weight that underflows to zero would be
    /// dropped in the end anyway.
    exponent: T,
    /// Sum of all weights without the limits, including those of dropped children.
    density: T,
}

impl<'a, T: Real, const N: usize, const L: usize, const K: usize> Children<'a, T, N, L, K> {
    /// Starts collecting at most `room` children, in place of the hypotheses in `kept`.
    #[inline(always)]
    pub(crate) fn new(kept: &'a mut Mixture<T, N, L, K>, room: usize) -> Self {
        kept.clear(room);
        Self { kept, exponent: T::zero(), density: T::zero() }
    }

    /// Adds a child, merged with a similar one or in a free slot, and returns its place. Without a free slot, the lightest of all
    /// makes room and is merged with the nearest of its phase. Dropping it would lose motions that are unlikely in each of many
    /// short steps but likely in all together, before a reading could support them.
    pub(crate) fn add<V: Several<Number = T>, const B: usize>(
        &mut self,
        children: &Parts<V, B>,
        lane: usize,
        phase: Phase,
        weighed: &Weighed<T>,
    ) -> Added {
        let about = About::in_lane(children, lane);
        let Weighed { weight, more_inside, per_inside } = *weighed;
        self.raise_to(weight.exponent);
        let likelihood = weight.relative_to(self.exponent);
        self.density += likelihood;
        let weight = likelihood * more_inside;
        let like = |(_, (share, known)): &(usize, (&mut Share<T, N, L>, &mut Phase))| {
            **known == phase && share.about().is_like(&about)
        };
        if let Some((place, (like, _))) = self.kept.iter_mut().enumerate().find(like) {
            V::parts(children, lane, |child| like.merge(child, weight, per_inside));
            return Added::To(place);
        }
        let (added, place) = if self.kept.shares().len() < self.kept.room() {
            (Added::To(self.kept.shares().len()), self.kept.one_more())
        } else {
            let (at, lightest) = self.lightest();
            if !(lightest < weight * T::of(1.0 - LIGHTER)) {
                let into =
                    V::parts(children, lane, |child| self.merge_into_nearest(child, phase, (weight, per_inside), None));
                return into.map_or(Added::Nowhere, Added::To);
            }
            let into = self.displace::<B>(at);
            (Added::InsteadOf(at, into), self.kept.iter_mut().nth(at))
        };
        let Some((place, of)) = place else { return Added::Nowhere };
        (place.weight, place.per_inside, *of) = (weight, per_inside, phase);
        V::parts(children, lane, |child| child.put_into(&mut place.belief));
        added
    }

    /// Returns the index and weight of the lightest hypothesis.
    fn lightest(&self) -> (usize, T) {
        let weights = self.kept.shares().iter().map(|share| share.weight).enumerate();
        let lighter = |a: (usize, T), b: (usize, T)| if b.1 < a.1 * T::of(1.0 - LIGHTER) { b } else { a };
        weights.reduce(lighter).unwrap_or((0, T::zero()))
    }

    /// Merges the hypothesis at a place into the nearest of its phase, and returns the place of that.
    #[inline(never)]
    fn displace<const B: usize>(&mut self, at: usize) -> Option<usize> {
        let (share, phase) = self.kept.iter_mut().nth(at)?;
        let (displaced, counts, phase) = (Parts::<T, B>::of(&share.belief), (share.weight, share.per_inside), *phase);
        self.merge_into_nearest(&displaced, phase, counts, Some(at))
    }

    /// Merges a child into the nearest of its phase, except the one at `but`, and returns the place of that. A negligible child, or
    /// one without another of its phase, is dropped.
    #[inline(never)]
    fn merge_into_nearest<const B: usize>(
        &mut self,
        child: &Parts<T, B>,
        phase: Phase,
        (weight, per_inside): (T, T),
        but: Option<usize>,
    ) -> Option<usize> {
        let heaviest = self.kept.shares().iter().fold(weight, |a, b| if b.weight > a { b.weight } else { a });
        if weight < heaviest * T::of(LEAST_WEIGHT) {
            return None;
        }
        let others = self.kept.iter_mut().enumerate().filter(|(at, (_, of))| Some(*at) != but && **of == phase);
        let about = About::of(child);
        let distances = others.map(|(at, (share, _))| (share.about().distance(&about), at, share));
        let (_, at, share) = distances.reduce(|a, b| if b.0 < a.0 { b } else { a })?;
        share.merge(child, weight, per_inside);
        Some(at)
    }

    /// Rescales the weights so far to units of a larger exponent's exponential.
    fn raise_to(&mut self, exponent: T) {
        let first = self.kept.shares().is_empty();
        if first || exponent > self.exponent {
            let fewer = if first { T::one() } else { (self.exponent - exponent).falling() };
            for (share, _) in self.kept.iter_mut() {
                share.weight *= fewer;
            }
            self.density *= fewer;
            self.exponent = exponent;
        }
    }

    /// Returns the sum of all added weights, without the limits.
    pub(crate) const fn density(&self) -> Weight<T>
    where
        T: Copy,
    {
        Weight { factor: self.density, exponent: self.exponent }
    }

    /// Normalises the probabilities to sum to one, and drops negligible hypotheses.
    pub(crate) fn normalise<const B: usize>(&mut self, recorder: &mut impl Recorder<T, B>) -> Result<(), StepError> {
        let heaviest = self.kept.shares().iter().fold(T::zero(), |a, b| if b.weight > a { b.weight } else { a });
        let least = heaviest * T::of(LEAST_WEIGHT);
        recorder.renumbered(|place| {
            let (before, from_here) = self.kept.shares().split_at_checked(place)?;
            let lighter = before.iter().filter(|share| !(share.weight > least)).count();
            from_here.first().is_some_and(|share| share.weight > least).then_some(place - lighter)
        });
        self.kept.retain(|share| share.weight > least);
        let factor = self.kept.shares().iter().fold(T::zero(), |sum, share| sum + share.weight);
        if !(factor > T::zero() && factor.is_finite()) {
            return Err(StepError::NonFiniteState);
        }
        let per_sum = T::one() / factor;
        for (share, _) in self.kept.iter_mut() {
            share.weight *= per_sum;
        }
        Ok(())
    }
}

impl<T: Real> About<T> {
    #[inline(always)]
    fn in_lane<V: Several<Number = T>, const B: usize>(parts: &Parts<V, B>, lane: usize) -> Self {
        Self {
            strain: parts.strain.at(lane),
            strain_variance: parts.strain_variance.at(lane),
            rate: parts.rate.at(lane),
            rate_variance: parts.rate_variance.at(lane),
        }
    }
}

impl<T: Real, const N: usize, const L: usize> Share<T, N, L> {
    #[inline(always)]
    fn about(&self) -> About<T> {
        let Belief { mean, covariance } = &self.belief;
        About { strain: mean[0], strain_variance: covariance[(0, 0)], rate: mean[1], rate_variance: covariance[(1, 1)] }
    }

    /// Merges another hypothesis into this one, preserving the mean and covariance of the pair.
    fn merge<const B: usize>(&mut self, other: &Parts<T, B>, weight: T, per_inside: T) {
        let total = self.weight + weight;
        if !(total > T::zero()) {
            return;
        }
        let (mine, theirs) = (self.weight / total, weight / total);
        let (mut mean, mut covariance) = ([T::zero(); N], [T::zero(); L]);
        other.write::<N>(&mut mean.iter_mut(), &mut covariance.iter_mut());
        let own = (self.belief.mean.iter_mut(), self.belief.covariance.packed_mut().iter_mut());
        pair::merge(own, (&mean, covariance.iter()), [mine, theirs]);
        self.weight = total;
        self.per_inside = mine * self.per_inside + theirs * per_inside;
    }
}
