//! The sparse filter's prediction on vectors: the same operations on the same numbers in the same order. Where it branches, both results
//! and a choice; where it adds a product and the processor has an instruction for that, one rounding instead of two.

use fearless_simd::{Select, Simd, SimdFloat, SimdInto};
use ohmstrain_model::{Branch, LEAST_LEFT, SplitRate, StrainRange, UNEXPLAINED, UNEXPLAINED_SHAPE};

use super::Lane;
use crate::sparse_constants::{BranchConstants, StepConstants};
use crate::{Compact, SparseEkf, Switch};

/// Beliefs of as many sensors as a vector has lanes; of the covariance the lower triangle, row by row.
pub(super) struct Beliefs<V, const N: usize, const L: usize> {
    pub(super) mean: [V; N],
    pub(super) covariance: [V; L],
}

/// Where a triangle, row by row, has row `i`, column `j ≤ i`.
#[inline(always)]
pub(super) const fn at(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

/// A variance that all rates of a step share, and where [`Compact`] ends for it.
#[derive(Clone, Copy)]
pub(super) struct RateSpread<V> {
    pub(super) variance: V,
    width: V,
    per_width: V,
    per_square: V,
}

/// What a step does to one branch, as the sparse filter's prediction has it.
#[derive(Clone, Copy)]
struct Driven<V> {
    change: V,
    gain: V,
    pull: V,
    row: [V; 2],
    kept: [V; 2],
    carried: [V; 2],
    jump: V,
}

/// How a branch is driven, as the sparse filter has it.
#[derive(Clone, Copy)]
struct Drive<V> {
    change: V,
    gain: V,
    pull: V,
    jump: V,
    left: V,
}

/// `a₀ b₀ + a₁ b₁`.
#[inline(always)]
pub(super) fn dot<S: Simd, V: SimdFloat<S>>([a0, a1]: [V; 2], [b0, b1]: [impl SimdInto<V, S>; 2]) -> V {
    a1.mul_add(b1, a0 * b0.simd_into(a0.token()))
}

/// `start + a₀ b₀ + a₁ b₁`.
#[inline(always)]
pub(super) fn sum<S: Simd, V: SimdFloat<S>>(
    start: impl SimdInto<V, S>,
    [a0, a1]: [V; 2],
    [b0, b1]: [impl SimdInto<V, S>; 2],
) -> V {
    a1.mul_add(b1, a0.mul_add(b0, start))
}

#[inline(always)]
pub(super) fn predict<
    T: Lane,
    S: Simd,
    V: SimdFloat<S, Element = T>,
    const B: usize,
    const N: usize,
    const L: usize,
>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    Beliefs { mean: x, covariance: p }: &mut Beliefs<V, N, L>,
) -> RateSpread<V> {
    let (step, law) = (&ekf.step, ekf.model().law());
    let [a, b] = step.motion;
    let (strain, rate) = (x[0], x[1]);
    x[0] = sum(step.input[0], [strain, rate], a);
    x[1] = sum(step.input[1], [strain, rate], b);
    let strain_sum = strain + x[0];
    let [strain_variance, strain_rate, rate_variance] = [p[0], p[1], p[2]];
    let from_strain = [dot([strain_variance, strain_rate], a), dot([strain_rate, rate_variance], a)];
    let squares = step.rate_squares;
    p[0] = sum(step.noise[0], from_strain, a);
    p[1] = sum(step.noise[1], from_strain, b);
    let from_old = sum(step.noise[2], [strain_variance, strain_rate], [squares[0], squares[1]]);
    p[2] = rate_variance.mul_add(squares[2], from_old);
    let spread = RateSpread::new(simd, (rate_variance + p[2]) * T::of(0.5));

    let zero = V::splat(simd, T::zero());
    let mut driven = [Driven {
        change: zero,
        gain: zero,
        pull: zero,
        row: [zero; 2],
        kept: [zero; 2],
        carried: [zero; 2],
        jump: zero,
    }; B];
    let mut unexplained = zero;
    for i in 0..B {
        let constants = &step.branches[i];
        let unit = sum(constants.input, [strain, rate], constants.drive);
        let Drive { change, gain, pull, jump, left } =
            drive(simd, constants, &law.branches[i], &law.range, strain_sum, unit, &spread);
        if i == 0 {
            let with_strain = dot([strain_variance, strain_rate], b);
            let together = dot([strain_rate, rate_variance], b);
            let fresh = sum(step.noise[2], [with_strain, together], step.rate_change);
            unexplained = left * (correlated_steps(simd, p[2], together, fresh) * step.averaging);
        }
        let row = [gain.mul_add(constants.drive[0], pull), gain * constants.drive[1]];
        let kept = [p[at(2 + i, 0)] * constants.decay, p[at(2 + i, 1)] * constants.decay];
        let carried =
            [sum(kept[0], row, [strain_variance, strain_rate]), sum(kept[1], row, [strain_rate, rate_variance])];
        driven[i] = Driven { change, gain, pull, row, kept, carried, jump };
    }
    predict_branches(step, x, p, &driven);
    leave_open(p, &driven, unexplained);
    predict_baseline(step, x, p, &driven);
    RateSpread::new(simd, p[2])
}

