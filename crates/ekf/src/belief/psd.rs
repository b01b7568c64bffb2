use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Scalar, Symmetric};

/// `P = L D Lᵀ` of a positive semi-definite matrix: unit lower triangle and diagonal.
///
/// A direction without variance has a zero pivot. It is skipped in the factor and in [`Self::solve`], so that exactly
/// known states are valid input. A pivot counts as zero below a fraction of its own diagonal entry, so that units do
/// not matter: N ε, the rounding error of a zero, or a fraction given by the caller.
pub(crate) struct SemiDefinite<T, const N: usize> {
    lower: SMatrix<T, N, N>,
    pivots: SVector<T, N>,
}

impl<T: Scalar, const N: usize> SemiDefinite<T, N> {
    /// Returns the factor without pivots up to `negligible` times their diagonal entry.
    pub(crate) fn factor_without<const L: usize>(matrix: &Symmetric<T, N, L>, negligible: T) -> Self {
        let mut lower = SMatrix::<T, N, N>::identity();
        let mut pivots = SVector::<T, N>::zeros();
        for j in 0..N {
            let mut pivot = matrix[(j, j)];
            for k in 0..j {
                pivot -= lower[(j, k)] * lower[(j, k)] * pivots[k];
            }
            if pivot <= matrix[(j, j)].abs() * negligible {
                continue;
            }
            pivots[j] = pivot;
            for i in j + 1..N {
                let mut entry = matrix[(i, j)];
                for k in 0..j {
                    entry -= lower[(i, k)] * lower[(j, k)] * pivots[k];
                }
                lower[(i, j)] = entry / pivot;
            }
        }
        Self { lower, pivots }
    }

    /// Returns a solution x of `P x = rhs` for a right-hand side in the range of P.
    pub(crate) fn solve(&self, rhs: &SVector<T, N>) -> SVector<T, N> {
        let mut x = *rhs;
        for i in 0..N {
            for k in 0..i {
                let below = self.lower[(i, k)] * x[k];
                x[i] -= below;
            }
        }
        for i in 0..N {
            x[i] = if self.pivots[i] > T::zero() { x[i] / self.pivots[i] } else { T::zero() };
        }
        for i in (0..N).rev() {
            for k in i + 1..N {
                let above = self.lower[(k, i)] * x[k];
                x[i] -= above;
            }
        }
        x
    }
}
