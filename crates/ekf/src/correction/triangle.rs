use ohmstrain_model::Scalar;

use super::BLOCK;
use crate::kernel::Several;

/// An upper triangular matrix W in stripes of [`BLOCK`] rows: for each stripe the columns from the diagonal on, with zeros
/// below it. A column of a stripe is a vector, and the sum of a row stays in its lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<'a, T> {
    columns: &'a [[T; BLOCK]],
    side: usize,
}

impl<'a, T> Triangle<'a, T> {
    /// A matrix without rows.
    pub const NONE: Self = Self { columns: &[], side: 0 };

    /// Builds the matrix of `side` rows and columns from its [stripes].
    #[must_use]
    pub const fn new(columns: &'a [[T; BLOCK]], side: usize) -> Self {
        Self { columns, side }
    }

    /// Number of rows.
    #[must_use]
    pub const fn side(&self) -> usize {
        self.side
    }
}

impl<T: Scalar> Triangle<'_, T> {
    /// Returns |W k|² for a vector k with one number per column. Each row is summed column by column, and squares row by row, so
    /// that the result does not depend on the number of lanes.
    #[inline(always)]
    pub(super) fn square<V: Several<Number = T>>(&self, like: V, k: &[T]) -> T {
        let (mut square, mut columns, mut with) = (T::zero(), self.columns, k.get(..self.side).unwrap_or(&[]));
        while !with.is_empty() {
            let mut sums = [like.nothing(); BLOCK];
            for (column, k) in columns.iter().zip(with) {
                let k = like.with(*k);
                for part in 0..BLOCK / V::WIDTH {
                    sums[part] = like.first_of(&column[part * V::WIDTH..]).mul_add(k, sums[part]);
                }
            }
            for row in 0..BLOCK {
                let sum = sums[row / V::WIDTH].at(row % V::WIDTH);
                square += sum * sum;
            }
            columns = columns.get(with.len()..).unwrap_or(&[]);
            with = with.get(BLOCK..).unwrap_or(&[]);
        }
        square
    }
}

/// Returns the columns of a [`Triangle`] from its entries on and above the diagonal.
pub fn stripes<T: Scalar>(side: usize, entry: impl Fn(usize, usize) -> T) -> impl Iterator<Item = [T; BLOCK]> {
    stripe_places(side).map(move |(first, j)| {
        core::array::from_fn(|row| if first + row <= j { entry(first + row, j) } else { T::zero() })
    })
}

/// Returns the positions of the columns of [stripes]: their first row, and the column.
pub fn stripe_places(side: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..side).step_by(BLOCK).flat_map(move |first| (first..side).map(move |j| (first, j)))
}
