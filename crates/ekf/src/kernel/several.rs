//! Lanes whose numbers are at hand one by one, for what vectors do not compute.

use nalgebra::ComplexField;
use ohmstrain_model::Scalar;

use super::tail::Tail;
use super::{Lanes, Parts};

/// The most lanes that there are.
pub(crate) const MOST_LANES: usize = 8;

/// A number, or a vector of numbers that can be looked at.
pub(crate) trait Several: Lanes {
    /// The number in a lane.
    fn at(&self, lane: usize) -> Self::Number;
    /// Numbers made lane by lane.
    fn build<const K: usize>(self, numbers: impl FnMut(usize) -> [Self::Number; K]) -> [Self; K];
    /// The numbers with which a slice begins, zero where it has fewer than there are lanes.
    #[must_use]
    fn first_of(self, numbers: &[Self::Number]) -> Self;
    /// Writes the numbers to where a slice begins, as many as it has room for.
    fn put_first(&self, places: &mut [Self::Number]);
    /// The bits of the numbers shifted to the left; `shifted` does it with one of them.
    #[must_use]
    fn bits_shifted(self, by: u32, shifted: impl FnOnce(Self::Number) -> Self::Number) -> Self;
    /// Where something is true.
    fn mask(self, truth: impl FnMut(usize) -> bool) -> Self::Mask;
    /// The numbers in a lane.
    fn parts<const B: usize, R>(
        parts: &Parts<Self, B>,
        lane: usize,
        see: impl FnOnce(&Parts<Self::Number, B>) -> R,
    ) -> R;
    /// Whether it is true in a lane.
    fn holds(mask: Self::Mask, lane: usize) -> bool;
}

impl<T: Scalar> Several for T {
    #[inline(always)]
    fn at(&self, _: usize) -> T {
        *self
    }

    #[inline(always)]
    fn build<const K: usize>(self, mut numbers: impl FnMut(usize) -> [T; K]) -> [T; K] {
        numbers(0)
    }

    #[inline(always)]
    fn first_of(self, numbers: &[T]) -> T {
        numbers.first().copied().unwrap_or(T::zero())
    }

    #[inline(always)]
    fn put_first(&self, places: &mut [T]) {
        if let Some(place) = places.first_mut() {
            *place = *self;
        }
    }

    #[inline(always)]
    fn bits_shifted(self, _: u32, shifted: impl FnOnce(T) -> T) -> T {
        shifted(self)
    }

    #[inline(always)]
    fn mask(self, mut truth: impl FnMut(usize) -> bool) -> bool {
        truth(0)
    }

    #[inline(always)]
    fn parts<const B: usize, R>(parts: &Parts<T, B>, _: usize, see: impl FnOnce(&Parts<T, B>) -> R) -> R {
        see(parts)
    }

    #[inline(always)]
    fn holds(mask: bool, _: usize) -> bool {
        mask
    }
}

#[cfg(feature = "simd")]
mod vector {
    use fearless_simd::{Simd, SimdFloat, SimdMask};
    use ohmstrain_model::Scalar;

    use super::{MOST_LANES, Several};
    use crate::kernel::{Parts, Vector};

    impl<S: Simd, V: SimdFloat<S, Element: Scalar>, const FUSED: bool> Several for Vector<V, S, FUSED> {
        #[inline(always)]
        fn at(&self, lane: usize) -> V::Element {
            self.numbers.as_slice()[lane % V::LEN]
        }

        #[inline(always)]
        fn build<const K: usize>(self, mut numbers: impl FnMut(usize) -> [V::Element; K]) -> [Self; K] {
            let mut rows = [[V::Element::of(0.0); MOST_LANES]; K];
            for lane in 0..V::LEN {
                let numbers = numbers(lane);
                for k in 0..K {
                    rows[k][lane] = numbers[k];
                }
            }
            let mut built = [self; K];
            for k in 0..K {
                built[k].numbers = V::from_slice(self.simd, &rows[k][..V::LEN]);
            }
            built
        }

