use ohmstrain_model::{Gauge, Scalar, StrainRange};

/// The gauge curve as [`SparseEkf`](crate::SparseEkf) evaluates it: within the law's range, and along the tangent outside.
pub trait Curve<T: Scalar>: Copy {
    /// Prepares a gauge; `None` if it is of another family than this curve.
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self>;

    /// g(ε) and g′(ε).
    fn value_and_slope(&self, strain: T) -> (T, T);
}

/// Any gauge, chosen while running.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnyCurve<T> {
    gauge: Gauge<T>,
    range: StrainRange<T>,
}

impl<T: Scalar> Curve<T> for AnyCurve<T> {
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self> {
        Some(Self { gauge: *gauge, range: *range })
    }

    #[inline(always)]
    fn value_and_slope(&self, strain: T) -> (T, T) {
        // By comparisons, which cost less than calls of `fmax` and `fmin`.
        let inside = if strain < self.range.lower {
            self.range.lower
        } else if strain > self.range.upper {
            self.range.upper
        } else {
            strain
        };
        let (value, slope) = self.gauge.value_and_slope(inside);
        (value + slope * (strain - inside), slope)
    }
}

/// [`Gauge::Polynomial`] and nothing else: no exponential in the program, and no choice while running.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cubic<T> {
    regions: Regions<T, [T; 4]>,
}

impl<T: Scalar> Curve<T> for Cubic<T> {
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self> {
        let Gauge::Polynomial { coefficients: [a1, a2, a3] } = *gauge else { return None };
        let tangent = |border: T| {
            let (value, slope) = gauge.value_and_slope(border);
            [value - slope * border, slope, T::zero(), T::zero()]
        };
        let within = [T::zero(), a1, a2, a3];
        let regions = Regions::new(range, tangent(range.lower), within, tangent(range.upper));
        Some(Self { regions })
    }

    #[inline(always)]
    fn value_and_slope(&self, strain: T) -> (T, T) {
        let [a0, a1, a2, a3] = *self.regions.at(strain);
        // Horner's scheme; the slope is the scheme applied to its own results.
        let b2 = a2 + strain * a3;
        let b1 = a1 + strain * b2;
        (a0 + strain * b1, b1 + strain * (b2 + strain * a3))
    }
}

/// What holds below, within and above a range: outside of it a law goes on with numbers of its own, not by clamping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Regions<T, V> {
    lower: T,
    upper: T,
    within: V,
    below: V,
    above: V,
}

impl<T: Scalar, V> Regions<T, V> {
    pub(crate) fn new(range: &StrainRange<T>, below: V, within: V, above: V) -> Self {
        Self { lower: range.lower, upper: range.upper, within, below, above }
    }

    /// What holds at `place`; within, if that is not a number.
    #[inline(always)]
    pub(crate) fn at(&self, place: T) -> &V {
        if place < self.lower {
            &self.below
        } else if place > self.upper {
            &self.above
        } else {
            &self.within
        }
    }
}
