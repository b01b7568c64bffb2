use ohmstrain_model::{Direction, Scalar, SplitRate, unexplained};

/// How [`SparseEkf`](crate::SparseEkf) splits an uncertain rate between stretching and releasing.
pub trait Switch<T: Scalar> {
    /// A rate of at least that many standard deviations has one direction; nothing is computed for it.
    const CLEAR: f64;

    /// What the splits of one step share.
    type Width: Copy;

    /// Prepares splits of rates with a variance above zero, 1/s².
    fn width(rate_variance: T) -> Self::Width;

    /// Splits a rate that is not clear, 1/s.
    fn blend(rate: T, width: Self::Width) -> SplitRate<T>;

    /// The square root that filters of hypotheses take of variances; as for [`CompactWidth::new`].
    #[inline(always)]
    fn root(square: T) -> T {
        square.sqrt()
    }
}

/// The logistic distribution, as the generic path has it ([`Direction::Uncertain`]): an exponential and a logarithm for
/// each split.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Logistic;

impl<T: Scalar> Switch<T> for Logistic {
    /// `exp(-1.702 · 22)` = 5e-17 is less than half of what `f64` adds to 1.
    const CLEAR: f64 = 22.0;

    type Width = T;

    fn width(rate_variance: T) -> T {
        rate_variance.sqrt()
    }

    fn blend(rate: T, rate_sd: T) -> SplitRate<T> {
        Direction::Uncertain { rate_sd, persistence: T::one() }.split(rate)
    }
}

/// A density that ends: `35/32 (1 - u²)³` at u deviations/3, which has the normal one's variance and kurtosis 2.45. Its
/// integrals are polynomials, and from three deviations on there is nothing to compute.
///
/// Its probability is off the normal one's by at most 0.0164, the logistic one's by 0.0095.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compact;

/// Where the density of [`Compact`] ends, 1/s: three deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompactWidth<T> {
    width: T,
    per_width: T,
    per_square: T,
}

impl<T: Scalar> CompactWidth<T> {
    /// Of a variance above zero, 1/s². Rust's core has no stable way to the square root of a microcontroller's
    /// floating-point unit: who has one there hands it in as `root`, from a [`Switch`] of their own.
    #[inline(always)]
    pub fn new(rate_variance: T, root: impl FnOnce(T) -> T) -> Self {
        let square = T::of(9.0) * rate_variance;
        let per_square = T::one() / square;
        let per_width = root(per_square);
        Self { width: square * per_width, per_width, per_square }
    }
}

impl<T: Scalar> Switch<T> for Compact {
    const CLEAR: f64 = 3.0;

    type Width = CompactWidth<T>;

    #[inline(always)]
    fn width(rate_variance: T) -> CompactWidth<T> {
        CompactWidth::new(rate_variance, |square| square.sqrt())
    }

    #[inline]
    fn blend(rate: T, CompactWidth { width, per_width, per_square }: CompactWidth<T>) -> SplitRate<T> {
        let half = T::of(0.5);
        // Polynomials in u² do not wait for the root.
        let u = rate * per_width;
        let w = rate * rate * per_square;
        let fourth = w * w;
        // 35/32 ∫ (1 - u²)³ du from 0, and its integral, which lets the whole of the rate be one direction's at u = 1.
        let lean = u * ((T::of(1.09375) - w * T::of(1.09375)) + fourth * (T::of(0.65625) - w * T::of(0.15625)));
        let spread = (T::of(0.13671875) + w * T::of(0.546875))
            - fourth * ((T::of(0.2734375) - w * T::of(0.109375)) + fourth * T::of(0.01953125));
        let both = width * spread;
        let mean = half * rate;
        let (extend_probability, retract_probability) = (half + lean, half - lean);
        SplitRate {
            extend: mean + both,
            retract: mean - both,
            extend_probability,
            retract_probability,
            variance: unexplained(extend_probability, retract_probability, width * width * T::of(1.0 / 9.0)),
        }
    }
}

/// The variance that all rates of a step share; its root is taken at most once, and only if some rate is not clear.
pub(crate) struct RateSpread<T: Scalar, S: Switch<T>> {
    pub variance: T,
    width: Option<S::Width>,
}

impl<T: Scalar, S: Switch<T>> RateSpread<T, S> {
    #[inline(always)]
    pub(crate) const fn new(variance: T) -> Self {
        Self { variance, width: None }
    }

    /// `CLEAR²`: a rate is clear if its square is not less than this times the variance.
    #[inline(always)]
    pub(crate) fn clear() -> T {
        T::of(S::CLEAR * S::CLEAR)
    }

    /// Splits a rate that is not clear.
    #[inline(always)]
    pub(crate) fn blend(&mut self, rate: T) -> SplitRate<T> {
        let variance = self.variance;
        S::blend(rate, *self.width.get_or_insert_with(|| S::width(variance)))
    }
}
