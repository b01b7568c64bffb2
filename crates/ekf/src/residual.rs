use ohmstrain_model::Scalar;

use crate::{Innovation, StepError};

/// A reading compared with its prediction, without the log-likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Residual<T> {
    /// Reading minus expected reading ν.
    pub innovation: T,
    /// Innovation variance S.
    pub variance: T,
    /// Normalised innovation squared ν²/S.
    pub nis: T,
}

impl<T: Scalar> Residual<T> {
    /// Returns the predictive log density of the reading, including the constant.
    #[must_use]
    pub fn log_likelihood(&self) -> T {
        T::of(-0.5) * (self.nis + self.variance.ln() + T::two_pi().ln())
    }

    /// Converts it for [`Estimator`](crate::Estimator). A value whose square overflows is an error.
    pub(crate) fn with_log_likelihood(self, log_likelihood: T) -> Result<Innovation<T>, StepError> {
        let Self { innovation: value, variance, nis } = self;
        let innovation = Innovation { value, variance, nis, log_likelihood };
        if nis.is_finite() { Ok(innovation) } else { Err(StepError::NonFiniteState) }
    }
}

#[cfg(test)]
mod tests {
    use super::Residual;

    /// Compares with the logarithm of N(ν; 0, S), written out.
    #[test]
    fn a_log_likelihood_is_that_of_the_normal_distribution() {
        let (innovation, variance) = (0.3_f64, 0.04_f64);
        let residual = Residual { innovation, variance, nis: innovation * innovation / variance };
        let density = (-0.5 * innovation * innovation / variance).exp() / (core::f64::consts::TAU * variance).sqrt();
        assert!((residual.log_likelihood() - density.ln()).abs() < 1e-15);
    }
}
