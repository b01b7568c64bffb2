//! Cholesky factors, and inverses by them.

use fearless_simd::{Level, dispatch};
use nalgebra::{Cholesky, DMatrix, Dyn, Matrix, Storage};

use super::gram::{dot, gram_of};
use super::tile::{COLUMNS, ROWS, Tile, tile};

/// Factors `A = L Lᵀ` (n × n, from its lower triangle); `None` if it is not positive definite. Digit for digit the factor of nalgebra: each
/// entry has its products subtracted in order, then is divided. The upper triangle keeps the entries of `A`.
pub(crate) fn cholesky(matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    cholesky_at(Level::new(), matrix)
}

/// Factors with the instructions of this level.
fn cholesky_at(level: Level, mut matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    assert!(matrix.is_square(), "only a square matrix has a factor");
    let n = matrix.nrows();
    // Finished columns of L, in strips of rows, with zeros beyond the last row.
    let mut strips: Vec<Vec<[f64; ROWS]>> = vec![Vec::with_capacity(n); n.div_ceil(ROWS)];
    for start in (0..n).step_by(COLUMNS) {
        let diagonal = start / ROWS;
        let right: Vec<[f64; COLUMNS]> = strips[diagonal].iter().map(|rows| negated(rows, start % ROWS)).collect();
        let mut tiles: Vec<Tile> = Vec::with_capacity(strips.len() - diagonal);
        for (place, strip) in strips.iter().enumerate().skip(diagonal) {
            let from = tile_of(&matrix, place * ROWS, start);
            tiles.push(dispatch!(level, simd => tile(simd, &from, strip, &right)));
        }
        finish(&mut tiles, start % ROWS, COLUMNS.min(n - start))?;
        for (place, tile) in tiles.iter().enumerate() {
            let first = (diagonal + place) * ROWS;
            for (c, column) in tile.iter().enumerate().take(n - start) {
                let top = first.max(start + c);
                let to = matrix.view_range_mut(top..n.min(first + ROWS).max(top), start + c);
                to.into_iter().zip(column.iter().skip(top - first)).for_each(|(to, from)| *to = *from);
                strips[diagonal + place].push(*column);
            }
        }
    }
    Some(Cholesky::pack_dirty(matrix))
}

/// Returns rows of a column of L as a negated row of the right factor, so that products are subtracted.
fn negated(rows: &[f64; ROWS], first: usize) -> [f64; COLUMNS] {
    std::array::from_fn(|c| -rows[first + c])
}

/// Returns the tile of a matrix whose first entry is this one, with zeros beyond the matrix.
fn tile_of(matrix: &DMatrix<f64>, row: usize, column: usize) -> Tile {
    let (rows, columns) = (ROWS.min(matrix.nrows() - row), COLUMNS.min(matrix.ncols() - column));
    let mut tile = [[0.0; ROWS]; COLUMNS];
    for (to, from) in tile.iter_mut().zip(matrix.view((row, column), (rows, columns)).column_iter()) {
        to.iter_mut().zip(from.iter()).for_each(|(to, from)| *to = *from);
    }
    tile
}

/// Factors `columns` columns from which all earlier ones are already subtracted. Their diagonal is in the first tile, from row `first` on.
fn finish(tiles: &mut [Tile], first: usize, columns: usize) -> Option<()> {
    for c in 0..columns {
        for earlier in 0..c {
            let factor = tiles[0][earlier][first + c];
            for (before, from) in tiles.iter_mut().map(|tile| tile.split_at_mut(c)) {
                from[0].iter_mut().zip(&before[earlier]).for_each(|(entry, of_earlier)| *entry -= factor * of_earlier);
            }
        }
        let pivot = Some(tiles[0][c][first + c]).filter(|pivot| *pivot > 0.0)?.sqrt();
        for tile in &mut *tiles {
            tile[c].iter_mut().for_each(|entry| *entry /= pivot);
        }
        tiles[0][c][first + c] = pivot;
    }
    Some(())
}

/// Returns the inverse of a lower triangle (n × n); entries above the diagonal are not read.
pub(crate) fn lower_inverse<S: Storage<f64, Dyn, Dyn>>(triangle: &Matrix<f64, Dyn, Dyn, S>) -> DMatrix<f64> {
    let n = triangle.nrows();
    let triangle = triangle.clone_owned();
    let mut inverse = DMatrix::zeros(n, n);
    for (j, mut column) in inverse.column_iter_mut().enumerate() {
        let column = &mut column.as_mut_slice()[j..];
        column[0] = 1.0;
        solve_lower(&triangle, j, column);
    }
    inverse
}

