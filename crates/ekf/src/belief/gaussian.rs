use ohmstrain_model::StrainRange;

pub use crate::belief::tail::Real;
use crate::belief::tail::{Tail, density, upper_tail};

/// A Gaussian in one dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gaussian<T> {
    /// Mean.
    pub mean: T,
    /// Variance, not negative.
    pub variance: T,
}

/// Mass and first two moments of a Gaussian restricted to an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TruncatedGaussian<T> {
    /// Probability of the interval before the restriction.
    pub mass: T,
    /// Mean after it.
    pub mean: T,
    /// Variance after it.
    pub variance: T,
}

impl<T: Real> Gaussian<T> {
    /// Probability of a value above `x`.
    #[must_use]
    pub fn probability_above(&self, x: T) -> T {
        if self.variance <= T::zero() {
            return if self.mean > x { T::one() } else { T::zero() };
        }
        upper_tail((x - self.mean) / self.variance.sqrt())
    }

    /// Probability of a range; 1 where the value is known exactly.
    #[must_use]
    pub fn mass_within(&self, range: &StrainRange<T>) -> T {
        if self.variance <= T::zero() {
            return T::one();
        }
        let sd = self.variance.sqrt();
        mass_between((range.lower - self.mean) / sd, (range.upper - self.mean) / sd)
    }

    /// The same Gaussian with its mean moved into a range.
    ///
    /// For reports: the moments of the restricted Gaussian are drawn off the limit, which at rest on a limit is a bias.
    #[must_use]
    pub fn clamped(&self, range: &StrainRange<T>) -> Self {
        Self { mean: range.clamp(self.mean), variance: self.variance }
    }

    /// The Gaussian restricted to a range.
    ///
    /// Where next to nothing of it lies inside, the limit is taken: an exponential that falls off from the near end.
    #[must_use]
    pub fn restricted(&self, range: &StrainRange<T>) -> TruncatedGaussian<T> {
        let inside = TruncatedGaussian { mass: T::one(), mean: self.mean, variance: self.variance };
        if self.variance <= T::zero() {
            return TruncatedGaussian { mean: range.clamp(self.mean), ..inside };
        }
        let sd = self.variance.sqrt();
        let (a, b) = ((range.lower - self.mean) / sd, (range.upper - self.mean) / sd);
        // Work on the side where the interval lies in the upper tail, where erfc keeps its digits.
        let (a, b, side) = if a + b < T::zero() { (-b, -a, -T::one()) } else { (a, b, T::one()) };
        if a < -T::of(WHOLLY_INSIDE) && b > T::of(WHOLLY_INSIDE) {
            return inside;
        }
        let width = b - a;
        if width * width * width * width * width < T::of(NARROW) * T::default_epsilon() {
            return self.in_narrow(a, b, side);
        }
        if b > T::of(WHOLLY_INSIDE) && a < T::of(MIDDLE) {
            let Tail { mass, hazard } = Tail::above(a);
            return self.within(mass, side * sd, hazard, a * hazard);
        }
        let mass = mass_between(a, b);
        if !(mass > T::of(FAR_TAIL)) {
            let slope = T::one() / a;
            let shift = (a + slope).min(b);
            return TruncatedGaussian {
                mass: mass.max(T::zero()),
                mean: self.mean + side * sd * shift,
                variance: self.variance * slope * slope,
            };
        }
        let (at_a, at_b) = (density(a), density(b));
        let edge = |x: T, at_x: T| if at_x.is_zero() { T::zero() } else { x * at_x };
        self.within(mass, side * sd, (at_a - at_b) / mass, (edge(a, at_a) - edge(b, at_b)) / mass)
    }

    /// What is left of it: a mass whose mean is shifted by so many deviations `sd`, and `edge` for what is cut off.
    fn within(&self, mass: T, sd: T, shift: T, edge: T) -> TruncatedGaussian<T> {
        let narrowed = T::one() + edge - shift * shift;
        TruncatedGaussian {
            mass,
            mean: self.mean + sd * shift,
            variance: self.variance * narrowed.max(T::zero()).min(T::one()),
        }
    }

    /// The Gaussian on an interval of a small part of a deviation, where its density is a plain exponential: differences of
    /// tails would be all rounding.
    fn in_narrow(&self, a: T, b: T, side: T) -> TruncatedGaussian<T> {
        let (sd, width, middle) = (self.variance.sqrt(), b - a, (a + b) / T::of(2.0));
        // The exponential falls by so many half widths: sinh(x)/x, its mean and its variance, in half widths.
        let x = middle * width / T::of(2.0);
        let (area, mean, variance) = if x < T::of(FLAT) {
            let square = x * x;
            (T::one() + square / T::of(6.0), -x / T::of(3.0), (T::one() - square / T::of(5.0)) / T::of(3.0))
        } else {
            let (tanh, sinh) = (x.tanh(), x.sinh());
            (sinh / x, T::one() / x - T::one() / tanh, T::one() / (x * x) - T::one() / (sinh * sinh))
        };
        let half = width / T::of(2.0);
        let mass = density(middle) * width * area;
        TruncatedGaussian {
            mass: if mass.is_finite() { mass } else { T::zero() },
            mean: self.mean + side * sd * (middle + half * mean),
            variance: self.variance * half * half * variance,
        }
    }
}

/// Widths w whose fifth power is below this many rounding errors ε are narrow: an exponential density misses w²/60 of the
/// variance, a difference of tails 30 ε/w³.
const NARROW: f64 = 1800.0;
/// An exponential that changes by less than this over the half width is expanded.
const FLAT: f64 = 0.1;

/// With both ends this many deviations away nothing is cut off that a double would notice: 2 · 10⁻¹⁹.
const WHOLLY_INSIDE: f64 = 9.0;
/// Up to so many deviations a tail without another end has its moments from its hazard.
const MIDDLE: f64 = 5.0;
/// Below this mass the moments of a truncated Gaussian are taken from the tail's asymptote; about 5.6 deviations out.
const FAR_TAIL: f64 = 1e-8;

/// Probability of a standard normal between `a` and `b`.
fn mass_between<T: Real>(a: T, b: T) -> T {
    // Work on the side where the interval lies in the upper tail, where erfc keeps its digits.
    let (a, b) = if a + b < T::zero() { (-b, -a) } else { (a, b) };
    let whole = T::of(WHOLLY_INSIDE);
    if a < -whole {
        return T::one(); // then b is further away still
    }
    if a < T::of(MIDDLE) && b > whole {
        return upper_tail(a);
    }
    upper_tail(a) - upper_tail(b)
}
