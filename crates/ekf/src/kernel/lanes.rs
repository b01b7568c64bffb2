use core::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use ohmstrain_model::Scalar;

/// Number type of the kernel: a scalar, or a vector with one number per lane, each of another sensor or hypothesis.
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + AddAssign
    + Mul<Output = Self>
    + MulAssign
    + Neg<Output = Self>
    + Sub<Output = Self>
    + SubAssign
{
    /// Number in one lane.
    type Number: Scalar;
    /// A truth value for every lane.
    type Mask: Copy;

    /// Number of lanes.
    const WIDTH: usize;

    /// Returns `number` in all lanes.
    #[must_use]
    fn with(self, number: Self::Number) -> Self;
    /// Returns `self · factor + term`, with a single rounding if the processor fuses it for vectors.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Returns the reciprocals.
    #[must_use]
    fn recip(self) -> Self;
    /// Returns the quotients.
    #[must_use]
    fn over(self, divisor: Self) -> Self;
    /// Returns the square roots.
    #[must_use]
    fn root(self) -> Self;
    /// Lanes where `self` is less than `other`.
    fn less(self, other: Self) -> Self::Mask;
    /// Lanes that are not negative; false for NaN.
    fn not_negative(self) -> Self::Mask;
    /// Lanes that are finite.
    fn finite(self) -> Self::Mask;
    /// Lanes where both masks are set.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Lanes where either mask is set.
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Lanes where the first mask is set and the second is not.
    fn without(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// True if the mask is set in no lane.
    fn none(mask: Self::Mask) -> bool;
    /// True if the mask is set in all lanes.
    fn all(mask: Self::Mask) -> bool;
    /// Returns `yes` in lanes where the mask is set, otherwise `no`.
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Returns the exponentials.
    #[must_use]
    fn exponential(self) -> Self;
    /// Returns `yes` if the mask is set in all lanes, `no` if in none, and `None` otherwise.
    fn one_of<'a, R>(mask: Self::Mask, yes: &'a R, no: &'a R) -> Option<&'a R>;
    /// Returns the row for below, within or above a range if the same row applies to all lanes, otherwise `None`. NaN
    /// counts as within.
    fn region<R>(self, lower: Self::Number, upper: Self::Number, rows: [&R; 3]) -> Option<&R>;

    /// `self · factor + term` with the same factor for all.
    #[must_use]
    #[inline(always)]
    fn scale_add(self, factor: Self::Number, term: Self) -> Self {
        self.mul_add(self.with(factor), term)
    }

    /// `self · factor` with the same factor for all.
    #[must_use]
    #[inline(always)]
    fn scale(self, factor: Self::Number) -> Self {
        self * self.with(factor)
    }

    /// A constant of the source text.
    #[must_use]
    #[inline(always)]
    fn literal(self, number: f64) -> Self {
        self.with(<Self::Number as Scalar>::of(number))
    }

    /// Zero in all lanes.
    #[must_use]
    #[inline(always)]
    fn nothing(self) -> Self {
        self.literal(0.0)
    }
}

impl<T: Scalar> Lanes for T {
    type Number = T;
    type Mask = bool;

    const WIDTH: usize = 1;

    #[inline(always)]
    fn with(self, number: T) -> T {
        number
    }

    #[inline(always)]
    fn mul_add(self, factor: T, term: T) -> T {
        self * factor + term
    }

    #[inline(always)]
    fn recip(self) -> T {
        T::one() / self
    }

    #[inline(always)]
    fn over(self, divisor: T) -> T {
        self / divisor
    }

    #[inline(always)]
    fn root(self) -> T {
        self.sqrt()
    }

    #[inline(always)]
    fn less(self, other: T) -> bool {
        self < other
    }

    #[inline(always)]
    fn not_negative(self) -> bool {
        self >= T::zero()
    }

    #[allow(clippy::eq_op, reason = "a number minus itself is zero only if it is finite")]
    #[inline(always)]
    fn finite(self) -> bool {
        self - self == T::zero()
    }

    #[inline(always)]
    fn both(a: bool, b: bool) -> bool {
        a && b
    }

    #[inline(always)]
    fn either(a: bool, b: bool) -> bool {
        a || b
    }

    #[inline(always)]
    fn without(a: bool, b: bool) -> bool {
        a && !b
    }

    #[inline(always)]
    fn none(mask: bool) -> bool {
        !mask
    }

    #[inline(always)]
    fn all(mask: bool) -> bool {
        mask
    }

    #[inline(always)]
    fn pick(mask: bool, yes: T, no: T) -> T {
        if mask { yes } else { no }
    }

    /// Computes the exponential. Never inlined: otherwise a compiler may compute it even for gauges without one.
    #[inline(never)]
    fn exponential(self) -> T {
        self.exp()
    }

    #[inline(always)]
    fn one_of<'a, R>(mask: bool, yes: &'a R, no: &'a R) -> Option<&'a R> {
        Some(if mask { yes } else { no })
    }

    #[inline(always)]
    fn region<R>(self, lower: T, upper: T, [below, within, above]: [&R; 3]) -> Option<&R> {
        Some(if self < lower {
            below
        } else if self > upper {
            above
        } else {
            within
        })
    }
}

/// A vector register, or as many as hold a row. It fuses products with sums unless it must give the same bits as
/// scalars.
#[cfg(feature = "simd")]
#[cfg_attr(
    not(any(target_arch = "x86_64", target_feature = "simd128")),
    expect(dead_code, reason = "other processors work on numbers")
)]
#[derive(Clone, Copy)]
pub(crate) struct Vector<V, S, const FUSED: bool = true> {
    pub numbers: V,
    pub simd: S,
}

