//! Tails of the normal distribution, each from one exponential and one division of polynomials.
#![allow(clippy::excessive_precision, reason = "coefficients as they were published")]

use ohmstrain_model::{Number, Scalar};

use super::{Falls, InVectors, Lanes};
use crate::Gaussian;

/// Number type of filters of hypotheses: `f32` or `f64`.
#[allow(private_bounds, reason = "sealed: what a vector holds")]
pub trait Real: Scalar + InVectors {}

impl Real for f32 {}
impl Real for f64 {}

/// A [`Real`], or an expression that stands for one and records the operations on it (feature `record`); used by scalar
/// computations around the kernel.
#[allow(private_bounds, reason = "sealed: what there are exponentials for")]
pub trait Recordable: Number + Falls {}

impl<T: Real> Recordable for T {}

/// Upper tail above a border: its probability, and the density at the border divided by it (the hazard, the inverse of Mills'
/// ratio).
pub(crate) struct Tail<T> {
    pub mass: T,
    pub hazard: T,
}

impl<V: Falls> Tail<V> {
    /// Computes the tail of a standard normal above `border`, in the lanes `wanted`. The error of the mass is up to about `border²`
    /// roundings.
    #[inline(always)]
    pub(crate) fn above(border: V, wanted: V::Mask) -> Self {
        let (half, one, zero) = (border.literal(0.5), border.literal(1.0), border.nothing());
        let x = border * border.literal(core::f64::consts::FRAC_1_SQRT_2);
        let square = x * x;
        let falls = (-square).falling();
        let density = falls * border.literal(PER_ROOT_TWO_PI);
        let (is_near, below) = (square.less(border.literal(NEAR)), x.less(zero));
        let mut mass = one;
        if !V::none(V::both(wanted, is_near)) {
            mass = half - half * x * near(square);
            if V::all(is_near) {
                return Self { mass, hazard: density.over(mass) };
            }
        }
        let scaled = scaled(V::pick(below, -x, x), square);
        let beyond = half * falls * scaled;
        mass = V::pick(is_near, mass, V::pick(below, one - beyond, beyond));
        // Far above, both density and mass underflow; their ratio is taken without the common exponential.
        let by_mass = V::either(is_near, below);
        let (above, under) =
            (V::pick(by_mass, density, border.literal(ROOT_TWO_PER_PI)), V::pick(by_mass, mass, scaled));
        Self { mass, hazard: above.over(under) }
    }
}

/// Returns the probability of a standard normal above `x`.
#[inline]
fn upper_tail<T: Real>(x: T) -> T {
    Tail::above(x, true).mass
}

impl<T: Real> Gaussian<T> {
    /// Returns the probability of a value above `x`.
    #[must_use]
    pub fn probability_above(&self, x: T) -> T {
        if self.variance <= T::zero() {
            return if self.mean > x { T::one() } else { T::zero() };
        }
        upper_tail((x - self.mean) / self.variance.sqrt())
    }
}

const PER_ROOT_TWO_PI: f64 = 0.398_942_280_401_432_7;
const ROOT_TWO_PER_PI: f64 = 0.797_884_560_802_865_4;

// The rational approximations below are those of W. J. Cody, *Math. Comp.* 23 (1969) 631, with the coefficients of his
// CALERF (1990). The error of each is below one rounding of a double.

/// Square of the argument below which erf is used: 0.46875².
const NEAR: f64 = 0.219_726_562_5;

/// Returns `erf(x)/x` for small squares.
#[inline(always)]
fn near<V: Lanes>(square: V) -> V {
    let c = <V::Number as Scalar>::of;
    let above = [
        c(1.857_777_061_846_031_53e-1),
        c(3.161_123_743_870_565_60),
        c(1.138_641_541_510_501_56e2),
        c(3.774_852_376_853_020_21e2),
        c(3.209_377_589_138_469_47e3),
    ];
    let below = [
        c(1.0),
        c(2.360_129_095_234_412_09e1),
        c(2.440_246_379_344_441_73e2),
        c(1.282_616_526_077_372_28e3),
        c(2.844_236_833_439_170_62e3),
    ];
    polynomial(above, square).over(polynomial(below, square))
}

