//! What a sign-split filter does to the rate alone.

use ohmstrain_model::{Phase, RateChange, Scalar, Turning};

use super::predict::{dot, sum};
use super::{Lanes, Part, Parts, Several};
use crate::belief::gaussian::Real;
use crate::belief::tail::Tail;
use crate::{Curve, Gaussian, SparseEkf, Switch};

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// What the pull toward the mean strain and the mean rate of a phase add to the rate.
    #[inline(always)]
    fn push<V: Lanes<Number = T>>(&self, extends: bool, like: V) -> V {
        let (input, toward) = (like.with(self.step.input[1]), like.with(self.step.phase_input[1]));
        if extends { input + toward } else { input - toward }
    }

    /// The rate after a step in a moving phase.
    #[inline(always)]
    pub(crate) fn rate_ahead<V: Lanes<Number = T>>(&self, phase: Phase, from: &Parts<V, B>) -> Gaussian<V> {
        let (step, b) = (&self.step, self.step.motion[1]);
        let push = self.push(phase == Phase::Extend, from.rate);
        let (mean, variance) = answered(b, (push, from.rate.with(step.noise[2])), from);
        Gaussian { mean, variance }
    }

    /// How a rate of the sign of `before` changes over a step, positive away from zero.
    #[inline(always)]
    pub(crate) fn rate_change<V: Lanes<Number = T>>(&self, before: Phase, from: &Parts<V, B>) -> RateChange<V> {
        let (step, like) = (&self.step, from.rate);
        let push = self.push(before != Phase::Retract, like);
        let (expected, spread) = answered(step.rate_change, (push, like.nothing()), from);
        let expected = if before == Phase::Retract { -expected } else { expected };
        RateChange { expected, spread, noise: like.with(step.noise[2]) }
    }
    /// What a rate of the sign of `before` leaves open over a step, as
    /// [`SwitchedModel::turning`](ohmstrain_model::SwitchedModel::turning).
    #[inline(always)]
    pub(crate) fn turning(&self, before: Phase, from: &Parts<T, B>) -> Turning<T> {
        let side = if before == Phase::Retract { -T::one() } else { T::one() };
        let change = self.rate_change(before, from);
        Turning::new(side * from.rate, from.rate_variance, &change, S::root)
    }
}

/// What motion by `by` from a belief adds to a mean, and to a variance.
#[inline(always)]
fn answered<V: Lanes, const B: usize>(by: [V::Number; 2], (mean, variance): (V, V), from: &Parts<V, B>) -> (V, V) {
    let like = from.strain;
    let by = by.map(|factor| like.with(factor));
    let spread = [dot(by, [from.strain_variance, from.strain_rate]), dot(by, [from.strain_rate, from.rate_variance])];
    (sum(mean, by, [from.strain, from.rate]), sum(variance, by, spread))
}

impl<V: Several<Number: Real>, const B: usize> Parts<V, B> {
    /// Draws the rate anew where a phase `begins`, independent of everything else.
    #[inline(always)]
    pub(crate) fn renew_rate(&mut self, fresh: &Gaussian<V::Number>, begins: V::Mask) {
        let (like, zero) = (self.rate, self.rate.nothing());
        self.rate = V::pick(begins, like.with(fresh.mean), self.rate);
        self.rate_variance = V::pick(begins, like.with(fresh.variance), self.rate_variance);
        self.strain_rate = V::pick(begins, zero, self.strain_rate);
        for part in self.branches.iter_mut().chain([&mut self.baseline]) {
            part.with_rate = V::pick(begins, zero, part.with_rate);
        }
    }

    /// Restricts the rate to the sign of a moving phase where that is `wanted`; what it leaves of the Gaussian. Tails beyond
    /// `clear` squared deviations are not cut off.
    #[inline(always)]
    pub(crate) fn cut_rate<X: Switch<V>, const N: usize>(
        &mut self,
        phase: Phase,
        clear: V::Number,
        wanted: V::Mask,
    ) -> V {
        let variance = self.rate_variance;
        let (zero, one) = (variance.nothing(), variance.literal(1.0));
        let toward = if phase == Phase::Retract { -self.rate } else { self.rate };
        let known = (-variance).not_negative();
        let certain = V::pick(toward.less(zero), zero, one);
        if V::all(known) {
            return certain;
        }
        let far = V::both(zero.less(toward), variance.scale(clear).less(toward * toward));
        let certain = V::pick(known, certain, one);
        let cut = V::without(wanted, V::either(known, far));
        if V::none(cut) {
            return certain;
        }
        let per_sd = X::root(variance).recip();
        let border = -toward * per_sd;
        let Tail { mass, hazard: shift } = Tail::above(border, cut);
        let (narrowed, gone) = (border * shift - shift * shift, -one);
        // By comparisons, which cost less than calls of `fmax` and `fmin`.
        let narrowed = V::pick(zero.less(narrowed), zero, V::pick(narrowed.less(gone), gone, narrowed));
        let (toward, narrows) = (shift * per_sd, narrowed * per_sd * per_sd);
        let moves = if phase == Phase::Retract { -toward } else { toward };
        self.regress::<N>(V::pick(cut, moves, zero), V::pick(cut, narrows, zero));
        V::pick(cut, mass, certain)
    }
}

impl<V: Lanes, const B: usize> Parts<V, B> {
    /// Moves the rate, everything else along its regression: means by covariance · `moves`, covariances by the product of
    /// both covariances · `narrows`.
    #[inline(always)]
    pub(crate) fn regress<const N: usize>(&mut self, moves: V, narrows: V) {
        let (with_strain, with_rate) = (self.strain_rate, self.rate_variance);
        let (on_strain, on_rate) = (with_strain * narrows, with_rate * narrows);
        let mut branches = [with_rate; B];
        for i in 0..B {
            branches[i] = self.branches[i].with_rate;
        }
        self.strain += with_strain * moves;
        self.rate += with_rate * moves;
        self.strain_variance += on_strain * with_strain;
        self.strain_rate += on_rate * with_strain;
        self.rate_variance += on_rate * with_rate;
        for i in 0..B {
            follow(&mut self.branches[i], i, (with_strain, with_rate, &branches), (moves, narrows));
        }
        if Self::has_baseline(N) {
            follow(&mut self.baseline, B, (with_strain, with_rate, &branches), (moves, narrows));
        }
    }
}

/// What a branch, or the baseline, makes of a move of the rate.
#[inline(always)]
fn follow<V: Lanes, const B: usize>(
    part: &mut Part<V, B>,
    others: usize,
    (with_strain, with_rate, branches): (V, V, &[V; B]),
    (moves, narrows): (V, V),
) {
    let (own, narrowing) = (part.with_rate, part.with_rate * narrows);
    part.mean += own * moves;
    part.with_strain += narrowing * with_strain;
    part.with_rate += narrowing * with_rate;
    for i in 0..others {
        part.with[i] += narrowing * branches[i];
    }
    part.variance += narrowing * own;
}