#[cfg(feature = "simd")]
mod vector {
    use core::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub, SubAssign};

    use fearless_simd::{Select, Simd, SimdFloat, SimdMask};
    use ohmstrain_model::Scalar;

    use super::{Lanes, Vector};

    macro_rules! operation {
        ($trait:ident $method:ident, $assign:ident $assigned:ident) => {
            impl<S: Simd, V: SimdFloat<S>, const FUSED: bool> $trait for Vector<V, S, FUSED> {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self { numbers: self.numbers.$method(other.numbers), ..self }
                }
            }
            impl<S: Simd, V: SimdFloat<S>, const FUSED: bool> $assign for Vector<V, S, FUSED> {
                #[inline(always)]
                fn $assigned(&mut self, other: Self) {
                    *self = self.$method(other);
                }
            }
        };
    }
    operation!(Add add, AddAssign add_assign);
    operation!(Sub sub, SubAssign sub_assign);
    operation!(Mul mul, MulAssign mul_assign);

    impl<S: Simd, V: SimdFloat<S>, const FUSED: bool> Neg for Vector<V, S, FUSED> {
        type Output = Self;
        #[inline(always)]
        fn neg(self) -> Self {
            Self { numbers: -self.numbers, ..self }
        }
    }

    impl<S: Simd, V: SimdFloat<S, Element: Scalar>, const FUSED: bool> Lanes for Vector<V, S, FUSED> {
        type Number = V::Element;
        type Mask = V::Mask;

        const WIDTH: usize = V::LEN;

        #[inline(always)]
        fn with(self, number: V::Element) -> Self {
            Self { numbers: V::splat(self.simd, number), ..self }
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, term: Self) -> Self {
            if FUSED {
                Self { numbers: self.numbers.mul_add(factor.numbers, term.numbers), ..self }
            } else {
                self * factor + term
            }
        }

        #[inline(always)]
        fn recip(self) -> Self {
            self.with(V::Element::of(1.0)).over(self)
        }

        #[inline(always)]
        fn over(self, divisor: Self) -> Self {
            Self { numbers: self.numbers / divisor.numbers, ..self }
        }

        #[inline(always)]
        fn root(self) -> Self {
            Self { numbers: self.numbers.sqrt(), ..self }
        }

        #[inline(always)]
        fn less(self, other: Self) -> V::Mask {
            self.numbers.simd_lt(other.numbers)
        }

        #[inline(always)]
        fn not_negative(self) -> V::Mask {
            self.numbers.simd_ge(V::Element::of(0.0))
        }

        #[inline(always)]
        fn finite(self) -> V::Mask {
            self.numbers.is_finite()
        }

        #[inline(always)]
        fn both(a: V::Mask, b: V::Mask) -> V::Mask {
            a & b
        }

        #[inline(always)]
        fn either(a: V::Mask, b: V::Mask) -> V::Mask {
            a | b
        }

        #[inline(always)]
        fn without(a: V::Mask, b: V::Mask) -> V::Mask {
            a & !b
        }

        #[inline(always)]
        fn none(mask: V::Mask) -> bool {
            !mask.any_true()
        }

        #[inline(always)]
        fn all(mask: V::Mask) -> bool {
            mask.all_true()
        }

        #[inline(always)]
        fn pick(mask: V::Mask, yes: Self, no: Self) -> Self {
            Self { numbers: mask.select(yes.numbers, no.numbers), ..yes }
        }

        #[inline(always)]
        fn exponential(mut self) -> Self {
            for number in self.numbers.as_mut_slice() {
                *number = number.exponential();
            }
            self
        }

        #[inline(always)]
        fn one_of<'a, R>(mask: V::Mask, yes: &'a R, no: &'a R) -> Option<&'a R> {
            if mask.all_true() {
                Some(yes)
            } else if mask.any_true() {
                None
            } else {
                Some(no)
            }
        }

        #[inline(always)]
        fn region<R>(self, lower: V::Element, upper: V::Element, rows: [&R; 3]) -> Option<&R> {
            let outside = self.numbers.simd_lt(lower) | self.numbers.simd_gt(upper);
            if outside.any_true() { None } else { Some(rows[1]) }
        }
    }
}
