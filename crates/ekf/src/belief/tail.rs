//! Tails of the normal distribution, each from one exponential and one division of polynomials.
#![allow(clippy::excessive_precision, reason = "coefficients as they were published")]

use ohmstrain_model::Scalar;

use crate::kernel::InVectors;

/// `f32` or `f64`: what filters of hypotheses compute with.
#[allow(private_bounds, reason = "sealed: what a vector holds")]
pub trait Real: Scalar + InVectors {}

impl Real for f32 {}
impl Real for f64 {}

/// What is above a border: its probability, and the density at the border over it (the hazard, the inverse of Mills' ratio).
pub(crate) struct Tail<T> {
    pub mass: T,
    pub hazard: T,
}

impl<T: Scalar> Tail<T> {
    /// Of a standard normal above `border`. The mass is off by up to about `border²` roundings.
    #[inline(always)]
    pub(crate) fn above(border: T) -> Self {
        let (half, x) = (T::of(0.5), border * T::of(core::f64::consts::FRAC_1_SQRT_2));
        let square = x * x;
        let falls = (-square).exp();
        let density = falls * T::of(PER_ROOT_TWO_PI);
        if square < T::of(NEAR) {
            let mass = half - half * x * near(square);
            return Self { mass, hazard: density / mass };
        }
        let scaled = if x < T::zero() { scaled(-x, square) } else { scaled(x, square) };
        let beyond = half * falls * scaled;
        if x < T::zero() {
            let mass = T::one() - beyond;
            return Self { mass, hazard: density / mass };
        }
        Self { mass: beyond, hazard: T::of(ROOT_TWO_PER_PI) / scaled }
    }
}

/// Probability of a standard normal above `x`, as [`Tail::above`].
#[inline]
pub(crate) fn upper_tail<T: Scalar>(x: T) -> T {
    let (half, x) = (T::of(0.5), x * T::of(core::f64::consts::FRAC_1_SQRT_2));
    let square = x * x;
    if square < T::of(NEAR) {
        return half - half * x * near(square);
    }
    if x < T::zero() {
        T::one() - half * (-square).exp() * scaled(-x, square)
    } else {
        half * (-square).exp() * scaled(x, square)
    }
}

const PER_ROOT_TWO_PI: f64 = 0.398_942_280_401_432_7;
const ROOT_TWO_PER_PI: f64 = 0.797_884_560_802_865_4;

// The rational approximations below are those of W. J. Cody, *Math. Comp.* 23 (1969) 631, in the coefficients of his CALERF
// (1990): each is off by less than a rounding of a double.

/// Square of the argument below which erf is taken: 0.46875².
const NEAR: f64 = 0.219_726_562_5;

/// `erf(x)/x`, for small squares.
#[inline(always)]
fn near<T: Scalar>(square: T) -> T {
    let above = [
        T::of(1.857_777_061_846_031_53e-1),
        T::of(3.161_123_743_870_565_60),
        T::of(1.138_641_541_510_501_56e2),
        T::of(3.774_852_376_853_020_21e2),
        T::of(3.209_377_589_138_469_47e3),
    ];
    let below = [
        T::of(1.0),
        T::of(2.360_129_095_234_412_09e1),
        T::of(2.440_246_379_344_441_73e2),
        T::of(1.282_616_526_077_372_28e3),
        T::of(2.844_236_833_439_170_62e3),
    ];
    polynomial(above, square) / polynomial(below, square)
}

