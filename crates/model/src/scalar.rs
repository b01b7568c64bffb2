use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

use nalgebra::{ComplexField, RealField};

/// Number type of all computations: `f32`, `f64`, or a dual number that carries exact derivatives.
pub trait Scalar: RealField + Copy {
    /// Returns the value nearest to a literal of the source text.
    // Inlined at any optimisation level, so that a constant is converted at compile time. At run time, a microcontroller
    // without double precision would do it in software.
    #[inline(always)]
    fn of(value: f64) -> Self {
        nalgebra::convert(value)
    }
}

impl<T: RealField + Copy> Scalar for T {}

/// Scalar operations only, for any [`Scalar`] or for an expression that stands for a number and records the operations on
/// it. A comparison selects a branch of the computation.
pub trait Number:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + MulAssign
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Returns the value nearest to a literal of the source text.
    #[must_use]
    fn of(value: f64) -> Self;
    /// Returns the larger number.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// Returns the smaller number.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Exponential.
    #[must_use]
    fn exp(self) -> Self;
    /// Exponential minus one.
    #[must_use]
    fn exp_m1(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;

    /// True if the number is neither infinite nor NaN.
    fn is_finite(self) -> bool;

    /// Zero.
    #[must_use]
    #[inline(always)]
    fn zero() -> Self {
        Self::of(0.0)
    }

    /// One.
    #[must_use]
    #[inline(always)]
    fn one() -> Self {
        Self::of(1.0)
    }
}

impl<T: Scalar> Number for T {
    #[inline(always)]
    fn of(value: f64) -> Self {
        <T as Scalar>::of(value)
    }

    #[inline(always)]
    fn is_finite(self) -> bool {
        ComplexField::is_finite(&self)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        RealField::max(self, other)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        RealField::min(self, other)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        ComplexField::abs(self)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        ComplexField::sqrt(self)
    }

    #[inline(always)]
    fn exp(self) -> Self {
        ComplexField::exp(self)
    }

    #[inline(always)]
    fn exp_m1(self) -> Self {
        ComplexField::exp_m1(self)
    }

    #[inline(always)]
    fn tanh(self) -> Self {
        ComplexField::tanh(self)
    }
}