/// As [`ohmstrain_model::correlated_steps`].
#[inline(always)]
fn correlated_steps<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, ahead: V, together: V, fresh: V) -> V {
    let (square, both) = (ahead * ahead, together * together);
    let both = both.simd_lt(square).select(both, square);
    let (left, least) = (fresh * (ahead + together), square * T::of(LEAST_LEFT));
    let steps = (square + both) / left.simd_gt(least).select(left, least);
    // A rate that is known has nothing to persist, and no correlation.
    square.simd_gt(T::zero()).select(steps, V::splat(simd, T::zero()))
}

/// Adds what the direction leaves open: one number for all branches.
#[inline(always)]
fn leave_open<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const L: usize>(
    p: &mut [V; L],
    driven: &[Driven<V>; B],
    unexplained: V,
) {
    for i in 0..B {
        let share = unexplained * driven[i].jump;
        for k in 0..=i {
            p[at(2 + i, 2 + k)] = share.mul_add(driven[k].jump, p[at(2 + i, 2 + k)]);
        }
    }
}

/// How a branch is driven.
#[inline(always)]
fn drive<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize>(
    simd: S,
    constants: &BranchConstants<T, B>,
    law: &Branch<T>,
    range: &StrainRange<T>,
    strain_sum: V,
    unit: V,
    spread: &RateSpread<V>,
) -> Drive<V> {
    // Gains as functions of the sum of old and new strain, constant beyond the range.
    let (lower, upper) = (range.lower + range.lower, range.upper + range.upper);
    let inside = strain_sum.simd_ge(lower) & strain_sum.simd_le(upper);
    let clamped = strain_sum.max(lower).min(upper);
    let growth = [law.extend_gain_slope, law.retract_gain_slope].map(|slope| T::of(0.5) * slope);
    let gains = [clamped.mul_add(growth[0], law.extend_gain), clamped.mul_add(growth[1], law.retract_gain)];

    let uncertain = (unit * unit).simd_lt(spread.variance * constants.clear);
    let split = spread.split(simd, unit * constants.per_reach);
    let extends = unit.simd_gt(T::zero());
    let here = extends.select(gains[0], gains[1]);
    let growth_here = extends.select(V::splat(simd, growth[0]), V::splat(simd, growth[1]));

    let rates = [split.extend, split.retract];
    let change = uncertain.select(dot(rates, gains) * constants.reach, here * unit);
    let gain = uncertain.select(dot([split.extend_probability, split.retract_probability], gains), here);
    let pull = uncertain.select(dot(rates, growth) * constants.reach, growth_here * unit);
    let zero = V::splat(simd, T::zero());
    let pull = inside.select(pull, zero);
    let jump = (gains[0] - gains[1]) * constants.reach;
    Drive { change, gain, pull, jump, left: uncertain.select(split.variance, zero) }
}