/// Returns the inverse `L⁻ᵀ L⁻¹` of the factored matrix.
pub(crate) fn inverse(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    gram_of(&lower_inverse(factor.l_dirty()))
}

/// Returns the diagonal of the inverse of the factored matrix.
pub(crate) fn inverse_diagonal(factor: &Cholesky<f64, Dyn>) -> Vec<f64> {
    let triangle = factor.l_dirty();
    let entry = |j: usize| {
        let mut column = vec![0.0; triangle.nrows() - j];
        column[0] = 1.0;
        solve_lower(triangle, j, &mut column);
        solve_upper(triangle, j, &mut column);
        column[0]
    };
    (0..triangle.nrows()).map(entry).collect()
}

/// Solves `L x = b` for the part of a lower triangle from row and column `first` on, in place.
fn solve_lower(triangle: &DMatrix<f64>, first: usize, b: &mut [f64]) {
    for i in 0..b.len() {
        let [x, rest @ ..] = &mut b[i..] else { return };
        let [diagonal, below @ ..] = part_of(triangle, first + i) else { return };
        *x /= diagonal;
        rest.iter_mut().zip(below).for_each(|(entry, factor)| *entry -= *x * factor);
    }
}

/// Solves `Lᵀ x = b` for the same part.
fn solve_upper(triangle: &DMatrix<f64>, first: usize, b: &mut [f64]) {
    for i in (0..b.len()).rev() {
        let [x, rest @ ..] = &mut b[i..] else { return };
        let [diagonal, below @ ..] = part_of(triangle, first + i) else { return };
        *x = (*x - dot(below, rest)) / diagonal;
    }
}

/// Returns a column of a lower triangle, from the diagonal on.
fn part_of(triangle: &DMatrix<f64>, column: usize) -> &[f64] {
    &triangle.as_slice()[column * triangle.nrows()..][column..triangle.nrows()]
}

#[cfg(test)]
mod tests {
    use super::{cholesky, cholesky_at, inverse, inverse_diagonal, lower_inverse};
    use fearless_simd::Level;
    use nalgebra::DMatrix;

    /// Returns positive definite matrices, some of which fill their tiles.
    fn matrices() -> impl Iterator<Item = DMatrix<f64>> {
        [1, 3, 4, 8, 11, 16, 29, 40].into_iter().map(|n| {
            let apart = |i: usize, j: usize| (i as f64 - j as f64).abs() / 7.0;
            DMatrix::from_fn(n, n, |i, j| (-apart(i, j)).exp() + if i == j { 0.3 } else { 0.0 })
        })
    }

    /// Compares the factor, its upper part included, with nalgebra's, at the lowest and the best level of the processor.
    #[test]
    fn the_factor_is_nalgebras() {
        for matrix in matrices() {
            let expected = matrix.clone().cholesky().unwrap();
            assert_eq!(cholesky(matrix.clone()).unwrap().l_dirty(), expected.l_dirty());
            assert_eq!(cholesky_at(Level::baseline(), matrix).unwrap().l_dirty(), expected.l_dirty());
        }
    }

    #[test]
    fn what_is_not_positive_definite_has_no_factor() {
        for (n, place) in [(1, 0), (5, 4), (17, 9)] {
            for pivot in [0.0, -1.0, f64::NAN] {
                let mut matrix = DMatrix::identity(n, n);
                matrix[(place, place)] = pivot;
                assert!(cholesky(matrix).is_none(), "{n} {place} {pivot}");
            }
        }
    }

    #[test]
    fn inverses_are_nalgebras() {
        for matrix in matrices() {
            let factor = cholesky(matrix.clone()).unwrap();
            let expected = matrix.clone().cholesky().unwrap();
            assert_eq!(inverse_diagonal(&factor), expected.inverse().diagonal().as_slice());
            let identity = DMatrix::identity(matrix.nrows(), matrix.nrows());
            let of_triangle = expected.l_dirty().solve_lower_triangular(&identity).unwrap();
            assert_eq!(lower_inverse(factor.l_dirty()), of_triangle);
            // Rounding of n products, times the condition number, which is below the product of both traces.
            let (whole, n) = (expected.inverse(), matrix.nrows() as f64);
            let rounding = n * f64::EPSILON * matrix.trace() * whole.trace() * whole.amax();
            assert!((inverse(&factor) - whole).amax() <= rounding);
        }
    }
}
