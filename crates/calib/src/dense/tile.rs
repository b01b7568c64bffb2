//! A tile of a product, whose sums stay in registers.

use fearless_simd::{Simd, SimdBase, f64x4};

/// Number of lanes in a vector.
const LANES: usize = 4;
/// Rows and columns of a tile.
pub(super) const ROWS: usize = 2 * LANES;
pub(super) const COLUMNS: usize = 4;

/// Two vectors.
pub(super) type Vectors<S> = [f64x4<S>; ROWS / LANES];
/// Entries of a tile, column by column.
pub(super) type Tile = [[f64; ROWS]; COLUMNS];

/// Returns `from + left right`, summed in order of the columns of `left` and without fused instructions; `left` is given column by column,
/// `right` row by row.
#[inline(always)]
pub(super) fn tile<S: Simd>(simd: S, from: &Tile, left: &[[f64; ROWS]], right: &[[f64; COLUMNS]]) -> Tile {
    let mut sums = [[f64x4::splat(simd, 0.0); ROWS / LANES]; COLUMNS];
    sums.iter_mut().zip(from).for_each(|(sums, from)| *sums = vectors(simd, from));
    for (left, right) in left.iter().zip(right) {
        let left = vectors(simd, left);
        for (sums, factor) in sums.iter_mut().zip(right) {
            let factor = f64x4::splat(simd, *factor);
            sums.iter_mut().zip(left).for_each(|(sum, left)| *sum += left * factor);
        }
    }
    sums.map(numbers)
}

/// Returns eight numbers as two vectors.
#[inline(always)]
pub(super) fn vectors<S: Simd>(simd: S, numbers: &[f64; ROWS]) -> Vectors<S> {
    let (first, second) = numbers.split_at(LANES);
    [f64x4::from_slice(simd, first), f64x4::from_slice(simd, second)]
}

/// Returns the numbers of two vectors.
#[inline(always)]
pub(super) fn numbers<S: Simd>([first, second]: Vectors<S>) -> [f64; ROWS] {
    let mut numbers = [0.0; ROWS];
    let (upper, lower) = numbers.split_at_mut(LANES);
    upper.copy_from_slice(first.as_slice());
    lower.copy_from_slice(second.as_slice());
    numbers
}