/// `exp(x²) erfc(x)` from 0.46875 on.
#[inline(always)]
fn scaled<T: Scalar>(x: T, square: T) -> T {
    if x > T::of(4.0) {
        return far(x, square);
    }
    let above = [
        T::of(2.153_115_354_744_038_46e-8),
        T::of(5.641_884_969_886_700_89e-1),
        T::of(8.883_149_794_388_375_94),
        T::of(6.611_919_063_714_162_95e1),
        T::of(2.986_351_381_974_001_31e2),
        T::of(8.819_522_212_417_690_90e2),
        T::of(1.712_047_612_634_070_58e3),
        T::of(2.051_078_377_826_071_47e3),
        T::of(1.230_339_354_797_997_25e3),
    ];
    let below = [
        T::of(1.0),
        T::of(1.574_492_611_070_983_47e1),
        T::of(1.176_939_508_913_124_99e2),
        T::of(5.371_811_018_620_098_58e2),
        T::of(1.621_389_574_566_690_19e3),
        T::of(3.290_799_235_733_459_63e3),
        T::of(4.362_619_090_143_247_16e3),
        T::of(3.439_367_674_143_721_64e3),
        T::of(1.230_339_354_803_749_42e3),
    ];
    polynomial(above, x) / polynomial(below, x)
}

/// The same beyond 4.
#[inline(never)]
fn far<T: Scalar>(x: T, square: T) -> T {
    let above = [
        T::of(1.631_538_713_730_209_78e-2),
        T::of(3.053_266_349_612_323_44e-1),
        T::of(3.603_448_999_498_044_39e-1),
        T::of(1.257_817_261_112_292_46e-1),
        T::of(1.608_378_514_874_227_66e-2),
        T::of(6.587_491_615_298_378_03e-4),
    ];
    let below = [
        T::of(1.0),
        T::of(2.568_520_192_289_822_42),
        T::of(1.872_952_849_923_467_25),
        T::of(5.279_051_029_514_284_12e-1),
        T::of(6.051_834_131_244_131_91e-2),
        T::of(2.335_204_976_268_691_85e-3),
    ];
    let w = T::one() / square;
    let less = w * polynomial(above, w) / polynomial(below, w);
    (T::of(core::f64::consts::FRAC_2_SQRT_PI) * T::of(0.5) - less) / x
}

/// By Horner's scheme, the coefficient of the highest power first: numbers of their own type, which a microcontroller without
/// double precision need not convert.
#[inline(always)]
fn polynomial<T: Scalar, const N: usize>(coefficients: [T; N], x: T) -> T {
    let mut sum = T::zero();
    for coefficient in coefficients {
        sum = sum * x + coefficient;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::{Tail, upper_tail};

    /// Against another implementation of erfc, and the definition of the hazard. An argument of `z²/2` is rounded twice on its
    /// way into the exponential, and the polynomials take some ten roundings more.
    #[test]
    fn a_tail_is_that_of_erfc() {
        for k in -900..=3700 {
            let z = f64::from(k) * 0.01 + 1e-3;
            let expected = 0.5 * libm::erfc(z * core::f64::consts::FRAC_1_SQRT_2);
            let tail = Tail::above(z);
            let rounding = (16.0 + z * z) * f64::EPSILON;
            assert_eq!(tail.mass, upper_tail(z), "{z}");
            assert!((tail.mass / expected - 1.0).abs() < rounding, "{z}: {} {expected}", tail.mass);
            let hazard = (-0.5 * z * z).exp() / core::f64::consts::TAU.sqrt() / expected;
            assert!((tail.hazard / hazard - 1.0).abs() < 2.0 * rounding, "{z}: {} {hazard}", tail.hazard);
            let single = Tail::above(z as f32);
            let z = f64::from(z as f32);
            let expected = 0.5 * libm::erfc(z * core::f64::consts::FRAC_1_SQRT_2);
            let rounding = (16.0 + z * z) * f64::from(f32::EPSILON);
            if z < 12.0 {
                assert!((f64::from(single.mass) / expected - 1.0).abs() < rounding, "{z}: {} {expected}", single.mass);
            }
        }
        assert_eq!((upper_tail(0.0), upper_tail(f64::INFINITY), upper_tail(f64::NEG_INFINITY)), (0.5, 0.0, 1.0));
        assert!(
            Tail::above(f64::NAN).mass.is_nan() && Tail::above(60.0).mass == 0.0 && Tail::above(60.0).hazard > 60.0
        );
    }
}
