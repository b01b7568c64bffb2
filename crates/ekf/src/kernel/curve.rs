use ohmstrain_model::{Gauge, Scalar, StrainRange};

use super::Lanes;

/// The gauge curve as [`SparseEkf`](crate::SparseEkf) evaluates it: within the law's range, and along the tangent outside.
pub trait Curve<T: Scalar>: Copy {
    /// Prepares a gauge; `None` if it is of another family than this curve.
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self>;

    /// g(ε) and g′(ε).
    fn value_and_slope<V: Lanes<Number = T>>(&self, strain: V) -> (V, V);
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
    fn value_and_slope<V: Lanes<Number = T>>(&self, strain: V) -> (V, V) {
        // By comparisons, which cost less than calls of `fmax` and `fmin`.
        let (lower, upper) = (strain.with(self.range.lower), strain.with(self.range.upper));
        let inside = V::pick(strain.less(lower), lower, V::pick(upper.less(strain), upper, strain));
        let (value, slope) = gauge_in_lanes(&self.gauge, inside);
        (slope.mul_add(strain - inside, value), slope)
    }
}

/// [`Gauge::value_and_slope`] in lanes.
#[inline(always)]
fn gauge_in_lanes<V: Lanes>(gauge: &Gauge<V::Number>, strain: V) -> (V, V) {
    let number = |number| strain.with(number);
    let (one, two) = (strain.literal(1.0), V::Number::of(2.0));
    match *gauge {
        Gauge::Polynomial { coefficients: [a1, a2, a3] } => {
            let (three, twice) = (strain * strain.literal(3.0), two * a2);
            let value = strain * strain.mul_add(strain.scale_add(a3, number(a2)), number(a1));
            (value, strain.mul_add(three.scale_add(a3, number(twice)), number(a1)))
        }
        Gauge::DecayingExponential { slope, decay_strain } => {
            let x = strain.over(number(decay_strain));
            let decay = (-x).exponential();
            (strain.scale(slope) * decay, (one - x).scale(slope) * decay)
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            let growth = (strain * strain.scale_add(path_loss, number(barrier))).exponential();
            let width = strain.scale_add(gap, one);
            let exponent_slope = strain.scale_add(two * path_loss, number(barrier));
            (width * growth - one, width.mul_add(exponent_slope, number(gap)) * growth)
        }
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
    fn value_and_slope<V: Lanes<Number = T>>(&self, strain: V) -> (V, V) {
        let (regions, mut coefficients) = (&self.regions, [strain; 4]);
        let common = regions.common(strain);
        for i in 0..4 {
            coefficients[i] = match common {
                Some(row) => strain.with(row[i]),
                None => regions.chosen(strain, [regions.below[i], regions.within[i], regions.above[i]]),
            };
        }
        let [a0, a1, a2, a3] = coefficients;
        // Horner's scheme; the slope is the scheme applied to its own results.
        let b2 = strain.mul_add(a3, a2);
        let b1 = strain.mul_add(b2, a1);
        (strain.mul_add(b1, a0), strain.mul_add(strain.mul_add(a3, b2), b1))
    }
}

/// What holds below, within and above a range: outside of it a law goes on with numbers of its own, not by clamping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Regions<T, V> {
    lower: T,
    upper: T,
    pub within: V,
    pub below: V,
    pub above: V,
}

impl<T: Scalar, V> Regions<T, V> {
    pub(crate) fn new(range: &StrainRange<T>, below: V, within: V, above: V) -> Self {
        Self { lower: range.lower, upper: range.upper, within, below, above }
    }

    /// What holds at all places, if that is the same; within, if a place is not a number.
    #[inline(always)]
    pub(crate) fn common<L: Lanes<Number = T>>(&self, places: L) -> Option<&V> {
        places.region(self.lower, self.upper, [&self.below, &self.within, &self.above])
    }

    /// Of numbers that hold below, within and above the range, the one that holds at each place.
    #[inline(always)]
    pub(crate) fn chosen<L: Lanes<Number = T>>(&self, places: L, [below, within, above]: [T; 3]) -> L {
        let (is_below, is_above) = (places.less(places.with(self.lower)), places.with(self.upper).less(places));
        L::pick(is_below, places.with(below), L::pick(is_above, places.with(above), places.with(within)))
    }
}
