//! The sparse filter's update on vectors, by the rules of the prediction in `kernel.rs`.

use fearless_simd::{Select, Simd, SimdFloat};
use ohmstrain_model::{Gauge, StrainRange};

use super::kernel::{Beliefs, CLEAR, RateSpread, at, dot, sum};
use super::lane::Lane;
use crate::{Compact, SparseEkf};

/// Readings compared with their predictions.
pub(super) struct Compared<V> {
    pub(super) innovation: V,
    pub(super) variance: V,
    pub(super) nis: V,
}

/// Takes the readings of the lanes in `present`, and leaves the others as they are.
#[inline(always)]
pub(super) fn update<T: Lane, S: Simd, V: SimdFloat<S, Element = T>, const B: usize, const N: usize, const L: usize>(
    simd: S,
    ekf: &SparseEkf<T, Compact, B, N>,
    Beliefs { mean: x, covariance: p }: &mut Beliefs<V, N, L>,
    (reading, extra_variance): (V, V),
    present: V::Mask,
    spread: &RateSpread<V>,
) -> Compared<V> {
    let law = ekf.model().law();
    let (gauge, slope) = curve(simd, &law.gauge, &law.range, x[0]);
    let viscosities = [law.extend_viscosity_s, law.retract_viscosity_s];
    let (mut expected, viscosity, open) = with_dash_pot(simd, gauge, viscosities, x[1], spread);

    // P Hᵀ, and S = H P Hᵀ + R.
    let mut ph = [expected; N];
    for i in 0..N {
        ph[i] = dot([slope, viscosity], [p[at(i, 0)], if i == 0 { p[at(1, 0)] } else { p[at(i, 1)] }]);
    }
    for i in 2..N {
        ph[i] += p[at(i, i)];
    }
    for i in 2..N {
        expected += x[i];
        ph[0] += p[at(i, 0)];
        ph[1] += p[at(i, 1)];
        for k in 2..i {
            ph[i] += p[at(i, k)];
            ph[k] += p[at(i, k)];
        }
    }
    let mut variance = sum(extra_variance + ekf.reading.variance + open, [ph[0], ph[1]], [slope, viscosity]);
    for ph in &ph[2..] {
        variance += *ph;
    }

    let innovation = reading - expected;
    let zero = V::splat(simd, T::zero());
    let per_variance = present.select(V::splat(simd, T::one()) / variance, zero);
    let scaled = present.select(innovation * per_variance, zero);
    for i in 0..N {
        x[i] = ph[i].mul_add(scaled, x[i]);
        let minus_gain = -(ph[i] * per_variance);
        for j in 0..=i {
            p[at(i, j)] = minus_gain.mul_add(ph[j], p[at(i, j)]);
        }
    }
    Compared { innovation, variance, nis: innovation * scaled }
}

/// The expected reading of motion alone, its derivative by the rate, and the variance of what the direction leaves open.
#[inline(always)]
fn with_dash_pot<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(
    simd: S,
    gauge: V,
    viscosities: [T; 2],
    rate: V,
    spread: &RateSpread<V>,
) -> (V, V, V) {
    let uncertain = (rate * rate).simd_lt(spread.variance * T::of(CLEAR * CLEAR));
    let split = spread.split(simd, rate);
    let [extend, retract] = viscosities.map(|viscosity| V::splat(simd, viscosity));
    let here = rate.simd_gt(T::zero()).select(extend, retract);
    let expected = sum(gauge, [split.extend, split.retract], viscosities);
    let slope = dot([split.extend_probability, split.retract_probability], viscosities);
    let jump = extend - retract;
    let open = uncertain.select(jump * jump * split.variance, V::splat(simd, T::zero()));
    (uncertain.select(expected, here.mul_add(rate, gauge)), uncertain.select(slope, here), open)
}

/// The gauge within the range and its tangent outside, and the slope: a polynomial in vectors, what needs an exponential
/// sensor by sensor.
#[inline(always)]
fn curve<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(
    simd: S,
    gauge: &Gauge<T>,
    range: &StrainRange<T>,
    strain: V,
) -> (V, V) {
    let inside = strain.max(range.lower).min(range.upper);
    let (value, slope) = if let Gauge::Polynomial { coefficients: [a1, a2, a3] } = *gauge {
        let value = inside * inside.mul_add(inside.mul_add(V::splat(simd, a3), a2), a1);
        (value, inside.mul_add((inside * T::of(3.0)).mul_add(a3, T::of(2.0) * a2), a1))
    } else {
        one_by_one(gauge, inside)
    };
    (slope.mul_add(strain - inside, value), slope)
}

#[cold]
#[inline(always)]
fn one_by_one<T: Lane, S: Simd, V: SimdFloat<S, Element = T>>(gauge: &Gauge<T>, strain: V) -> (V, V) {
    let (mut value, mut slope) = (strain, strain);
    for (value, slope) in value.as_mut_slice().iter_mut().zip(slope.as_mut_slice()) {
        (*value, *slope) = gauge.value_and_slope(*value);
    }
    (value, slope)
}
