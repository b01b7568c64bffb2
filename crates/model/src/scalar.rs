use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

use nalgebra::{ComplexField, RealField};

/// The numbers everything here computes with: `f32`, `f64`, or a dual number that carries exact derivatives.
pub trait Scalar: RealField + Copy {
    /// The nearest value to a literal of the source text.
    // Inlined at any optimisation, so that a constant is converted while compiling: at run time it would call software on a
    // microcontroller without double precision.
    #[inline(always)]
    fn of(value: f64) -> Self {
        nalgebra::convert(value)
    }
}

impl<T: RealField + Copy> Scalar for T {}

/// Operations of a computation number by number, and no more: any [`Scalar`], or an expression that stands for a number and
/// records the operations on it. A comparison chooses a way.
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
    /// The nearest value to a literal of the source text.
    #[must_use]
    fn of(value: f64) -> Self;
    /// The larger one.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// The smaller one.
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
    /// Exponential, less one.
    #[must_use]
    fn exp_m1(self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;

    /// True if it is neither infinite nor NaN.
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
