//! Products of matrices.

use fearless_simd::{Level, dispatch};
use nalgebra::{DMatrix, DMatrixView};

use super::tile::{COLUMNS, ROWS, tile};

/// Returns `a b` (m × n of m × k and k × n). Each entry is summed in order of k, without fused instructions. nalgebra's own product of
/// large matrices uses those where the processor has them, which changes the last digits of a calibration.
///
/// Panics if the sizes do not fit.
pub(crate) fn product<'a, 'b>(a: impl Into<DMatrixView<'a, f64>>, b: impl Into<DMatrixView<'b, f64>>) -> DMatrix<f64> {
    product_at(Level::new(), &a.into(), &b.into())
}

/// Computes the product with the instructions of this level.
fn product_at(level: Level, a: &DMatrixView<f64>, b: &DMatrixView<f64>) -> DMatrix<f64> {
    assert_eq!(a.ncols(), b.nrows(), "columns of the first and rows of the second matrix");
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    let right: Vec<Vec<[f64; COLUMNS]>> = (0..b.ncols()).step_by(COLUMNS).map(|start| columns_of(b, start)).collect();
    for row in (0..a.nrows()).step_by(ROWS) {
        let left = rows_of(a, row);
        for (place, right) in right.iter().enumerate() {
            let tile = dispatch!(level, simd => tile(simd, &[[0.0; ROWS]; COLUMNS], &left, right));
            for (mut column, sums) in out.columns_range_mut(COLUMNS * place..).column_iter_mut().zip(&tile) {
                column.as_mut_slice()[row..].iter_mut().zip(sums).for_each(|(entry, sum)| *entry = *sum);
            }
        }
    }
    out
}

/// Returns the rows from `start` on, column by column, with zeros beyond the last row.
fn rows_of(a: &DMatrixView<f64>, start: usize) -> Vec<[f64; ROWS]> {
    let of_column = |k: usize| {
        let column = a.column(k);
        let from = &column.as_slice()[start..];
        from.first_chunk().copied().unwrap_or_else(|| std::array::from_fn(|row| from.get(row).copied().unwrap_or(0.0)))
    };
    (0..a.ncols()).map(of_column).collect()
}

/// Returns the columns from `start` on, row by row, with zeros beyond the last column.
fn columns_of(b: &DMatrixView<f64>, start: usize) -> Vec<[f64; COLUMNS]> {
    let mut rows = vec![[0.0; COLUMNS]; b.nrows()];
    for (place, column) in b.columns_range(start..).column_iter().take(COLUMNS).enumerate() {
        rows.iter_mut().zip(column.as_slice()).for_each(|(to, from)| to[place] = *from);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::{product, product_at};
    use fearless_simd::Level;
    use nalgebra::DMatrix;

    /// Compares with rounded sums in order of k, at the lowest and the best level of the processor, for sizes that fill no tile.
    #[test]
    fn each_entry_is_a_sum_in_order() {
        for (m, k, n) in [(1, 1, 1), (9, 7, 5), (17, 40, 3), (8, 4, 4), (3, 0, 2)] {
            let number = |i: usize, j: usize| (((i * 31 + j * 17) % 101) as f64 - 50.0) / 7.0;
            let (a, b) = (DMatrix::from_fn(m, k, number), DMatrix::from_fn(k, n, |i, j| number(j, i) / 3.0));
            let entry = |i: usize, j: usize| (0..k).fold(0.0, |sum, l| sum + a[(i, l)] * b[(l, j)]);
            let expected = DMatrix::from_fn(m, n, entry);
            assert_eq!(product(&a, &b), expected);
            assert_eq!(product_at(Level::baseline(), &a.as_view(), &b.as_view()), expected);
        }
    }

    #[test]
    fn views_are_multiplied_as_matrices_are() {
        let (a, b) =
            (DMatrix::from_fn(9, 7, |i, j| (i * 7 + j) as f64), DMatrix::from_fn(7, 8, |i, j| (i + 2 * j) as f64));
        assert_eq!(product(a.columns(1, 3), b.rows(2, 3)), a.columns(1, 3) * b.rows(2, 3));
        assert_eq!(
            product(a.view((2, 1), (5, 4)), b.view((3, 2), (4, 3))),
            a.view((2, 1), (5, 4)) * b.view((3, 2), (4, 3))
        );
    }
}
