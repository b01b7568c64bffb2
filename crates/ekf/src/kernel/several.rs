//! Lanes whose numbers are at hand one by one, for what vectors do not compute.

use ohmstrain_model::Scalar;

use super::{Lanes, Parts};

/// The most lanes that there are.
pub(crate) const MOST_LANES: usize = 8;

/// A number, or a vector of numbers that can be looked at.
pub(crate) trait Several: Lanes {
    /// How many lanes there are, [`MOST_LANES`] at most.
    const WIDTH: usize;

    /// The number in a lane.
    fn at(&self, lane: usize) -> Self::Number;
    /// Numbers made lane by lane.
    fn build<const K: usize>(self, numbers: impl FnMut(usize) -> [Self::Number; K]) -> [Self; K];
    /// Where something is true.
    fn mask(self, truth: impl FnMut(usize) -> bool) -> Self::Mask;
    /// The numbers in a lane.
    fn parts<const B: usize, R>(
        parts: &Parts<Self, B>,
        lane: usize,
        see: impl FnOnce(&Parts<Self::Number, B>) -> R,
    ) -> R;
    /// Where one of both is true.
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Where the first is true and the second is not.
    fn without(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Whether it is true in a lane.
    fn holds(mask: Self::Mask, lane: usize) -> bool;
}

impl<T: Scalar> Several for T {
    const WIDTH: usize = 1;

    #[inline(always)]
    fn at(&self, _: usize) -> T {
        *self
    }

    #[inline(always)]
    fn build<const K: usize>(self, mut numbers: impl FnMut(usize) -> [T; K]) -> [T; K] {
        numbers(0)
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
    fn either(a: bool, b: bool) -> bool {
        a || b
    }

    #[inline(always)]
    fn without(a: bool, b: bool) -> bool {
        a && !b
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
        const WIDTH: usize = V::LEN;

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
        fn either(a: V::Mask, b: V::Mask) -> V::Mask {
            a | b
        }

        #[inline(always)]
        fn without(a: V::Mask, b: V::Mask) -> V::Mask {
            a & !b
        }

        #[inline(always)]
        fn holds(mask: V::Mask, lane: usize) -> bool {
            mask.to_bitmask() >> lane & 1 == 1
        }
    }
}

/// Work that is done with numbers or with vectors of them.
pub(crate) trait Work<T> {
    /// What comes of it.
    type Said;

    /// Does it with lanes as these.
    #[cfg_attr(not(all(feature = "simd", target_arch = "x86_64")), expect(dead_code, reason = "only vectors ask"))]
    fn with_lanes<V: Several<Number = T>>(self, like: V) -> Self::Said;
}

/// Numbers of which the processor may have vectors.
pub(crate) trait InVectors: Scalar {
    /// Does work with vectors where the processor has some that are worth it. They round as numbers do: results are the same
    /// to the last bit.
    fn in_vectors<W: Work<Self>>(work: W) -> Option<W::Said>;
}

impl InVectors for f32 {
    #[inline(always)]
    fn in_vectors<W: Work<Self>>(_: W) -> Option<W::Said> {
        None
    }
}

impl InVectors for f64 {
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
