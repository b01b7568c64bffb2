use ohmstrain_model::StrainRange;

use super::{DoubtParts, RestBounds, Sieve};
use crate::Recordable;
use crate::correction::FeatureScale;

/// Components around the estimator in a [`LiveFilter`](super::LiveFilter), from a sensor's calibration.
#[derive(Clone, Copy, Debug)]
pub struct LiveParts<T, C> {
    /// R₀ of the law, in the unit of the readings.
    pub rest_reading: T,
    /// Reading of the rested, unstretched sensor in calibration, as measured; R₀ itself is fitted with the law.
    pub rested: T,
    /// Usual time between readings, s.
    pub dt_s: T,
    /// Longest step, s, into which a pause is divided; the estimator's own limit if that is shorter.
    pub longest_step_s: T,
    /// Range of the reported strain.
    pub limits: StrainRange<T>,
    /// Factor on the standard deviation of the filter's strain.
    pub strain_sd_scale: T,
    /// Variance of the model's own noise of R/R₀.
    pub reading_variance: T,
    /// Variance of a known strain at a start.
    pub known_variance: T,
    /// Plausibility limits on a reading.
    pub sieve: Sieve<T>,
    /// Parts of the doubts that widen the interval.
    pub doubt: DoubtParts<T>,
    /// Bounds of readings that agree with the calibrated R₀.
    pub rest: RestBounds<T>,
    /// Scale of the correction's features, and the correction; `None` for the uncorrected strain.
    pub learned: Option<(FeatureScale<T>, C)>,
}

impl<T, C> LiveParts<T, C> {
    /// Sets the correction, or none.
    #[must_use]
    pub fn with_correction<D>(self, learned: Option<(FeatureScale<T>, D)>) -> LiveParts<T, D> {
        let Self { rest_reading, rested, dt_s, longest_step_s, limits, strain_sd_scale, .. } = self;
        let Self { reading_variance, known_variance, sieve, doubt, rest, .. } = self;
        LiveParts {
            rest_reading,
            rested,
            dt_s,
            longest_step_s,
            limits,
            strain_sd_scale,
            reading_variance,
            known_variance,
            sieve,
            doubt,
            rest,
            learned,
        }
    }
}

impl<C> LiveParts<f64, C> {
    /// Converts it to another precision, without a correction.
    #[must_use]
    pub fn to<T: Recordable>(&self) -> LiveParts<T, ()> {
        LiveParts {
            rest_reading: T::of(self.rest_reading),
            rested: T::of(self.rested),
            dt_s: T::of(self.dt_s),
            longest_step_s: T::of(self.longest_step_s),
            limits: StrainRange { lower: T::of(self.limits.lower), upper: T::of(self.limits.upper) },
            strain_sd_scale: T::of(self.strain_sd_scale),
            reading_variance: T::of(self.reading_variance),
            known_variance: T::of(self.known_variance),
            sieve: self.sieve.to(),
            doubt: self.doubt.to(),
            rest: self.rest.to(),
            learned: None,
        }
    }
}
