//! Exponentials of numbers up to zero, with the same bits on every machine, and normal tails for hypotheses.

use super::tail::Tail;
use super::{InVectors, Lanes, Several};

/// Constants of `2ⁿ eʳ` in one precision.
pub(crate) struct Falling<T: 'static> {
    /// Smallest argument; below it the exponential is zero.
    pub least: T,
    /// 1.5 · 2ᵐ plus the exponent's bias. Added to a number, it leaves the nearest integer, plus that bias, in the lowest bits
    /// of the mantissa.
    pub rounds: T,
    /// ln 2 in two parts, as in fdlibm and Cephes; the first has so few bits that its products with n are exact.
    pub ln_2: [T; 2],
    /// Coefficients 1/k! of the Taylor series.
    pub series: &'static [T],
    /// Number m of bits of the mantissa.
    pub mantissa: u32,
}

/// 1/k! for k up to 13.
pub(super) const INVERSE_FACTORIALS: [f64; 14] = {
    let mut inverses = [1.0; 14];
    let mut k = 1;
    while k < 14 {
        inverses[k] = inverses[k - 1] / k as f64;
        k += 1;
    }
    inverses
};

/// Inverse factorials up to k = 7, in single precision; constants, so that no program computes them.
pub(super) const INVERSE_FACTORIALS_F32: [f32; 8] = {
    let mut inverses = [1.0; 8];
    let mut k = 1;
    while k < 8 {
        inverses[k] = INVERSE_FACTORIALS[k] as f32;
        k += 1;
    }
    inverses
};

/// Lanes with the exponentials and tails that hypotheses and corrections need.
pub(crate) trait Falls: Lanes<Number: InVectors> {
    /// Returns 2ⁿ for a number with n, plus the exponent's bias, in its lowest bits.
    #[must_use]
    fn to_exponent(self) -> Self;

    /// Returns the exponentials of numbers up to zero.
    #[must_use]
    #[inline(always)]
    fn falling(self) -> Self {
        exponential(self)
    }

    /// Returns the upper tail of a standard normal above these borders, in the lanes `wanted`.
    #[must_use]
    #[inline(always)]
    fn tail(self, wanted: Self::Mask) -> Tail<Self> {
        Tail::above(self, wanted)
    }
}

impl<V: Several<Number: InVectors>> Falls for V {
    #[inline(always)]
    fn to_exponent(self) -> Self {
        self.bits_shifted(V::Number::FALLING.mantissa, InVectors::to_exponent)
    }
}

/// `2ⁿ eʳ` with |r| ≤ ln(2)/2.
#[inline(always)]
pub(crate) fn exponential<V: Falls>(exponents: V) -> V {
    let Falling { least, rounds, ln_2, series, .. } = V::Number::FALLING;
    let (least, rounds) = (exponents.with(least), exponents.with(rounds));
    let vanishes = exponents.less(least);
    let x = V::pick(vanishes, least, exponents);
    let rounded = x.mul_add(x.literal(core::f64::consts::LOG2_E), rounds);
    let n = rounded - rounds;
    let r = x - n.scale(ln_2[0]) - n.scale(ln_2[1]);
    let highest = series.len() - 1;
    let mut sum = x.with(series[highest]);
    for k in (0..highest).rev() {
        sum = sum.mul_add(r, x.with(series[k]));
    }
    V::pick(vanishes, x.nothing(), sum * rounded.to_exponent())
}

#[cfg(test)]
mod tests {
    use super::Falls;

    /// The error of the reduced argument is half a rounding of 0.35. That of the series is one rounding of 1, one of 0.35,
    /// and r times the error of its inner sums. The result is 0.7 or more. libm's error is one rounding.
    #[test]
    fn exponentials_of_what_is_not_above_zero() {
        for k in 0..70_800 {
            let x = -0.01 * f64::from(k);
            let (found, expected) = (x.falling(), x.exp());
            assert!((found - expected).abs() <= 3.0 * f64::EPSILON * expected, "{x}: {found} {expected}");
        }
        assert_eq!(0.0_f64.falling(), 1.0);
        assert_eq!((f64::NEG_INFINITY.falling(), (-709.0_f64).falling()), (0.0, 0.0));
        assert!(f64::NAN.falling().is_nan());
    }

    /// Compares the exponentials in single precision with those in double.
    #[test]
    fn exponentials_in_single_precision() {
        for k in 0..87_000 {
            let x = -0.001 * k as f32;
            let (found, expected) = (f64::from(x.falling()), f64::from(x).exp());
            assert!((found - expected).abs() <= 3.0 * f64::from(f32::EPSILON) * expected, "{x}: {found} {expected}");
        }
        assert_eq!(0.0_f32.falling(), 1.0);
        assert_eq!((f32::NEG_INFINITY.falling(), (-88.0_f32).falling()), (0.0, 0.0));
        assert!(f32::NAN.falling().is_nan());
    }
}
