use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

/// A covariance C V Cᵀ: columns C over independent sources of variances V. For a state it is L D Lᵀ, with a unit lower
/// triangular L.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Factor<T, const N: usize> {
    pub(super) columns: SMatrix<T, N, N>,
    pub(super) variances: SVector<T, N>,
}

impl<T: Scalar, const N: usize> Factor<T, N> {
    pub(super) fn zero() -> Self {
        Self { columns: SMatrix::identity(), variances: SVector::zeros() }
    }

    /// Returns the factor of a matrix; `None` if the matrix is not finite, symmetric and positive semi-definite to
    /// rounding.
    ///
    /// It is a pivoted Cholesky factorisation: each step eliminates the entry with the largest remaining share of its
    /// variance. It is exact to rounding for matrices of any rank and in any units.
    pub(super) fn of(matrix: &SMatrix<T, N, N>) -> Option<Self> {
        let sd = matrix.diagonal().map(|variance| variance.max(T::zero()).sqrt());
        let rounding = T::default_epsilon() * T::of((8 * N) as f64);
        let is_zero = |x: T, i: usize, j: usize| x.abs() <= rounding * sd[i] * sd[j];
        let (mut left, mut out) = (*matrix, Self { columns: SMatrix::zeros(), variances: SVector::zeros() });
        for k in 0..N {
            let share = |i: usize| if sd[i].is_zero() { T::zero() } else { left[(i, i)] / (sd[i] * sd[i]) };
            let largest = (1..N).fold(0, |best, i| if share(i) > share(best) { i } else { best });
            let pivot = left[(largest, largest)];
            if pivot <= rounding * sd[largest] * sd[largest] {
                break;
            }
            let column = left.column(largest) / pivot;
            left -= column * column.transpose() * pivot;
            out.columns.set_column(k, &column);
            out.variances[k] = pivot;
        }
        let is_symmetric = |i: usize, j: usize| is_zero(matrix[(i, j)] - matrix[(j, i)], i, j);
        let is_left = |i: usize, j: usize| is_zero(left[(i, j)], i, j);
        let is_finite = matrix.iter().all(|x| x.is_finite());
        let mut pairs = (0..N).flat_map(|i| (0..N).map(move |j| (i, j)));
        (is_finite && pairs.all(|(i, j)| is_symmetric(i, j) && is_left(i, j))).then_some(out)
    }

    /// Returns the covariance.
    pub(super) fn matrix(&self) -> SMatrix<T, N, N> {
        self.columns * SMatrix::from_diagonal(&self.variances) * self.columns.transpose()
    }

    /// Returns column `i` times its standard deviation.
    pub(super) fn column(&self, i: usize) -> SVector<T, N> {
        self.columns.column(i) * self.variances[i].sqrt()
    }
}
