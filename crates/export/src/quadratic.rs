//! Quadratic function of a correction's inputs, which approximates a smooth Gaussian process at low cost.

use nalgebra::{DMatrix, DVector};
use ohmstrain_ekf::correction::Quadratic;
use serde::Serialize;

/// Owned numbers of a [`Quadratic`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OwnedQuadratic<T = f64> {
    /// Coefficients of the inputs.
    pub linear: Vec<T>,
    /// Coefficients of their products, the lower triangle row by row.
    pub square: Vec<T>,
}

impl<T> OwnedQuadratic<T> {
    /// Borrows it in the form that a correction takes.
    pub fn borrowed(&self) -> Quadratic<'_, T> {
        Quadratic { linear: &self.linear, square: &self.square }
    }
}

impl OwnedQuadratic {
    /// Converts each number.
    pub fn map<T>(&self, number: impl Fn(f64) -> T) -> OwnedQuadratic<T> {
        let all = |numbers: &[f64]| numbers.iter().copied().map(&number).collect();
        OwnedQuadratic { linear: all(&self.linear), square: all(&self.square) }
    }
}

/// Ridge that keeps the equations regular, as a share of a column's mean square.
const RIDGE: f64 = 1e-5;

/// Least-squares fit of values at points by a constant, a quadratic function and weighted further columns.
pub struct Fit {
    pub constant: f64,
    pub quadratic: OwnedQuadratic,
    pub weights: Vec<f64>,
}

impl Fit {
    /// Solves the weighted least squares; `None` if the equations are singular.
    pub fn new(points: &[&[f64]], columns: &DMatrix<f64>, values: &DVector<f64>, weights: &[f64]) -> Option<Self> {
        let inputs = points.first()?.len();
        let monomials: Vec<Vec<f64>> = points.iter().map(|x| monomials(x)).collect();
        let count = monomials.first()?.len();
        let entry = |i: usize, j: usize| if j < count { monomials[i][j] } else { columns[(i, j - count)] };
        let design = DMatrix::from_fn(points.len(), count + columns.ncols(), |i, j| weights[i].sqrt() * entry(i, j));
        let target = DVector::from_fn(points.len(), |i, _| weights[i].sqrt() * values[i]);
        let mut normal = design.tr_mul(&design);
        // Columns of a constant input are zero.
        let least = f64::EPSILON * normal.diagonal().max();
        for i in 0..normal.nrows() {
            normal[(i, i)] += RIDGE * normal[(i, i)] + least;
        }
        let solved = normal.cholesky()?.solve(&design.tr_mul(&target));
        let part = |from: usize, until: usize| solved.rows(from, until - from).iter().copied().collect();
        let quadratic = OwnedQuadratic { linear: part(1, 1 + inputs), square: part(1 + inputs, count) };
        Some(Self { constant: solved[0], quadratic, weights: part(count, solved.len()) })
    }
}

/// Returns 1, x, and the products of the lower triangle.
fn monomials(x: &[f64]) -> Vec<f64> {
    let products = x.iter().enumerate().flat_map(|(i, a)| x[..=i].iter().map(move |b| a * b));
    std::iter::once(1.0).chain(x.iter().copied()).chain(products).collect()
}
