use core::ops::{Index, IndexMut};

use nalgebra::{SMatrix, SVector};

use crate::Scalar;

/// A symmetric `N × N` matrix as its lower triangle, row by row, in `L = N (N + 1) / 2` numbers.
///
/// Asymmetry cannot be represented. A wrong `L` does not compile:
/// ```compile_fail
/// let _ = ohmstrain_model::Symmetric::<f64, 3, 5>::zeros();
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Symmetric<T, const N: usize, const L: usize>([T; L]);

impl<T: Scalar, const N: usize, const L: usize> Symmetric<T, N, L> {
    const LENGTH_FITS: () = assert!(L == N * (N + 1) / 2, "L must be N (N + 1) / 2");

    /// The zero matrix.
    #[must_use]
    pub fn zeros() -> Self {
        let () = Self::LENGTH_FITS;
        Self([T::zero(); L])
    }

    /// Builds a diagonal matrix.
    #[must_use]
    pub fn from_diagonal(diagonal: &[T; N]) -> Self {
        let mut out = Self::zeros();
        for (i, value) in diagonal.iter().enumerate() {
            out[(i, i)] = *value;
        }
        out
    }

    /// Takes the lower triangle of `matrix`; entries above the diagonal are not read.
    #[must_use]
    pub fn from_lower(matrix: &SMatrix<T, N, N>) -> Self {
        let mut out = Self::zeros();
        for i in 0..N {
            for j in 0..=i {
                out[(i, j)] = matrix[(i, j)];
            }
        }
        out
    }

    /// Returns the full matrix.
    #[must_use]
    pub fn to_matrix(&self) -> SMatrix<T, N, N> {
        SMatrix::from_fn(|i, j| self[(i, j)])
    }

    /// The lower triangle, row by row.
    #[must_use]
    pub const fn packed(&self) -> &[T; L] {
        &self.0
    }

    /// The lower triangle, row by row, mutable.
    #[must_use]
    pub const fn packed_mut(&mut self) -> &mut [T; L] {
        &mut self.0
    }

    /// Builds the matrix from its lower triangle, row by row.
    #[must_use]
    pub fn from_packed(packed: [T; L]) -> Self {
        let () = Self::LENGTH_FITS;
        Self(packed)
    }

    /// Matrix times vector.
    #[must_use]
    pub fn mul(&self, vector: &SVector<T, N>) -> SVector<T, N> {
        SVector::from_fn(|i, _| {
            let mut sum = T::zero();
            for j in 0..N {
                sum += self[(i, j)] * vector[j];
            }
            sum
        })
    }

    /// `self += factor · vector · vectorᵀ`.
    pub fn add_outer(&mut self, vector: &SVector<T, N>, factor: T) {
        let mut entries = self.0.iter_mut();
        for i in 0..N {
            let scaled = factor * vector[i];
            for (j, entry) in (0..=i).zip(&mut entries) {
                *entry += scaled * vector[j];
            }
        }
    }

    /// Returns `A · self · Aᵀ`, symmetric by construction.
    #[must_use]
    pub fn congruence(&self, a: &SMatrix<T, N, N>) -> Self {
        let ap = a * self.to_matrix();
        let mut out = Self::zeros();
        for i in 0..N {
            for j in 0..=i {
                let mut sum = T::zero();
                for k in 0..N {
                    sum += ap[(i, k)] * a[(j, k)];
                }
                out[(i, j)] = sum;
            }
        }
        out
    }

    /// Sum of two matrices.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0.iter()) {
            *a += *b;
        }
        self
    }

    /// `factor · self`.
    #[must_use]
    pub fn scaled(mut self, factor: T) -> Self {
        for entry in &mut self.0 {
            *entry *= factor;
        }
        self
    }

    /// True if every entry is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }
}

impl<T, const N: usize, const L: usize> Index<(usize, usize)> for Symmetric<T, N, L> {
    type Output = T;
    #[inline]
    fn index(&self, (i, j): (usize, usize)) -> &T {
        let (i, j) = if i >= j { (i, j) } else { (j, i) };
        &self.0[i * (i + 1) / 2 + j]
    }
}

impl<T, const N: usize, const L: usize> IndexMut<(usize, usize)> for Symmetric<T, N, L> {
    #[inline]
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut T {
        let (i, j) = if i >= j { (i, j) } else { (j, i) };
        &mut self.0[i * (i + 1) / 2 + j]
    }
}

/// The packed numbers, in order.
#[cfg(feature = "serde")]
impl<T: serde::Serialize, const N: usize, const L: usize> serde::Serialize for Symmetric<T, N, L> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serde_big_array::BigArray::serialize(&self.0, serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de, T: Scalar + serde::Deserialize<'de>, const N: usize, const L: usize> serde::Deserialize<'de>
    for Symmetric<T, N, L>
{
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let () = Self::LENGTH_FITS;
        serde_big_array::BigArray::deserialize(deserializer).map(Self)
    }
}
