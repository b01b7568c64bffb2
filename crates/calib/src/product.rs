//! Products of matrices with the same digits on every processor.

use nalgebra::{DMatrix, Dyn, Matrix, Storage};

/// `a b` (m × n of m × k and k × n), summed up in one order. nalgebra's own product of large matrices takes fused instructions
/// where the processor has some, and then a calibration ends in other last digits there.
///
/// Panics where the sizes do not fit.
pub(crate) fn product<A: Storage<f64, Dyn, Dyn>, B: Storage<f64, Dyn, Dyn>>(
    a: &Matrix<f64, Dyn, Dyn, A>,
    b: &Matrix<f64, Dyn, Dyn, B>,
) -> DMatrix<f64> {
    a.transpose().tr_mul(b)
}

#[cfg(test)]
mod tests {
    use super::product;
    use nalgebra::DMatrix;

    /// Entry by entry, in numbers whose products and sums are exact.
    #[test]
    fn each_entry_is_a_row_times_a_column() {
        let a = DMatrix::from_fn(9, 7, |i, j| (i * 7 + j) as f64 - 20.0);
        let b = DMatrix::from_fn(7, 8, |i, j| (i as f64 - 3.0) * (j as f64 + 1.0));
        let entry = |i: usize, j: usize| (0..7).map(|k| a[(i, k)] * b[(k, j)]).sum();
        assert_eq!(product(&a, &b), DMatrix::from_fn(9, 8, entry));
        assert_eq!(product(&a.columns(1, 3), &b.rows(2, 3)), a.columns(1, 3) * b.rows(2, 3));
    }
}