/// Returns `exp(x²) erfc(x)` for x from 0.46875.
#[inline(always)]
fn scaled<V: Lanes>(x: V, square: V) -> V {
    let is_far = x.literal(4.0).less(x);
    if V::all(is_far) {
        return far(x, square);
    }
    let c = <V::Number as Scalar>::of;
    let above = [
        c(2.153_115_354_744_038_46e-8),
        c(5.641_884_969_886_700_89e-1),
        c(8.883_149_794_388_375_94),
        c(6.611_919_063_714_162_95e1),
        c(2.986_351_381_974_001_31e2),
        c(8.819_522_212_417_690_90e2),
        c(1.712_047_612_634_070_58e3),
        c(2.051_078_377_826_071_47e3),
        c(1.230_339_354_797_997_25e3),
    ];
    let below = [
        c(1.0),
        c(1.574_492_611_070_983_47e1),
        c(1.176_939_508_913_124_99e2),
        c(5.371_811_018_620_098_58e2),
        c(1.621_389_574_566_690_19e3),
        c(3.290_799_235_733_459_63e3),
        c(4.362_619_090_143_247_16e3),
        c(3.439_367_674_143_721_64e3),
        c(1.230_339_354_803_749_42e3),
    ];
    let middle = polynomial(above, x).over(polynomial(below, x));
    if V::none(is_far) { middle } else { V::pick(is_far, far(x, square), middle) }
}

/// Returns `exp(x²) erfc(x)` for x beyond 4.
#[inline(always)]
fn far<V: Lanes>(x: V, square: V) -> V {
    let c = <V::Number as Scalar>::of;
    let above = [
        c(1.631_538_713_730_209_78e-2),
        c(3.053_266_349_612_323_44e-1),
        c(3.603_448_999_498_044_39e-1),
        c(1.257_817_261_112_292_46e-1),
        c(1.608_378_514_874_227_66e-2),
        c(6.587_491_615_298_378_03e-4),
    ];
    let below = [
        c(1.0),
        c(2.568_520_192_289_822_42),
        c(1.872_952_849_923_467_25),
        c(5.279_051_029_514_284_12e-1),
        c(6.051_834_131_244_131_91e-2),
        c(2.335_204_976_268_691_85e-3),
    ];
    let w = square.recip();
    let less = (w * polynomial(above, w)).over(polynomial(below, w));
    (x.literal(core::f64::consts::FRAC_2_SQRT_PI) * x.literal(0.5) - less).over(x)
}

/// Evaluates a polynomial by Horner's scheme, the coefficient of the highest power first. The coefficients have the lanes' number
/// type, so that a microcontroller without double precision need not convert them.
#[inline(always)]
fn polynomial<V: Lanes, const N: usize>(coefficients: [V::Number; N], x: V) -> V {
    let mut sum = x.with(coefficients[0]);
    for k in 1..N {
        sum = sum.mul_add(x, x.with(coefficients[k]));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{Tail, upper_tail};

    /// Compares with another implementation of erfc, and with the definition of the hazard. The argument `z²/2` of the
    /// exponential is rounded twice, and the polynomials add about ten roundings.
    #[test]
    fn a_tail_is_that_of_erfc() {
        for k in -900..=3700 {
            let z = f64::from(k) * 0.01 + 1e-3;
            let expected = 0.5 * libm::erfc(z * core::f64::consts::FRAC_1_SQRT_2);
            let tail = Tail::above(z, true);
            let rounding = (16.0 + z * z) * f64::EPSILON;
            assert!((tail.mass / expected - 1.0).abs() < rounding, "{z}: {} {expected}", tail.mass);
            let hazard = (-0.5 * z * z).exp() / core::f64::consts::TAU.sqrt() / expected;
            assert!((tail.hazard / hazard - 1.0).abs() < 2.0 * rounding, "{z}: {} {hazard}", tail.hazard);
            let single = Tail::above(z as f32, true);
            let z = f64::from(z as f32);
            let expected = 0.5 * libm::erfc(z * core::f64::consts::FRAC_1_SQRT_2);
            let rounding = (16.0 + z * z) * f64::from(f32::EPSILON);
            if z < 12.0 {
                assert!((f64::from(single.mass) / expected - 1.0).abs() < rounding, "{z}: {} {expected}", single.mass);
            }
        }
        assert_eq!((upper_tail(0.0), upper_tail(f64::INFINITY), upper_tail(f64::NEG_INFINITY)), (0.5, 0.0, 1.0));
        assert!(
            Tail::above(f64::NAN, true).mass.is_nan()
                && Tail::above(60.0_f64, true).mass == 0.0
                && Tail::above(60.0_f64, true).hazard > 60.0
        );
    }
}
