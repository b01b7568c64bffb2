//! Products of matrices with the same digits on every processor.

use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x4};
use nalgebra::{DMatrix, Dyn, Matrix, Storage};

/// Lanes of a vector.
const LANES: usize = 4;
/// Rows and columns of a tile, whose sums stay in registers.
const ROWS: usize = 2 * LANES;
const COLUMNS: usize = 4;

/// `a b` (m × n of m × k and k × n). Each entry is summed up in order of k, without fused instructions: nalgebra's own product of
/// large matrices takes those where the processor has some, and then a calibration ends in other last digits there.
///
/// Panics where the sizes do not fit.
pub(crate) fn product<A: Storage<f64, Dyn, Dyn>, B: Storage<f64, Dyn, Dyn>>(
    a: &Matrix<f64, Dyn, Dyn, A>,
    b: &Matrix<f64, Dyn, Dyn, B>,
) -> DMatrix<f64> {
    product_at(Level::new(), a, b)
}

/// The product with the instructions of this level.
fn product_at<A: Storage<f64, Dyn, Dyn>, B: Storage<f64, Dyn, Dyn>>(
    level: Level,
    a: &Matrix<f64, Dyn, Dyn, A>,
    b: &Matrix<f64, Dyn, Dyn, B>,
) -> DMatrix<f64> {
    assert_eq!(a.ncols(), b.nrows(), "columns of the first and rows of the second matrix");
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    let right: Vec<Vec<[f64; COLUMNS]>> = (0..b.ncols()).step_by(COLUMNS).map(|start| columns_of(b, start)).collect();
    for row in (0..a.nrows()).step_by(ROWS) {
        let left = rows_of(a, row);
        for (place, right) in right.iter().enumerate() {
            let tile = dispatch!(level, simd => tile(simd, &left, right));
            for (mut column, sums) in out.columns_range_mut(COLUMNS * place..).column_iter_mut().zip(&tile) {
                column.rows_range_mut(row..).iter_mut().zip(sums).for_each(|(entry, sum)| *entry = *sum);
            }
        }
    }
    out
}

/// The rows from `start` on, column by column; zeros beyond the last row.
fn rows_of<A: Storage<f64, Dyn, Dyn>>(a: &Matrix<f64, Dyn, Dyn, A>, start: usize) -> Vec<[f64; ROWS]> {
    let of_column = |k: usize| {
        let mut rows = [0.0; ROWS];
        rows.iter_mut().zip(a.view((start, k), (a.nrows() - start, 1)).iter()).for_each(|(to, from)| *to = *from);
        rows
    };
    (0..a.ncols()).map(of_column).collect()
}

/// The columns from `start` on, row by row; zeros beyond the last column.
fn columns_of<B: Storage<f64, Dyn, Dyn>>(b: &Matrix<f64, Dyn, Dyn, B>, start: usize) -> Vec<[f64; COLUMNS]> {
    let mut rows = vec![[0.0; COLUMNS]; b.nrows()];
    for (place, column) in b.columns_range(start..).column_iter().take(COLUMNS).enumerate() {
        rows.iter_mut().zip(column.iter()).for_each(|(to, from)| to[place] = *from);
    }
    rows
}

/// The entries of a tile, column by column.
#[inline(always)]
fn tile<S: Simd>(simd: S, left: &[[f64; ROWS]], right: &[[f64; COLUMNS]]) -> [[f64; ROWS]; COLUMNS] {
    let mut sums = [[f64x4::splat(simd, 0.0); ROWS / LANES]; COLUMNS];
    for (left, right) in left.iter().zip(right) {
        let (upper, lower) = left.split_at(LANES);
        let left = [f64x4::from_slice(simd, upper), f64x4::from_slice(simd, lower)];
        for (sums, factor) in sums.iter_mut().zip(right) {
            let factor = f64x4::splat(simd, *factor);
            sums.iter_mut().zip(left).for_each(|(sum, left)| *sum += left * factor);
        }
    }
    sums.map(|[upper, lower]| {
        let mut column = [0.0; ROWS];
        let (first, second) = column.split_at_mut(LANES);
        first.copy_from_slice(upper.as_slice());
        second.copy_from_slice(lower.as_slice());
        column
    })
}

#[cfg(test)]
mod tests {
    use super::{product, product_at};
    use fearless_simd::Level;
    use nalgebra::DMatrix;

    /// Rounded sums in order of k, at the least level of the processor as at the best one, of sizes that fill no tile.
    #[test]
    fn each_entry_is_a_sum_in_order() {
        for (m, k, n) in [(1, 1, 1), (9, 7, 5), (17, 40, 3), (8, 4, 4), (3, 0, 2)] {
            let number = |i: usize, j: usize| (((i * 31 + j * 17) % 101) as f64 - 50.0) / 7.0;
            let (a, b) = (DMatrix::from_fn(m, k, number), DMatrix::from_fn(k, n, |i, j| number(j, i) / 3.0));
            let entry = |i: usize, j: usize| (0..k).fold(0.0, |sum, l| sum + a[(i, l)] * b[(l, j)]);
            let expected = DMatrix::from_fn(m, n, entry);
            assert_eq!(product(&a, &b), expected);
            assert_eq!(product_at(Level::baseline(), &a, &b), expected);
        }
    }

    #[test]
    fn views_are_multiplied_as_matrices_are() {
        let (a, b) =
            (DMatrix::from_fn(9, 7, |i, j| (i * 7 + j) as f64), DMatrix::from_fn(7, 8, |i, j| (i + 2 * j) as f64));
        assert_eq!(product(&a.columns(1, 3), &b.rows(2, 3)), a.columns(1, 3) * b.rows(2, 3));
        assert_eq!(
            product(&a.view((2, 1), (5, 4)), &b.view((3, 2), (4, 3))),
            a.view((2, 1), (5, 4)) * b.view((3, 2), (4, 3))
        );
    }
}
