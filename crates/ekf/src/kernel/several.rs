//! Lanes with access to single numbers, for operations that vectors lack.

use ohmstrain_model::Scalar;

use super::falls::{Falling, INVERSE_FACTORIALS, INVERSE_FACTORIALS_F32};
use super::{Lanes, Parts};

/// Maximum number of lanes.
pub(crate) const MOST_LANES: usize = 8;

/// A scalar, or a vector with access to its numbers.
pub(crate) trait Several: Lanes {
    /// Returns the number in a lane.
    fn at(&self, lane: usize) -> Self::Number;
    /// Builds numbers lane by lane.
    fn build<const K: usize>(self, numbers: impl FnMut(usize) -> [Self::Number; K]) -> [Self; K];
    /// Returns the first numbers of a slice, padded with zeros if it has fewer than there are lanes.
    #[must_use]
    fn first_of(self, numbers: &[Self::Number]) -> Self;
    /// Writes one number per lane to `places`.
    fn put_into(&self, places: &mut [Self::Number]);
    /// Returns the bits of the numbers shifted to the left; `shifted` does so for a single number.
    #[must_use]
    fn bits_shifted(self, by: u32, shifted: impl FnOnce(Self::Number) -> Self::Number) -> Self;
    /// Returns the mask of the lanes for which `truth` holds.
    fn mask(self, truth: impl FnMut(usize) -> bool) -> Self::Mask;
    /// Returns the numbers in a lane.
    fn parts<const B: usize, R>(
        parts: &Parts<Self, B>,
        lane: usize,
        see: impl FnOnce(&Parts<Self::Number, B>) -> R,
    ) -> R;
    /// True if the mask is set in a lane.
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
    fn put_into(&self, places: &mut [T]) {
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
        fn put_into(&self, places: &mut [V::Element]) {
            self.numbers.store_slice(places);
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

/// Work that can be done with scalars or with vectors.
pub(crate) trait Work<T> {
    /// Result of the work.
    type Output;

    /// Does the work with lanes like these.
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> Self::Output;
}

/// Scalars for which the processor may have vectors.
pub(crate) trait InVectors: Scalar {
    /// Does the work with vectors if the processor has suitable ones. They round like scalars: results are the same to the
    /// last bit.
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(_work: W) -> Option<W::Output> {
        None
    }
    /// Constants of [`falling`](super::Falls::falling) in this precision.
    const FALLING: Falling<Self>;
    /// Returns the number with its bits shifted into the exponent.
    #[must_use]
    fn to_exponent(self) -> Self;
}

impl InVectors for f32 {
    /// The Taylor series to r⁷ has an error of r⁸/8! < 6e-9. e⁻⁸⁷ is still a normal number.
    const FALLING: Falling<Self> = Falling {
        least: -87.0,
        rounds: 12_583_039.0,
        ln_2: [0.693_359_4, -2.121_944_4e-4],
        series: &INVERSE_FACTORIALS_F32,
        mantissa: 23,
    };

    #[inline(always)]
    fn to_exponent(self) -> Self {
        Self::from_bits(self.to_bits() << Self::FALLING.mantissa)
    }
}

impl InVectors for f64 {
    /// The Taylor series to r¹³ has an error of r¹⁴/14! < 5e-18. e⁻⁷⁰⁸ is still a normal number.
    const FALLING: Falling<Self> = Falling {
        least: -708.0,
        rounds: 6_755_399_441_056_767.0,
        ln_2: [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10],
        series: &INVERSE_FACTORIALS,
        mantissa: 52,
    };

    #[inline(always)]
    fn to_exponent(self) -> Self {
        Self::from_bits(self.to_bits() << Self::FALLING.mantissa)
    }

    #[cfg(all(feature = "simd", any(target_arch = "x86_64", target_feature = "simd128")))]
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(work: W) -> Option<W::Output> {
        #[cfg(target_feature = "simd128")]
        use fearless_simd::f64x2 as Register;
        #[cfg(target_arch = "x86_64")]
        use fearless_simd::f64x4 as Register;
        use fearless_simd::{Level, Simd, SimdBase};
        #[cfg(target_arch = "x86_64")]
        let simd = Level::new().as_avx2()?;
        #[cfg(target_feature = "simd128")]
        let simd = Level::new().as_wasm_simd128()?;
        let like = super::Vector::<_, _, false> { numbers: Register::splat(simd, 0.0), simd };
        Some(simd.vectorize(
            #[inline(always)]
            || work.with_lanes(like),
        ))
    }
}