/// The branches' covariances with the new motion, which is in `p` already, and with each other.
#[inline(always)]
fn predict_branches<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize, const L: usize>(
    step: &StepConstants<T, B>,
    x: &mut [V; N],
    p: &mut [V; L],
    driven: &[Driven<V>; B],
) {
    let [a, b] = step.motion;
    for i in 0..B {
        let (c, branch, Driven { change, gain, pull, row, kept, carried, .. }) = (2 + i, &step.branches[i], driven[i]);
        let strain = sum(gain * branch.cross_noise[0], carried, a);
        let rate = sum(gain * branch.cross_noise[1], carried, b);
        let with_strain = pull.mul_add(p[0], strain);
        for k in 0..i {
            let other = &driven[k];
            let from_motion = sum(other.gain * (gain * branch.noise[k]), other.row, carried);
            let from_both = sum(from_motion, row, other.kept);
            let own = p[at(c, 2 + k)].mul_add(branch.decays[k], from_both);
            p[at(c, 2 + k)] = sum(own, [other.pull, pull], [strain, p[at(2 + k, 0)]]);
        }
        let noise = gain.mul_add(gain * branch.noise[i], branch.variance);
        let from_motion = sum(noise, row, [carried[0] + kept[0], carried[1] + kept[1]]);
        let own = p[at(c, c)].mul_add(branch.decays[i], from_motion);
        p[at(c, c)] = pull.mul_add(strain + with_strain, own);
        x[c] = x[c].mul_add(branch.decay, change);
        p[at(c, 0)] = with_strain;
        p[at(c, 1)] = pull.mul_add(p[1], rate);
    }
}

/// The baseline's covariances, from its own old ones.
#[inline(always)]
fn predict_baseline<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize, const L: usize>(
    step: &StepConstants<T, B>,
    x: &mut [V; N],
    p: &mut [V; L],
    driven: &[Driven<V>; B],
) {
    if N != B + 3 {
        return;
    }
    let ([a, b], decay, last) = (step.motion, step.baseline_decay, N - 1);
    let kept = [p[at(last, 0)] * decay, p[at(last, 1)] * decay];
    p[at(last, 0)] = dot(kept, a);
    p[at(last, 1)] = dot(kept, b);
    for i in 0..B {
        let Driven { pull, row, .. } = driven[i];
        let own = p[at(last, 2 + i)].mul_add(step.baseline_decays[i], dot(row, kept));
        p[at(last, 2 + i)] = pull.mul_add(p[at(last, 0)], own);
    }
    x[last] *= decay;
    p[at(last, last)] = p[at(last, last)].mul_add(step.baseline_square, step.baseline_variance);
}

/// As [`ohmstrain_model::unexplained`].
#[inline(always)]
fn unexplained<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, extends: V, retracts: V, variance: V) -> V {
    let both = extends * T::of(4.0) * retracts;
    let (constant, growth) = UNEXPLAINED_SHAPE;
    let shape = both.mul_add(V::splat(simd, T::of(growth)), T::of(constant));
    variance * T::of(UNEXPLAINED) * both * shape
}

pub(super) const CLEAR: f64 = <Compact as Switch<f64>>::CLEAR;

impl<V> RateSpread<V> {
    #[inline(always)]
    fn new<T: Lane, S: Simd>(simd: S, variance: V) -> Self
    where
        V: SimdFloat<S, Element = T>,
    {
        let square = variance * T::of(9.0);
        let per_square = V::splat(simd, T::one()) / square;
        let per_width = per_square.sqrt();
        Self { variance, width: square * per_width, per_width, per_square }
    }

    /// [`Compact`]; means nothing where the rate is clear.
    #[inline(always)]
    pub(super) fn split<T: Lane, S: Simd>(&self, simd: S, rate: V) -> SplitRate<V>
    where
        V: SimdFloat<S, Element = T>,
    {
        let half = V::splat(simd, T::of(0.5));
        let u = rate * self.per_width;
        let w = rate * rate * self.per_square;
        let (minus_w, fourth) = (-w, w * w);
        let number = |number: f64| V::splat(simd, T::of(number));
        let lean = fourth.mul_add(
            minus_w.mul_add(number(0.15625), number(0.65625)),
            minus_w.mul_add(number(1.09375), number(1.09375)),
        );
        let outer = fourth.mul_add(number(0.01953125), minus_w.mul_add(number(0.109375), number(0.2734375)));
        let spread = (-fourth).mul_add(outer, w.mul_add(number(0.546875), number(0.13671875)));
        let mean = rate * half;
        let (extend_probability, retract_probability) = (u.mul_add(lean, half), (-u).mul_add(lean, half));
        SplitRate {
            extend: self.width.mul_add(spread, mean),
            retract: (-self.width).mul_add(spread, mean),
            extend_probability,
            retract_probability,
            variance: unexplained(
                simd,
                extend_probability,
                retract_probability,
                self.width * self.width * number(1.0 / 9.0),
            ),
        }
    }
}
