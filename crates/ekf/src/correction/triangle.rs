use ohmstrain_model::Scalar;

use super::BLOCK;
use crate::kernel::Several;

/// An upper triangular matrix W in stripes of [`BLOCK`] rows: of each stripe the columns from the diagonal on, in which zeros
/// stand below it. A column of a stripe is a vector, and what a row adds up stays in its lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle<'a, T> {
    columns: &'a [[T; BLOCK]],
    side: usize,
}

impl<'a, T> Triangle<'a, T> {
    /// A matrix without rows.
    pub const NONE: Self = Self { columns: &[], side: 0 };

    /// The matrix of `side` rows and columns with these [stripes].
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
    /// |W k|², of as many numbers k as there are columns. Each row is added up column by column, squares row by row: the same sums
    /// whatever the lanes.
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

/// The columns of a [`Triangle`], of its entries on and above the diagonal.
pub fn stripes<T: Scalar>(side: usize, entry: impl Fn(usize, usize) -> T) -> impl Iterator<Item = [T; BLOCK]> {
    stripe_places(side).map(move |(first, j)| {
        core::array::from_fn(|row| if first + row <= j { entry(first + row, j) } else { T::zero() })
    })
}

/// Returns the places of the columns of [stripes]: the first of their rows, and the column.
pub fn stripe_places(side: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..side).step_by(BLOCK).flat_map(move |first| (first..side).map(move |j| (first, j)))
}
