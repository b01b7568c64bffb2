use ohmstrain_model::Scalar;

use crate::{Innovation, StepError};

/// A reading compared with its prediction, without the logarithm that its density needs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Residual<T> {
    /// Reading minus expected reading ν.
    pub innovation: T,
    /// Its variance S.
    pub variance: T,
    /// Normalised innovation squared ν²/S.
    pub nis: T,
}

impl<T: Scalar> Residual<T> {
    /// Log density of the reading before it was seen, constant included.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        T::of(-0.5) * (self.nis + self.variance.ln() + T::two_pi().ln())
    }

    /// The same for [`Estimator`](crate::Estimator). What overflows a square is no reading.
    pub(crate) fn with_log_likelihood(self, log_likelihood: T) -> Result<Innovation<T>, StepError> {
        let Self { innovation: value, variance, nis } = self;
        let innovation = Innovation { value, variance, nis, log_likelihood };
        if nis.is_finite() { Ok(innovation) } else { Err(StepError::NonFiniteState) }
    }
}

/// The log-likelihood of many readings with a logarithm now and then: variances are multiplied, and the logarithm of the
/// product is taken before it leaves the range of `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogLikelihood<T> {
    settled: T,
    nis: T,
    product: T,
    readings: u32,
}

/// The product is kept between one over this and this: one more variance in that range cannot leave the numbers, which end at
/// 10±³⁸ in `f32` and at 10±³⁰⁸ in `f64`.
#[inline(always)]
fn largest<T: Scalar>() -> T {
    T::of(if T::default_epsilon() < T::of(1e-12) { 1e150 } else { 1e16 })
}

impl<T: Scalar> LogLikelihood<T> {
    /// Of no reading.
    #[must_use]
    pub fn new() -> Self {
        Self { settled: T::zero(), nis: T::zero(), product: T::one(), readings: 0 }
    }

    /// One reading more.
    #[inline]
    pub fn add(&mut self, residual: &Residual<T>) {
        self.nis += residual.nis;
        self.product *= residual.variance;
        self.readings += 1;
        if !(self.product > T::one() / largest() && self.product < largest()) {
            self.settle();
        }
    }

    #[cold]
    #[inline(never)]
    fn settle(&mut self) {
        self.settled -= T::of(0.5) * self.product.ln();
        self.product = T::one();
    }

    /// The sum of the log densities, constants included.
    #[must_use]
    pub fn value(&self) -> T {
        // Counted in `f32` steps: exact up to 2²⁴ readings, and without double precision on a microcontroller.
        let readings: T = nalgebra::convert(self.readings as f32);
        self.settled - T::of(0.5) * (self.nis + self.product.ln() + readings * T::two_pi().ln())
    }
}

impl<T: Scalar> Default for LogLikelihood<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::Residual;

    /// The logarithm of N(ν; 0, S), written out.
    #[test]
    fn a_log_likelihood_is_that_of_the_normal_distribution() {
        let (innovation, variance) = (0.3_f64, 0.04_f64);
        let residual = Residual { innovation, variance, nis: innovation * innovation / variance };
        let density = (-0.5 * innovation * innovation / variance).exp() / (core::f64::consts::TAU * variance).sqrt();
        assert!((residual.log_likelihood() - density.ln()).abs() < 1e-15);
    }
}
