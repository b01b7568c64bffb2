//! Criterion by which the settings of a process are chosen.

use crate::dense::inverse_diagonal;

use super::gaussian_process::{BLOCKS, BlockLeftOut, GaussianProcess};

/// Criterion for choosing settings; larger is better. Rows are closer in time than the correlation time of their errors. Marginal
/// likelihood alone would therefore take the shared errors of neighbours for a function of the inputs, with little noise and short length
/// scales. A held-out block has no such neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Criterion {
    /// Density of each row by itself, predicted without its block.
    LeftOut,
    /// Geometric mean of that density, of the joint densities of the blocks, and of marginal likelihood.
    LeftOutAndEvidence,
}

impl Criterion {
    /// Returns its negative logarithm, up to a constant; `None` if a covariance is not positive definite.
    pub(super) fn cost(self, process: &GaussianProcess) -> Option<f64> {
        let left_out = LeftOutCosts::new(process)?;
        let of_all = || (left_out.rows + left_out.blocks + process.negative_log_evidence()) / 3.0;
        Some(if self == Criterion::LeftOut { left_out.rows } else { of_all() })
    }
}

/// Negative logarithms of densities, up to a constant, each with the prior variance that minimises it.
struct LeftOutCosts {
    rows: f64,
    blocks: f64,
}

impl LeftOutCosts {
    fn new(process: &GaussianProcess) -> Option<Self> {
        let (mut of_rows, mut of_blocks) = (NormalSum::default(), NormalSum::default());
        for BlockLeftOut { errors, precision, .. } in process.blocks_left_out(BLOCKS)? {
            let triangle = precision.l();
            let half_log_determinant = -triangle.diagonal().iter().map(|pivot| pivot.ln()).sum::<f64>();
            of_blocks.add(errors.len(), triangle.tr_mul(&errors).norm_squared(), half_log_determinant);
            for (error, variance) in errors.iter().zip(inverse_diagonal(&precision)) {
                of_rows.add(1, error * error / variance, 0.5 * variance.ln());
            }
        }
        Some(Self { rows: of_rows.cost(), blocks: of_blocks.cost() })
    }
}

/// Sums of normal densities whose covariances have a common factor.
#[derive(Clone, Copy, Default)]
struct NormalSum {
    count: usize,
    /// Sum of squared errors in units of their covariance.
    squares: f64,
    half_log_determinants: f64,
}

impl NormalSum {
    fn add(&mut self, count: usize, square: f64, half_log_determinant: f64) {
        self.count += count;
        self.squares += square;
        self.half_log_determinants += half_log_determinant;
    }

    fn cost(self) -> f64 {
        let count = self.count as f64;
        0.5 * count * (self.squares / count).ln() + self.half_log_determinants
    }
}
