//! Operations of a sign-split filter on the rate alone.

use ohmstrain_model::{Phase, RateChange, Scalar, TURNING, Turning, TurningNumbers};

use super::predict::{dot, sum};
use super::tail::Tail;
use super::{Curve, Falls, Lanes, Part, Parts, SparseEkf, Switch};
use crate::Gaussian;

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// Returns the contribution to the rate of the pull toward the mean strain, and of the mean rate of the phase on a `side` of
    /// zero, 1 or -1.
    #[inline(always)]
    fn push<V: Lanes<Number = T>>(&self, side: V) -> V {
        side.scale_add(self.step.phase_input[1], side.with(self.step.input[1]))
    }

    /// Returns the rate after a step in the moving phase on a `side` of zero.
    #[inline(always)]
    pub(crate) fn rate_ahead<V: Lanes<Number = T>>(&self, side: V, from: &Parts<V, B>) -> Gaussian<V> {
        let step = &self.step;
        let (mean, variance) = answered(step.motion[1], (self.push(side), side.with(step.noise[2])), from);
        Gaussian { mean, variance }
    }

    /// Lanes where almost none of a prediction's probability is on its `side` of zero.
    #[inline(always)]
    pub(crate) fn is_hopeless<V: Lanes<Number = T>>(&self, side: V, from: &Parts<V, B>) -> V::Mask {
        let ahead = self.rate_ahead(side, from);
        let toward = side * ahead.mean;
        let behind = toward.less(toward.nothing());
        if V::none(behind) {
            return behind;
        }
        V::both(behind, ahead.variance.scale(T::of(HOPELESS * HOPELESS)).less(toward * toward))
    }

    /// Returns the change of a rate on a `side` of zero over a step, positive away from zero.
    #[inline(always)]
    fn rate_change<V: Lanes<Number = T>>(&self, side: V, from: &Parts<V, B>) -> RateChange<V> {
        let (step, none) = (&self.step, side.nothing());
        let (expected, spread) = answered(step.rate_change, (self.push(side), none), from);
        RateChange { expected: side * expected, spread, noise: side.with(step.noise[2]) }
    }

    /// Returns the excess path over a step of a rate on a `side` of zero, in the lanes `wanted`. It computes the same
    /// as [`SwitchedModel::turning`](ohmstrain_model::SwitchedModel::turning).
    #[inline(always)]
    pub(crate) fn turning<V: Falls<Number = T>, X: Switch<V>>(
        &self,
        side: V,
        from: &Parts<V, B>,
        wanted: V::Mask,
    ) -> Turning<V> {
        let (zero, one, half) = (side.nothing(), side.literal(1.0), side.literal(0.5));
        let TurningNumbers { clear, reach, even_excess, brownian, normal_density } = TURNING;
        let (rate, variance) = (side * from.rate, from.rate_variance);
        let is_clear = V::both(zero.less(rate), (variance.literal(clear * clear) * variance).less(rate * rate));
        let turns = V::both(wanted, V::without(zero.less(variance), is_clear));
        if V::none(turns) {
            return Turning { excess: zero, variance: zero };
        }
        let per_sd = X::root(variance).recip();
        let u = rate * per_sd;
        let square = V::pick(one.less(u), u * u, one);
        let (cut, gaussian) = ((one - square).falling(), side.literal(normal_density) * (-half * square).falling());
        let density = V::pick(gaussian.less(cut), cut, gaussian) * per_sd;

        let RateChange { expected, spread, noise } = self.rate_change(side, from);
        let even = V::pick(expected.less(zero), expected * expected, zero);
        let total = noise + even + spread;
        let change_sd = X::root(total);
        let thinner = one + side.literal(reach) * change_sd * per_sd;
        // Half of an even change of unknown sign is toward zero.
        let evenly = side.literal(even_excess) * (even + half * spread);
        let excess = density * (evenly + side.literal(brownian.0) * noise);
        let open = (side.literal(brownian.1) * density * total * change_sd).over(thinner);
        Turning { excess: V::pick(turns, excess, zero), variance: V::pick(turns, open, zero) }
    }
}

/// Distance of the rate beyond zero, in standard deviations, at which a thousandth of the prediction's probability is
/// left, too little to follow.
const HOPELESS: f64 = 3.090_232_306_167_813_5;

/// Returns the side of zero, 1 or -1, of a moving phase's rates.
#[inline(always)]
pub(crate) fn side_of<V: Lanes>(phase: Phase, like: V) -> V {
    like.literal(if phase == Phase::Retract { -1.0 } else { 1.0 })
}

