use nalgebra::{ComplexField, DMatrix, DVector};
use num_dual::HyperDual64;

use super::log_likelihood::log_likelihood;
use super::{ModelFamily, ReadingSeries, ReadingsLikelihood};
use crate::CalibrationError;

/// The log-likelihood with its exact derivatives with respect to the logarithms of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// The log-likelihood.
    pub log_likelihood: ReadingsLikelihood<f64>,
    /// ∂/∂ ln θᵢ.
    pub gradient: DVector<f64>,
    /// ∂²/∂ ln θᵢ ∂ ln θⱼ.
    pub hessian: DMatrix<f64>,
}

/// Computes the derivatives with one filter run per pair of parameters, in numbers that carry both derivatives and the
/// mixed one. Nothing is approximated; at the filter's own branches (a maximum, a comparison) the derivative is that of
/// the side taken.
///
/// Source: Fike & Alonso, AIAA 2011-886.
pub(super) fn derivatives<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    family: &F,
    ln_parameters: &[f64],
    recordings: &[ReadingSeries],
) -> Result<Derivatives, CalibrationError> {
    let size = ln_parameters.len();
    let mut out = Derivatives {
        log_likelihood: ReadingsLikelihood { value: f64::NAN, readings: 0 },
        gradient: DVector::zeros(size),
        hessian: DMatrix::zeros(size, size),
    };
    for i in 0..size {
        for j in 0..=i {
            let ReadingsLikelihood { value, readings } = seeded(family, ln_parameters, recordings, [i, j])?;
            out.log_likelihood = ReadingsLikelihood { value: value.re, readings };
            out.gradient[i] = value.eps1;
            out.hessian[(i, j)] = value.eps1eps2;
            out.hessian[(j, i)] = value.eps1eps2;
        }
    }
    if out.gradient.iter().chain(out.hessian.iter()).all(|x| x.is_finite()) {
        Ok(out)
    } else {
        Err(CalibrationError::Optimiser("the likelihood has no derivative here".into()))
    }
}

/// Returns value and gradient only: one filter run per two parameters.
pub(super) fn gradient<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    family: &F,
    ln_parameters: &[f64],
    recordings: &[ReadingSeries],
) -> Result<(f64, DVector<f64>), CalibrationError> {
    let size = ln_parameters.len();
    let (mut log_likelihood, mut slopes) = (f64::NAN, DVector::zeros(size));
    for i in (0..size).step_by(2) {
        let value = seeded(family, ln_parameters, recordings, [i, i + 1])?.value;
        log_likelihood = value.re;
        slopes[i] = value.eps1;
        if i + 1 < size {
            slopes[i + 1] = value.eps2;
        }
    }
    Ok((log_likelihood, slopes))
}

/// Returns the log-likelihood in numbers that carry the derivatives with respect to two of the logarithms, and the
/// mixed one. An index beyond the parameters has no derivative.
fn seeded<F: ModelFamily<N, L>, const N: usize, const L: usize>(
    family: &F,
    ln_parameters: &[f64],
    recordings: &[ReadingSeries],
    seeds: [usize; 2],
) -> Result<ReadingsLikelihood<HyperDual64>, CalibrationError> {
    let parameter = |(k, ln): (usize, &f64)| {
        let [first, second] = seeds.map(|seed| f64::from(u8::from(k == seed)));
        ComplexField::exp(HyperDual64::new(*ln, first, second, 0.0))
    };
    let parameters: Vec<HyperDual64> = ln_parameters.iter().enumerate().map(parameter).collect();
    log_likelihood(family, &parameters, recordings)
}