        #[inline(always)]
        fn first_of(self, numbers: &[V::Element]) -> Self {
            if let Some(all) = numbers.get(..V::LEN) {
                return Self { numbers: V::from_slice(self.simd, all), ..self };
            }
            let [some] = self.build(|lane| [numbers.get(lane).copied().unwrap_or(V::Element::of(0.0))]);
            some
        }

        #[inline(always)]
        fn put_first(&self, places: &mut [V::Element]) {
            if let Some(all) = places.get_mut(..V::LEN) {
                self.numbers.store_slice(all);
                return;
            }
            for (place, number) in places.iter_mut().zip(self.numbers.as_slice()) {
                *place = *number;
            }
        }

        #[inline(always)]
        fn bits_shifted(self, by: u32, _: impl FnOnce(V::Element) -> V::Element) -> Self {
            Self { numbers: V::from_bits(self.numbers.to_bits() << by), ..self }
        }

        #[inline(always)]
        fn mask(self, mut truth: impl FnMut(usize) -> bool) -> V::Mask {
            let mut bits = 0;
            for lane in 0..V::LEN {
                bits |= u64::from(truth(lane)) << lane;
            }
            V::Mask::from_bitmask(self.simd, bits)
        }

        #[inline(always)]
        fn parts<const B: usize, R>(
            parts: &Parts<Self, B>,
            lane: usize,
            see: impl FnOnce(&Parts<V::Element, B>) -> R,
        ) -> R {
            see(&parts.in_lane(lane))
        }

        #[inline(always)]
        fn holds(mask: V::Mask, lane: usize) -> bool {
            mask.to_bitmask() >> lane & 1 == 1
        }
    }
}

/// Lanes with the exponentials and tails that hypotheses take.
pub(crate) trait Falls: Lanes {
    /// Exponentials of what is not above zero: those of [`InVectors::falling`].
    #[must_use]
    fn falling(self) -> Self;

    /// What a standard normal has above these borders, where it is `wanted`.
    #[must_use]
    #[inline(always)]
    fn tail(self, wanted: Self::Mask) -> Tail<Self> {
        Tail::above(self, wanted)
    }
}

impl<V: Several<Number: InVectors>> Falls for V {
    #[inline(always)]
    fn falling(self) -> Self {
        <V::Number as InVectors>::falling(self)
    }
}

/// Work that is done with numbers or with vectors of them.
pub(crate) trait Work<T> {
    /// What comes of it.
    type Said;

    /// Does it with lanes as these.
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> Self::Said;
}

/// Numbers of which the processor may have vectors.
pub(crate) trait InVectors: Scalar {
    /// Does work with vectors where the processor has some that are worth it. They round as numbers do: results are the same
    /// to the last bit.
    fn in_vectors<W: Work<Self>>(work: W) -> Option<W::Said>;
    /// Exponentials of what is not above zero.
    fn falling<V: Several<Number = Self>>(exponents: V) -> V;
    /// `Σ aᵢ bᵢ` over the shorter of both, the same to the last bit whatever the lanes.
    fn dot<V: Several<Number = Self>>(like: V, a: &[Self], b: &[Self]) -> Self;
}

impl InVectors for f32 {
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(_: W) -> Option<W::Said> {
        None
    }

    /// As exported C does it.
    #[inline(always)]
    fn falling<V: Several<Number = Self>>(exponents: V) -> V {
        let [powers] = exponents.build(|lane| [ComplexField::exp(exponents.at(lane))]);
        powers
    }

    /// One after the other, as exported C does it.
    #[inline(always)]
    fn dot<V: Several<Number = Self>>(_: V, a: &[Self], b: &[Self]) -> Self {
        a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + *a * *b)
    }
}

/// 1/k! for k up to 13.
const INVERSE_FACTORIALS: [f64; 14] = {
    let mut inverses = [1.0; 14];
    let mut k = 1;
    while k < 14 {
        inverses[k] = inverses[k - 1] / k as f64;
        k += 1;
    }
    inverses
};

