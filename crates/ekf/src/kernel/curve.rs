use ohmstrain_model::{Gauge, Scalar, StrainRange};

use super::Lanes;

/// Gauge curve in the form evaluated by [`SparseEkf`](crate::SparseEkf): the curve within the law's range, and its tangent
/// outside.
pub trait Curve<T: Scalar>: Copy {
    /// Prepares a gauge; `None` if it is not of this curve's family.
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self>;

    /// Returns g(ε) and g′(ε).
    fn value_and_slope<V: Lanes<Number = T>>(&self, strain: V) -> (V, V);

    /// Returns the line that approximates g for a strain with this variance; by default the tangent at the mean.
    #[inline(always)]
    fn line<V: Lanes<Number = T>>(&self, strain: V, _variance: V) -> CurveLine<V> {
        let (value, slope) = self.value_and_slope(strain);
        CurveLine { value, slope, left: None }
    }
}

/// Line that approximates a curve in an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveLine<V> {
    /// Expected value.
    pub value: V,
    /// Slope.
    pub slope: V,
    /// Variance of the residual of the line, if known.
    pub left: Option<V>,
}

/// Any gauge, selected at run time.
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
        // Comparisons cost less than calls of `fmax` and `fmin`.
        let (lower, upper) = (strain.with(self.range.lower), strain.with(self.range.upper));
        let inside = V::pick(strain.less(lower), lower, V::pick(upper.less(strain), upper, strain));
        let (value, slope) = gauge_in_lanes(&self.gauge, inside);
        (slope.mul_add(strain - inside, value), slope)
    }
}

/// Computes [`Gauge::value_and_slope`] in lanes.
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

/// [`Gauge::Polynomial`] only: the program contains no exponential, and nothing is selected at run time.
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
        // Horner's scheme; the slope comes from the scheme applied to its own coefficients.
        let b2 = strain.mul_add(a3, a2);
        let b1 = strain.mul_add(b2, a1);
        (strain.mul_add(b1, a0), strain.mul_add(strain.mul_add(a3, b2), b1))
    }
}

/// Unscented transform of a gauge: three points of strain, at the mean (weight 2/3) and √3 standard deviations to either side
/// (1/6 each). They match the moments of a normal distribution up to the fifth. Only the gauge is nonlinear, so a
/// [`SparseEkf`](crate::SparseEkf) with this curve is the unscented Kalman filter.
///
/// Source: Julier & Uhlmann, *Proc. IEEE* 92 (2004) 401, with one dimension and κ = 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints<G>(G);

impl<T: Scalar, G: Curve<T>> Curve<T> for SigmaPoints<G> {
    fn new(gauge: &Gauge<T>, range: &StrainRange<T>) -> Option<Self> {
        G::new(gauge, range).map(Self)
    }

    #[inline(always)]
    fn value_and_slope<V: Lanes<Number = T>>(&self, strain: V) -> (V, V) {
        self.0.value_and_slope(strain)
    }

    #[inline(always)]
    fn line<V: Lanes<Number = T>>(&self, strain: V, variance: V) -> CurveLine<V> {
        let (here, tangent) = self.0.value_and_slope(strain);
        let spreads = variance.nothing().less(variance);
        let triple = variance * variance.literal(3.0);
        let (offset, per_square) = (triple.root(), triple.recip());
        let (up, _) = self.0.value_and_slope(strain + offset);
        let (down, _) = self.0.value_and_slope(strain - offset);
        let half = variance.literal(0.5);
        let bend = V::pick(spreads, (up + down) * half - here, variance.nothing());
        let slope = V::pick(spreads, (up - down) * half * (offset * per_square), tangent);
        let left = bend * bend * bend.literal(2.0 / 9.0);
        CurveLine { value: bend.mul_add(bend.literal(1.0 / 3.0), here), slope, left: Some(left) }
    }
}

/// Values for positions below, within and above a range; outside it a law has separate numbers instead of clamping.
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

    /// Returns the value for all positions if they share one; NaN counts as within the range.
    #[inline(always)]
    pub(crate) fn common<L: Lanes<Number = T>>(&self, places: L) -> Option<&V> {
        places.region(self.lower, self.upper, [&self.below, &self.within, &self.above])
    }

    /// Selects, at each position, among numbers for below, within and above the range.
    #[inline(always)]
    pub(crate) fn chosen<L: Lanes<Number = T>>(&self, places: L, [below, within, above]: [T; 3]) -> L {
        let (is_below, is_above) = (places.less(places.with(self.lower)), places.with(self.upper).less(places));
        L::pick(is_below, places.with(below), L::pick(is_above, places.with(above), places.with(within)))
    }
}
