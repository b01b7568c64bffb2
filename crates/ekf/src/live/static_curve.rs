use ohmstrain_model::StrainRange;

use crate::{Gaussian, Recordable};

/// Strain as a cubic polynomial of one reading, with a constant error: the usual method, for a sensor without memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticCurve<T> {
    /// Reading, `R/R₀ - 1` in a filter, at which z = 0.
    pub centre: T,
    /// Distance of the reading from `centre` that counts as one.
    pub half_range: T,
    /// Coefficients of 1, z, z², z³ with `z = (reading - centre)/half_range`.
    pub coefficients: [T; 4],
    /// Range of the strain.
    pub range: StrainRange<T>,
    /// Variance of the strain.
    pub variance: T,
}

impl<T: Recordable> StaticCurve<T> {
    /// Returns the strain for a reading.
    #[must_use]
    pub fn strain(&self, reading: T) -> Gaussian<T> {
        let z = (reading - self.centre) / self.half_range;
        let [a, b, c, d] = self.coefficients;
        Gaussian { mean: self.range.clamp(a + z * (b + z * (c + z * d))), variance: self.variance }
    }
}

impl StaticCurve<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> StaticCurve<T> {
        let StrainRange { lower, upper } = self.range;
        StaticCurve {
            centre: T::of(self.centre),
            half_range: T::of(self.half_range),
            coefficients: self.coefficients.map(T::of),
            range: StrainRange { lower: T::of(lower), upper: T::of(upper) },
            variance: T::of(self.variance),
        }
    }
}
