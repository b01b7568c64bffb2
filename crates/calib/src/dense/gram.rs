//! Products of columns with each other.

use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x4};
use nalgebra::{DMatrix, DMatrixView};

use super::tile::{ROWS, Vectors, numbers, vectors};

/// Number of partial sums of a product: as many as two vectors hold.
const PARTS: usize = ROWS;
/// Number of columns in a tile.
const COLUMNS: usize = 2;

/// Partial sums of the products of a tile's columns.
type Sums = [[[f64; PARTS]; COLUMNS]; COLUMNS];

/// Returns `AᵀA` (n × n) of a matrix given by its n columns. Digit for digit that of nalgebra: eight partial sums, then the remaining rows.
///
/// Panics if columns differ in length.
pub(crate) fn gram(columns: &[&[f64]]) -> DMatrix<f64> {
    gram_at(Level::new(), columns)
}

/// Returns `AᵀA` (n × n) of a matrix, or of some of its rows.
pub(crate) fn gram_of<'a>(matrix: impl Into<DMatrixView<'a, f64>>) -> DMatrix<f64> {
    let matrix = matrix.into();
    let columns: Vec<_> = matrix.column_iter().collect();
    gram(&columns.iter().map(|column| column.as_slice()).collect::<Vec<_>>())
}

/// Computes the product with the instructions of this level.
fn gram_at(level: Level, columns: &[&[f64]]) -> DMatrix<f64> {
    let rows = columns.first().map_or(0, |column| column.len());
    assert!(columns.iter().all(|column| column.len() == rows), "columns of one length");
    let mut out = DMatrix::zeros(columns.len(), columns.len());
    for right in (0..columns.len()).step_by(COLUMNS) {
        for left in (right..columns.len()).step_by(COLUMNS) {
            let of = |start: usize| [0, 1].map(|c| columns[(start + c).min(columns.len() - 1)]);
            let (left_columns, right_columns) = (of(left), of(right));
            let sums = dispatch!(level, simd => partial_sums(simd, left_columns, right_columns));
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if left + i < columns.len() && right + j < columns.len() {
                    let sum = completed(&sums[i][j], left_columns[i], right_columns[j]);
                    out[(left + i, right + j)] = sum;
                    out[(right + j, left + i)] = sum;
                }
            }
        }
    }
    out
}

/// Computes partial sums over the rows that fill vectors. The loops are unrolled by hand, because the compiler keeps arrays of vectors in
/// memory.
#[inline(always)]
fn partial_sums<S: Simd>(simd: S, [a, b]: [&[f64]; COLUMNS], [c, d]: [&[f64]; COLUMNS]) -> Sums {
    let zero = [f64x4::splat(simd, 0.0); 2];
    let (mut ac, mut ad, mut bc, mut bd) = (zero, zero, zero, zero);
    let (a, b) = (a.as_chunks::<PARTS>().0, b.as_chunks::<PARTS>().0);
    let (c, d) = (c.as_chunks::<PARTS>().0, d.as_chunks::<PARTS>().0);
    for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
        let (a, b, c, d) = (vectors(simd, a), vectors(simd, b), vectors(simd, c), vectors(simd, d));
        (ac, ad) = (plus(ac, a, c), plus(ad, a, d));
        (bc, bd) = (plus(bc, b, c), plus(bd, b, d));
    }
    [[numbers(ac), numbers(ad)], [numbers(bc), numbers(bd)]]
}

/// Returns `sum + a b`, lane by lane.
#[inline(always)]
fn plus<S: Simd>(sum: Vectors<S>, a: Vectors<S>, b: Vectors<S>) -> Vectors<S> {
    [sum[0] + a[0] * b[0], sum[1] + a[1] * b[1]]
}

/// Adds up the partial sums and the products of the remaining rows.
fn completed(parts: &[f64; PARTS], a: &[f64], b: &[f64]) -> f64 {
    let pairs = (0..PARTS / 2).fold(0.0, |sum, lane| sum + (parts[lane] + parts[PARTS / 2 + lane]));
    let (a, b) = (a.as_chunks::<PARTS>().1, b.as_chunks::<PARTS>().1);
    a.iter().zip(b).fold(pairs, |sum, (a, b)| sum + a * b)
}

/// Returns the scalar product of two columns, digit for digit that of nalgebra.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut parts = [0.0; PARTS];
    for (a, b) in a.as_chunks::<PARTS>().0.iter().zip(b.as_chunks::<PARTS>().0) {
        parts.iter_mut().zip(a).zip(b).for_each(|((part, a), b)| *part += a * b);
    }
    completed(&parts, a, b)
}

#[cfg(test)]
mod tests {
    use super::{gram, gram_at};
    use fearless_simd::Level;
    use nalgebra::DMatrix;

    /// Compares with nalgebra for sizes that do and do not fill vectors and tiles, at the lowest and the best level of the processor.
    #[test]
    fn the_products_are_nalgebras() {
        for (m, n) in [(0, 1), (5, 3), (8, 2), (41, 7), (64, 1)] {
            let matrix = DMatrix::from_fn(m, n, |i, j| (((i * 31 + j * 17) % 101) as f64 - 50.0) / 7.0);
            let columns: Vec<&[f64]> = (0..n).map(|j| &matrix.as_slice()[j * m..(j + 1) * m]).collect();
            let expected = matrix.tr_mul(&matrix);
            assert_eq!(gram(&columns), expected);
            assert_eq!(gram_at(Level::baseline(), &columns), expected);
        }
    }
}
