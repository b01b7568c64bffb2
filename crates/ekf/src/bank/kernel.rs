//! [`SparseEkf::step`] on vectors: the same operations on the same numbers in the same order, and where it branches, both
//! results and a choice. No multiplication is fused with an addition, so every instruction set gives the same numbers.

use fearless_simd::{Select, Simd, SimdFloat, SimdInto};
use ohmstrain_model::{Gauge, SplitRate, StrainRange};

use super::Lane;
use crate::sparse::BranchStep;
use crate::{Compact, SparseEkf, Switch};

/// Beliefs of as many sensors as a vector has lanes; of the covariance the lower triangle.
pub(super) struct Beliefs<V, const N: usize> {
    pub(super) mean: [V; N],
    pub(super) covariance: [[V; N]; N],
}

/// What an update compared, for every lane.
pub(super) struct Compared<V> {
    pub(super) innovation: V,
    pub(super) variance: V,
}

/// What a step does to one branch, and with which gain it was driven.
#[derive(Clone, Copy)]
struct Driven<V> {
    gain: V,
    pull: V,
    row: [V; 2],
}

#[inline(always)]
pub(super) fn predict<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    Beliefs { mean: x, covariance: p }: &mut Beliefs<V, N>,
) {
    let [a, b] = ekf.motion;
    let (strain, rate) = (x[0], x[1]);
    x[0] = dot([strain, rate], a) + ekf.motion_input[0];
    x[1] = dot([strain, rate], b) + ekf.motion_input[1];
    let from_strain = [dot([p[0][0], p[1][0]], a), dot([p[1][0], p[1][1]], a)];
    let from_rate = [dot([p[0][0], p[1][0]], b), dot([p[1][0], p[1][1]], b)];
    let rate_variance = dot(from_rate, b) + ekf.motion_noise[2];

    let mid_strain = (strain + x[0]) * T::of(0.5);
    let rate_sd = rate_variance.sqrt();
    let zero = V::splat(simd, T::zero());
    let mut driven = [Driven { gain: zero, pull: zero, row: [zero; 2] }; B];
    for i in 0..B {
        let branch = &ekf.branches[i];
        let unit_drive = dot([strain, rate], branch.drive) + branch.drive_input;
        let split = split(simd, unit_drive * branch.per_reach, rate_variance, rate_sd);
        let change;
        (driven[i], change) = drive(simd, ekf, branch, mid_strain, &split);
        x[2 + i] = x[2 + i].mul_add(branch.decay, change);
    }

    predict_baseline(ekf, x, p, &driven);
    predict_branches(ekf, p, &driven);
    p[0][0] = dot(from_strain, a) + ekf.motion_noise[0];
    p[1][0] = dot(from_rate, a) + ekf.motion_noise[1];
    p[1][1] = rate_variance;
}

/// What the motion does to a branch, and by how much it changes it.
#[inline(always)]
fn drive<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    branch: &BranchStep<T, B>,
    mid_strain: V,
    split: &SplitRate<V>,
) -> (Driven<V>, V) {
    let range = &ekf.model.law().range;
    let at = clamped(range, mid_strain);
    let inside = mid_strain.simd_ge(range.lower) & mid_strain.simd_le(range.upper);
    let (extend, retract) = (at.mul_add(branch.extend[1], branch.extend[0]), at.mul_add(branch.retract[1], branch.retract[0]));
    let gain = dot([split.extend_probability, split.retract_probability], [extend, retract]);
    let change = dot([split.extend, split.retract], [extend, retract]) * branch.reach_s;
    let growth = dot([split.extend, split.retract], [branch.extend[1], branch.retract[1]]);
    let pull = inside.select(growth * (branch.reach_s * T::of(0.5)), V::splat(simd, T::zero()));
    let a = &ekf.motion[0];
    let row = [dot([gain, pull], [branch.drive[0], a[0]]) + pull, dot([gain, pull], [branch.drive[1], a[1]])];
    (Driven { gain, pull, row }, change)
}

/// The baseline's row, from the others' old values.
#[inline(always)]
fn predict_baseline<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize>(
    ekf: &SparseEkf<T, Compact, B, N>,
    x: &mut [V; N],
    p: &mut [[V; N]; N],
    driven: &[Driven<V>; B],
) {
    if N != B + 3 {
        return;
    }
    let (last, decay) = (N - 1, ekf.baseline_decay);
    let (with_strain, with_rate) = (p[last][0] * decay, p[last][1] * decay);
    for i in 0..B {
        let row = &driven[i].row;
        p[last][2 + i] =
            p[last][2 + i].mul_add(decay * ekf.branches[i].decay, dot(*row, [with_strain, with_rate]));
    }
    let [a, b] = ekf.motion;
    p[last][0] = dot([with_strain, with_rate], a);
    p[last][1] = dot([with_strain, with_rate], b);
    p[last][last] = p[last][last].mul_add(decay * decay, ekf.baseline_variance);
    x[last] = x[last] * decay;
}

