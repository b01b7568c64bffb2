use crate::dense::product;
use nalgebra::{DMatrix, DVector};

use super::datum::Datum;
use super::law::SeparableLaw;

/// Singular values below this fraction of the largest are rounding: n ε, with a margin for the thousands of rows of a
/// recording.
const RANK: f64 = 1e-13;

/// The law at some θ with the weights that fit best there.
pub(super) struct Projection {
    /// The weights; if several sets fit equally well, those of least norm.
    pub weights: DVector<f64>,
    /// Reading minus law.
    pub residual: DVector<f64>,
    /// φ, one column per weight.
    pub basis: DMatrix<f64>,
    /// Derivative of the law with respect to each θ at fixed weights, one column per θ.
    pub slopes: DMatrix<f64>,
    /// Orthonormal columns that span those of φ.
    range: DMatrix<f64>,
}

impl Projection {
    /// Eliminates the weights; `None` if the law is not finite.
    pub fn new(law: &dyn SeparableLaw, data: &[Datum], linear: usize, theta: &[f64]) -> Option<Self> {
        let (rows, nonlinear) = (data.len(), theta.len());
        let mut basis = DMatrix::zeros(rows, linear);
        let mut by_weight = vec![DMatrix::zeros(rows, nonlinear); linear];
        let (mut values, mut slopes) = (vec![0.0; linear], vec![0.0; linear * nonlinear]);
        for (row, datum) in data.iter().enumerate() {
            values.fill(0.0);
            slopes.fill(0.0);
            law.basis(theta, &datum.at, &mut values, &mut slopes);
            for j in 0..linear {
                basis[(row, j)] = values[j];
                for k in 0..nonlinear {
                    by_weight[j][(row, k)] = slopes[j * nonlinear + k];
                }
            }
        }
        let response = DVector::from_iterator(rows, data.iter().map(|datum| datum.reading - law.offset()));
        if !basis.iter().chain(by_weight.iter().flatten()).chain(response.iter()).all(|x| x.is_finite()) {
            return None;
        }
        let (range, weights) = least_squares(&basis, &response)?;
        let residual = &response - &range * range.tr_mul(&response);
        let mut slopes = DMatrix::zeros(rows, nonlinear);
        for (weight, own) in weights.iter().zip(&by_weight) {
            slopes += own * *weight;
        }
        Some(Self { weights, residual, basis, slopes, range })
    }

    /// Returns the sum of squared residuals.
    pub fn cost(&self) -> f64 {
        self.residual.norm_squared()
    }

    /// Returns the derivative of the residual with respect to θ with the weights eliminated, without the term that
    /// vanishes with the residual. The gradient of the cost that follows from it is exact.
    ///
    /// Source: Kaufman, *BIT* 15 (1975) 49; Golub & Pereyra, *Inverse Problems* 19 (2003) R1.
    pub fn jacobian(&self) -> DMatrix<f64> {
        product(&self.range, &self.range.tr_mul(&self.slopes)) - &self.slopes
    }
}

/// Returns orthonormal columns that span the basis, and the weights. QR first keeps the matrix of the SVD small;
/// columns are scaled to unit length, so that units do not affect the rank.
pub(super) fn least_squares(basis: &DMatrix<f64>, response: &DVector<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let length = |column: f64| if column > 0.0 { column } else { 1.0 };
    let scale = DVector::from_iterator(basis.ncols(), basis.column_iter().map(|column| length(column.norm())));
    let mut scaled = basis.clone();
    for (mut column, scale) in scaled.column_iter_mut().zip(scale.iter()) {
        column /= *scale;
    }
    let (q, r) = scaled.qr().unpack();
    let svd = r.svd(true, true);
    let (left, right) = (svd.u?, svd.v_t?);
    let rank = svd.singular_values.iter().filter(|value| **value > RANK * svd.singular_values[0]).count();
    // Singular values are in descending order.
    let range = product(&q, left.columns(0, rank));
    let mut inner = range.tr_mul(response);
    for (value, singular) in inner.iter_mut().zip(svd.singular_values.iter()) {
        *value /= *singular;
    }
    let weights = right.rows(0, rank).tr_mul(&inner).component_div(&scale);
    Some((range, weights))
}
