use ohmstrain_model::{Direction, Scalar, SplitRate, UNEXPLAINED, UNEXPLAINED_SHAPE};

use super::Lanes;

/// Split of an uncertain rate between stretching and releasing, for [`SparseEkf`](crate::SparseEkf).
pub trait Switch<V: Lanes>: Copy {
    /// Number of standard deviations from which a rate has a certain direction, and no split is computed.
    const CLEAR: f64;

    /// Values shared by the splits of one step.
    type Width: Copy;

    /// Prepares splits of rates with a positive variance, 1/s².
    fn width(rate_variance: V) -> Self::Width;

    /// Splits a rate, 1/s, whose direction is not certain.
    fn blend(rate: V, width: Self::Width) -> SplitRate<V>;

    /// Returns the square root of a variance, for filters of hypotheses; see [`CompactWidth::new`].
    #[inline(always)]
    fn root(square: V) -> V {
        square.root()
    }
}

/// The logistic distribution, as in the general model ([`Direction::Uncertain`]): an exponential and a logarithm for
/// each split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Logistic;

impl<T: Scalar> Switch<T> for Logistic {
    /// `exp(-1.702 · 22)` = 5e-17 is less than half the ε of `f64`.
    const CLEAR: f64 = 22.0;

    type Width = T;

    fn width(rate_variance: T) -> T {
        rate_variance.sqrt()
    }

    fn blend(rate: T, rate_sd: T) -> SplitRate<T> {
        Direction::Uncertain { rate_sd, persistence: T::one() }.split(rate)
    }
}

/// A density with bounded support: `35/32 (1 - u²)³` with u the number of standard deviations divided by 3. It has the
/// variance of the normal density and a kurtosis of 2.45. Its integrals are polynomials, and beyond three standard
/// deviations nothing needs to be computed.
///
/// Its probability differs from the normal one by at most 0.0164; the logistic one differs by 0.0095.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compact;

/// Half width of the density of [`Compact`], 1/s: three standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompactWidth<V> {
    width: V,
    per_width: V,
    per_square: V,
}

impl<V: Lanes> CompactWidth<V> {
    /// Computes the width for a positive variance, 1/s². Rust's core has no stable access to the square root of a microcontroller's
    /// floating-point unit: a [`Switch`] for such a target passes it as `root`.
    #[inline(always)]
    pub fn new(rate_variance: V, root: impl FnOnce(V) -> V) -> Self {
        let square = rate_variance * rate_variance.literal(9.0);
        let per_square = square.recip();
        let per_width = root(per_square);
        Self { width: square * per_width, per_width, per_square }
    }
}

impl<V: Lanes> Switch<V> for Compact {
    const CLEAR: f64 = 3.0;

    type Width = CompactWidth<V>;

    #[inline(always)]
    fn width(rate_variance: V) -> CompactWidth<V> {
        CompactWidth::new(rate_variance, V::root)
    }

    #[inline(always)]
    fn blend(rate: V, CompactWidth { width, per_width, per_square }: CompactWidth<V>) -> SplitRate<V> {
        let half = rate.literal(0.5);
        // Polynomials in u² do not depend on the square root.
        let u = rate * per_width;
        let w = rate * rate * per_square;
        let (minus_w, fourth) = (-w, w * w);
        // 35/32 ∫ (1 - u²)³ du from 0, and its integral, whose constant assigns the whole rate to one direction at u =
        // 1.
        let lean = fourth.mul_add(linear(minus_w, 0.15625, 0.65625), linear(minus_w, 1.09375, 1.09375));
        let outer = fourth.mul_add(w.literal(0.01953125), linear(minus_w, 0.109375, 0.2734375));
        let spread = (-fourth).mul_add(outer, linear(w, 0.546875, 0.13671875));
        let mean = rate * half;
        let (extend_probability, retract_probability) = (u.mul_add(lean, half), (-u).mul_add(lean, half));
        SplitRate {
            extend: width.mul_add(spread, mean),
            retract: (-width).mul_add(spread, mean),
            extend_probability,
            retract_probability,
            variance: unexplained(extend_probability, retract_probability, width * width * width.literal(1.0 / 9.0)),
        }
    }
}

#[inline(always)]
fn linear<V: Lanes>(x: V, factor: f64, term: f64) -> V {
    x.mul_add(x.literal(factor), x.literal(term))
}

/// See [`ohmstrain_model::unexplained`].
#[inline(always)]
fn unexplained<V: Lanes>(extends: V, retracts: V, variance: V) -> V {
    let both = extends * extends.literal(4.0) * retracts;
    let (constant, growth) = UNEXPLAINED_SHAPE;
    let shape = both.mul_add(both.literal(growth), both.literal(constant));
    variance * variance.literal(UNEXPLAINED) * both * shape
}

/// The variance shared by all rates of a step; its root is taken at most once, and only if some rate's direction is not
/// certain.
pub(crate) struct RateSpread<V: Lanes, S: Switch<V>> {
    pub variance: V,
    width: Option<S::Width>,
}

impl<V: Lanes, S: Switch<V>> Clone for RateSpread<V, S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<V: Lanes, S: Switch<V>> Copy for RateSpread<V, S> {}

impl<V: Lanes, S: Switch<V>> RateSpread<V, S> {
    #[inline(always)]
    pub(crate) const fn new(variance: V) -> Self {
        Self { variance, width: None }
    }

    /// `CLEAR²`: a rate's direction is certain if its square is at least this times the variance.
    #[inline(always)]
    pub(crate) fn clear() -> V::Number {
        V::Number::of(S::CLEAR * S::CLEAR)
    }

    /// Splits a rate whose direction is not certain; meaningless in lanes where it is.
    #[inline(always)]
    pub(crate) fn blend(&mut self, rate: V) -> SplitRate<V> {
        let width = match self.width {
            Some(width) => width,
            None => S::width(self.variance),
        };
        self.width = Some(width);
        S::blend(rate, width)
    }
}