impl InVectors for f64 {
    /// `2ⁿ eʳ` with |r| ≤ ln(2)/2, where Taylor's series to r¹³ leaves r¹⁴/14! < 5e-18; zero below e⁻⁷⁰⁸, which still is a normal
    /// number.
    #[inline(always)]
    fn falling<V: Several<Number = Self>>(exponents: V) -> V {
        // Added to a number, 1.5 · 2⁵² + 1023 leaves the nearest integer, plus the exponent's bias, in the lowest bits.
        const ROUNDS: f64 = 6_755_399_441_056_767.0;
        // ln 2 as fdlibm has it: the first has so few bits that its products with n are exact.
        const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
        let least = exponents.literal(-708.0);
        let vanishes = exponents.less(least);
        let x = V::pick(vanishes, least, exponents);
        let rounded = x.scale_add(core::f64::consts::LOG2_E, x.literal(ROUNDS));
        let n = rounded - x.literal(ROUNDS);
        let r = x - n.scale(LN_2[0]) - n.scale(LN_2[1]);
        let mut sum = x.literal(INVERSE_FACTORIALS[13]);
        for k in (0..13).rev() {
            sum = sum.mul_add(r, x.literal(INVERSE_FACTORIALS[k]));
        }
        // The integer in the lowest bits becomes an exponent.
        V::pick(vanishes, x.nothing(), sum * rounded.bits_shifted(52, |one| Self::from_bits(one.to_bits() << 52)))
    }

    /// In four sums, of every fourth product each.
    #[inline(always)]
    fn dot<V: Several<Number = Self>>(like: V, a: &[Self], b: &[Self]) -> Self {
        let mut sums = [like.nothing(); 4];
        let mut add = |a: [Self; 4], b: [Self; 4]| {
            for i in 0..4 / V::WIDTH {
                sums[i] = like.first_of(&a[i * V::WIDTH..]).mul_add(like.first_of(&b[i * V::WIDTH..]), sums[i]);
            }
        };
        let b = b.get(..a.len()).unwrap_or(b);
        let ((fours_a, last_a), (fours_b, last_b)) = (a.as_chunks(), b.as_chunks());
        fours_a.iter().zip(fours_b).for_each(|(a, b)| add(*a, *b));
        if !last_a.is_empty() {
            let filled = |last: &[Self]| core::array::from_fn(|i| last.get(i).copied().unwrap_or(0.0));
            add(filled(last_a), filled(last_b));
        }
        let sum = |i: usize| sums[i / V::WIDTH].at(i % V::WIDTH);
        (sum(0) + sum(1)) + (sum(2) + sum(3))
    }

    #[cfg(all(feature = "simd", target_arch = "x86_64"))]
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(work: W) -> Option<W::Said> {
        use fearless_simd::{Level, Simd, SimdBase, f64x4};
        let simd = Level::new().as_avx2()?;
        let like = super::Vector::<_, _, false> { numbers: f64x4::splat(simd, 0.0), simd };
        Some(simd.vectorize(
            #[inline(always)]
            || work.with_lanes(like),
        ))
    }

    #[cfg(not(all(feature = "simd", target_arch = "x86_64")))]
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(_: W) -> Option<W::Said> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::InVectors;

    /// The reduced argument is off by half a rounding of 0.35, the series by one of each of 1 and 0.35 and by r times what
    /// its inner sums are off by; the result is 0.7 or more. libm's is off by one.
    #[test]
    fn exponentials_of_what_is_not_above_zero() {
        for k in 0..70_800 {
            let x = -0.01 * f64::from(k);
            let (found, expected) = (f64::falling(x), x.exp());
            assert!((found - expected).abs() <= 3.0 * f64::EPSILON * expected, "{x}: {found} {expected}");
        }
        assert_eq!(f64::falling(0.0), 1.0);
        assert_eq!((f64::falling(f64::NEG_INFINITY), f64::falling(-709.0)), (0.0, 0.0));
        assert!(f64::falling(f64::NAN).is_nan());
    }
}