/// The branches' rows, the last one first: each needs the old values of those before it and of the motion.
#[inline(always)]
fn predict_branches<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize>(
    ekf: &SparseEkf<T, Compact, B, N>,
    p: &mut [[V; N]; N],
    driven: &[Driven<V>; B],
) {
    let [a, b] = ekf.motion;
    for i in (0..B).rev() {
        let (c, branch, Driven { gain, pull, row }) = (2 + i, &ekf.branches[i], driven[i]);
        let carried = [
            p[c][0].mul_add(branch.decay, dot(row, [p[0][0], p[1][0]])),
            p[c][1].mul_add(branch.decay, dot(row, [p[1][0], p[1][1]])),
        ];
        let cross = [
            dot([gain, pull], [branch.cross_noise[0], ekf.motion_noise[0]]),
            dot([gain, pull], [branch.cross_noise[1], ekf.motion_noise[1]]),
        ];
        for k in 0..=i {
            let (other, to) = (&ekf.branches[k], &driven[k]);
            let kept = p[c][2 + k].mul_add(branch.decay, dot(row, [p[2 + k][0], p[2 + k][1]]));
            let noise = dot([to.pull, to.gain], [cross[0], dot([gain, pull], [branch.branch_noise[k], other.cross_noise[0]])]);
            p[c][2 + k] = kept.mul_add(other.decay, dot(carried, to.row)) + noise;
        }
        p[c][c] = p[c][c] + branch.variance;
        p[c][0] = dot(carried, a) + cross[0];
        p[c][1] = dot(carried, b) + cross[1];
    }
}

/// Takes the readings of the lanes in `present`, and leaves the others as they are.
#[inline(always)]
pub(super) fn update<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    Beliefs { mean: x, covariance: p }: &mut Beliefs<V, N>,
    (reading, extra_variance): (V, V),
    present: V::Mask,
) -> Compared<V> {
    let law = ekf.model.law();
    let inside = clamped(&law.range, x[0]);
    let (gauge, slope) = value_and_slope(simd, &law.gauge, inside);
    let mut expected = slope.mul_add(x[0] - inside, gauge);
    let rate = split(simd, x[1], p[1][1], p[1][1].sqrt());
    let (extend, retract) = (law.extend_viscosity_s, law.retract_viscosity_s);
    expected += dot([rate.extend, rate.retract], [extend, retract]);
    let viscosity = dot([rate.extend_probability, rate.retract_probability], [extend, retract]);
    for c in &x[2..] {
        expected += *c;
    }
    let mut spread = [expected; N];
    for i in 0..N {
        spread[i] = dot([slope, viscosity], [p[i][0], if i == 0 { p[1][0] } else { p[i][1] }]);
        for k in 2..N {
            spread[i] += if k <= i { p[i][k] } else { p[k][i] };
        }
    }
    let mut variance = dot([slope, viscosity], [spread[0], spread[1]]) + ekf.reading_variance + extra_variance;
    for s in &spread[2..] {
        variance += *s;
    }
    let innovation = reading - expected;
    let zero = V::splat(simd, T::zero());
    let per_variance = present.select(V::splat(simd, T::one()) / variance, zero);
    let surprise = present.select(innovation, zero);
    for i in 0..N {
        let gain = spread[i] * per_variance;
        x[i] = gain.mul_add(surprise, x[i]);
        for j in 0..=i {
            p[i][j] = (-gain).mul_add(spread[j], p[i][j]);
        }
    }
    Compared { innovation, variance }
}

/// `a₀ b₀ + a₁ b₁`.
#[inline(always)]
fn dot<S: Simd, V: SimdFloat<S>>([a0, a1]: [V; 2], [b0, b1]: [impl SimdInto<V, S>; 2]) -> V {
    a1.mul_add(b1, a0 * b0.simd_into(a0.token()))
}

/// [`Compact`] on every lane, and one direction where the rate is clear.
#[inline(always)]
fn split<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, rate: V, variance: V, sd: V) -> SplitRate<V> {
    let half = V::splat(simd, T::of(0.5));
    let width = sd * T::of(3.0);
    let u = rate / width;
    let w = u * u;
    let polynomial = |coefficients: [f64; 4]| {
        let [c0, c1, c2, c3] = coefficients.map(T::of);
        let minus = -w;
        minus.mul_add(minus.mul_add(minus.mul_add(c3, c2), c1), c0)
    };
    let lean = u * polynomial([1.09375, 1.09375, 0.65625, 0.15625]);
    let both = width * w.mul_add(polynomial([0.546875, 0.2734375, 0.109375, 0.01953125]), T::of(0.13671875));
    // One direction in the same form: half the rate, and half its size more or less.
    let uncertain = (rate * rate).simd_lt(variance * T::of(CLEAR * CLEAR));
    let half_rate = rate * half;
    let clear_lean = rate.simd_gt(T::zero()).select(half, V::splat(simd, T::of(-0.5)));
    let (lean, both) = (uncertain.select(lean, clear_lean), uncertain.select(both, half_rate.abs()));
    SplitRate {
        extend: half_rate + both,
        retract: half_rate - both,
        extend_probability: half + lean,
        retract_probability: half - lean,
    }
}

const CLEAR: f64 = <Compact as Switch<f64>>::CLEAR;

#[inline(always)]
fn clamped<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(range: &StrainRange<T>, strain: V) -> V {
    strain.max(range.lower).min(range.upper)
}

/// [`Gauge::value_and_slope`]: a polynomial in vectors, what needs an exponential sensor by sensor.
#[inline(always)]
fn value_and_slope<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, gauge: &Gauge<T>, strain: V) -> (V, V) {
    if let Gauge::Polynomial { coefficients: [a1, a2, a3] } = *gauge {
        let value = strain * strain.mul_add(strain.mul_add(a3, a2), a1);
        let slope = strain.mul_add((strain * T::of(3.0)).mul_add(a3, T::of(2.0) * a2), a1);
        return (value, slope);
    }
    let (mut value, mut slope) = (strain, V::splat(simd, T::zero()));
    let each = value.as_mut_slice().iter_mut().zip(slope.as_mut_slice());
    for (value, slope) in each {
        (*value, *slope) = gauge.value_and_slope(*value);
    }
    (value, slope)
}