/// Adds to a mean and a variance the effect of strain and rate of a belief, with factors `by`.
#[inline(always)]
fn answered<V: Lanes, const B: usize>(by: [V::Number; 2], (mean, variance): (V, V), from: &Parts<V, B>) -> (V, V) {
    let like = from.strain;
    let by = by.map(|factor| like.with(factor));
    let spread = [dot(by, [from.strain_variance, from.strain_rate]), dot(by, [from.strain_rate, from.rate_variance])];
    (sum(mean, by, [from.strain, from.rate]), sum(variance, by, spread))
}

impl<T: Scalar> Gaussian<T> {
    /// Returns the same Gaussian in all lanes.
    #[inline(always)]
    pub(crate) fn in_lanes<V: Lanes<Number = T>>(self, like: V) -> Gaussian<V> {
        Gaussian { mean: like.with(self.mean), variance: like.with(self.variance) }
    }
}

impl<V: Lanes, const B: usize> Parts<V, B> {
    /// Replaces the rate by a new one where a phase `begins`, independent of everything else.
    #[inline(always)]
    pub(crate) fn renew_rate(&mut self, fresh: Gaussian<V>, begins: V::Mask) {
        let zero = self.rate.nothing();
        self.rate = V::pick(begins, fresh.mean, self.rate);
        self.rate_variance = V::pick(begins, fresh.variance, self.rate_variance);
        self.strain_rate = V::pick(begins, zero, self.strain_rate);
        for part in self.branches.iter_mut().chain([&mut self.baseline]) {
            part.with_rate = V::pick(begins, zero, part.with_rate);
        }
    }

    /// Returns the probability of a `side` of zero for rates known exactly, or so far on that side, beyond `clear` in squared
    /// standard deviations, that the tail is not truncated. Also returns the lanes, among those `wanted`, where the tail is
    /// truncated.
    #[inline(always)]
    pub(crate) fn certain_of_side(&self, side: V, clear: V::Number, wanted: V::Mask) -> (V, V::Mask) {
        let variance = self.rate_variance;
        let (zero, one, toward) = (variance.nothing(), variance.literal(1.0), side * self.rate);
        let known = (-variance).not_negative();
        let certain = V::pick(known, V::pick(toward.less(zero), zero, one), one);
        if V::all(known) {
            return (certain, V::without(known, known));
        }
        let far = V::both(zero.less(toward), variance.scale(clear).less(toward * toward));
        (certain, V::without(wanted, V::either(known, far)))
    }
}

impl<V: Falls, const B: usize> Parts<V, B> {
    /// Truncates the rate to a `side` of zero in the lanes `wanted`, and returns the remaining probability. Tails beyond `clear`
    /// in squared standard deviations are not truncated.
    #[inline(always)]
    pub(crate) fn cut_rate<X: Switch<V>, const N: usize>(&mut self, side: V, clear: V::Number, wanted: V::Mask) -> V {
        let (certain, cut) = self.certain_of_side(side, clear, wanted);
        if V::none(cut) {
            return certain;
        }
        V::pick(cut, self.cut_off::<X, N>(side, cut), certain)
    }

    /// Truncates the rate in the lanes `cut`, and returns the remaining probability.
    #[inline(always)]
    pub(crate) fn cut_off<X: Switch<V>, const N: usize>(&mut self, side: V, cut: V::Mask) -> V {
        let (zero, gone) = (side.nothing(), side.literal(-1.0));
        let per_sd = X::root(self.rate_variance).recip();
        let border = -(side * self.rate) * per_sd;
        let Tail { mass, hazard: shift } = border.tail(cut);
        let narrowed = border * shift - shift * shift;
        // Comparisons cost less than calls of `fmax` and `fmin`.
        let narrowed = V::pick(zero.less(narrowed), zero, V::pick(narrowed.less(gone), gone, narrowed));
        let (moves, narrows) = (side * (shift * per_sd), narrowed * per_sd * per_sd);
        self.regress::<N>(V::pick(cut, moves, zero), V::pick(cut, narrows, zero));
        mass
    }
}

impl<V: Lanes, const B: usize> Parts<V, B> {
    /// Moves the rate, and everything else along its regression on the rate: means by covariance · `moves`, covariances
    /// by the product of both covariances · `narrows`.
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

/// Updates a branch, or the baseline, after a move of the rate.
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
