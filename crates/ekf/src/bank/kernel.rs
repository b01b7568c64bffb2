//! [`SparseEkf::step`] on vectors: the same operations on the same numbers in the same order, and where it branches, both
//! results and a choice. No multiplication is fused with an addition, so every instruction set gives the same numbers.

use fearless_simd::{Select, Simd, SimdFloat};
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
    x[0] = strain * a[0] + rate * a[1] + ekf.motion_input[0];
    x[1] = strain * b[0] + rate * b[1] + ekf.motion_input[1];
    let from_strain = [p[0][0] * a[0] + p[1][0] * a[1], p[1][0] * a[0] + p[1][1] * a[1]];
    let from_rate = [p[0][0] * b[0] + p[1][0] * b[1], p[1][0] * b[0] + p[1][1] * b[1]];
    let rate_variance = from_rate[0] * b[0] + from_rate[1] * b[1] + ekf.motion_noise[2];

    let mid_strain = (strain + x[0]) * T::of(0.5);
    let rate_sd = rate_variance.sqrt();
    let zero = V::splat(simd, T::zero());
    let mut driven = [Driven { gain: zero, pull: zero, row: [zero; 2] }; B];
    for i in 0..B {
        let branch = &ekf.branches[i];
        let unit_drive = strain * branch.drive[0] + rate * branch.drive[1] + branch.drive_input;
        let split = split(simd, unit_drive * branch.per_reach, rate_variance, rate_sd);
        let change;
        (driven[i], change) = drive(simd, ekf, branch, mid_strain, &split);
        x[2 + i] = x[2 + i] * branch.decay + change;
    }

    predict_baseline(ekf, x, p, &driven);
    predict_branches(ekf, p, &driven);
    p[0][0] = from_strain[0] * a[0] + from_strain[1] * a[1] + ekf.motion_noise[0];
    p[1][0] = from_rate[0] * a[0] + from_rate[1] * a[1] + ekf.motion_noise[1];
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
    let (extend, retract) = (at * branch.extend[1] + branch.extend[0], at * branch.retract[1] + branch.retract[0]);
    let gain = split.extend_probability * extend + split.retract_probability * retract;
    let change = (split.extend * extend + split.retract * retract) * branch.reach_s;
    let growth = split.extend * branch.extend[1] + split.retract * branch.retract[1];
    let pull = inside.select(growth * (branch.reach_s * T::of(0.5)), V::splat(simd, T::zero()));
    let a = &ekf.motion[0];
    let row = [gain * branch.drive[0] + pull * a[0] + pull, gain * branch.drive[1] + pull * a[1]];
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
            row[0] * with_strain + row[1] * with_rate + p[last][2 + i] * (decay * ekf.branches[i].decay);
    }
    let [a, b] = ekf.motion;
    p[last][0] = with_strain * a[0] + with_rate * a[1];
    p[last][1] = with_strain * b[0] + with_rate * b[1];
    p[last][last] = p[last][last] * (decay * decay) + ekf.baseline_variance;
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
            row[0] * p[0][0] + row[1] * p[1][0] + p[c][0] * branch.decay,
            row[0] * p[1][0] + row[1] * p[1][1] + p[c][1] * branch.decay,
        ];
        let cross = [
            gain * branch.cross_noise[0] + pull * ekf.motion_noise[0],
            gain * branch.cross_noise[1] + pull * ekf.motion_noise[1],
        ];
        for k in 0..=i {
            let (other, to) = (&ekf.branches[k], &driven[k]);
            let kept = row[0] * p[2 + k][0] + row[1] * p[2 + k][1] + p[c][2 + k] * branch.decay;
            let noise = to.pull * cross[0] + to.gain * (gain * branch.branch_noise[k] + pull * other.cross_noise[0]);
            p[c][2 + k] = carried[0] * to.row[0] + carried[1] * to.row[1] + kept * other.decay + noise;
        }
        p[c][c] = p[c][c] + branch.variance;
        p[c][0] = carried[0] * a[0] + carried[1] * a[1] + cross[0];
        p[c][1] = carried[0] * b[0] + carried[1] * b[1] + cross[1];
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
    let mut expected = gauge + slope * (x[0] - inside);
    let rate = split(simd, x[1], p[1][1], p[1][1].sqrt());
    let (extend, retract) = (law.extend_viscosity_s, law.retract_viscosity_s);
    expected += rate.extend * extend + rate.retract * retract;
    let viscosity = rate.extend_probability * extend + rate.retract_probability * retract;
    for c in &x[2..] {
        expected += *c;
    }
    let mut spread = [expected; N];
    for i in 0..N {
        spread[i] = slope * p[i][0] + viscosity * if i == 0 { p[1][0] } else { p[i][1] };
        for k in 2..N {
            spread[i] += if k <= i { p[i][k] } else { p[k][i] };
        }
    }
    let mut variance = slope * spread[0] + viscosity * spread[1] + ekf.reading_variance + extra_variance;
    for s in &spread[2..] {
        variance += *s;
    }
    let innovation = reading - expected;
    let zero = V::splat(simd, T::zero());
    let per_variance = present.select(V::splat(simd, T::one()) / variance, zero);
    let surprise = present.select(innovation, zero);
    for i in 0..N {
        let gain = spread[i] * per_variance;
        x[i] += gain * surprise;
        for j in 0..=i {
            p[i][j] -= gain * spread[j];
        }
    }
    Compared { innovation, variance }
}

/// [`Compact`] on every lane, and one direction where the rate is clear.
#[inline(always)]
fn split<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(simd: S, rate: V, variance: V, sd: V) -> SplitRate<V> {
    let half = V::splat(simd, T::of(0.5));
    let width = sd * T::of(3.0);
    let u = rate / width;
    let w = u * u;
    let constant = |value: f64| V::splat(simd, T::of(value));
    let lean = u * (constant(1.09375) - w * (constant(1.09375) - w * (constant(0.65625) - w * T::of(0.15625))));
    let spread =
        w * (constant(0.546875) - w * (constant(0.2734375) - w * (constant(0.109375) - w * T::of(0.01953125))));
    let both = width * (spread + T::of(0.13671875));
    // One direction in the same form: half the rate, and half its size more or less.
    let uncertain = (rate * rate).simd_lt(variance * T::of(CLEAR * CLEAR));
    let half_rate = rate * half;
    let clear_lean = rate.simd_gt(T::zero()).select(half, constant(-0.5));
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
        let value = strain * (strain * (strain * a3 + a2) + a1);
        let slope = strain * (strain * T::of(3.0) * a3 + T::of(2.0) * a2) + a1;
        return (value, slope);
    }
    let (mut value, mut slope) = (strain, V::splat(simd, T::zero()));
    let each = value.as_mut_slice().iter_mut().zip(slope.as_mut_slice());
    for (value, slope) in each {
        (*value, *slope) = gauge.value_and_slope(*value);
    }
    (value, slope)
}
