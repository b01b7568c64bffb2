use nalgebra::{DMatrix, DVector};

use crate::dense::{cholesky, gram};

/// Normal equations of a regression, block by block of the recording, so that any subset of columns can be fitted and
/// cross-validated without touching the rows again.
///
/// Column 0 is the constant; the first `free` columns are not penalised. The last row and column of each block's matrix
/// belong to the response.
pub(crate) struct BlockedNormal {
    free: usize,
    blocks: Vec<DMatrix<f64>>,
    total: DMatrix<f64>,
    scale: Vec<f64>,
}

impl BlockedNormal {
    /// Builds the equations from `columns` (the constant first) and `response` over all rows; `blocks` are row ranges that partition them.
    pub(crate) fn new(
        columns: &[DVector<f64>],
        free: usize,
        response: &DVector<f64>,
        blocks: &[std::ops::Range<usize>],
    ) -> Self {
        let size = columns.len() + 1;
        let of_block = |rows: &std::ops::Range<usize>| {
            let columns = columns.iter().chain([response]).map(|column| &column.as_slice()[rows.clone()]);
            gram(&columns.collect::<Vec<_>>())
        };
        let blocks: Vec<_> = blocks.iter().map(of_block).collect();
        let total = blocks.iter().fold(DMatrix::zeros(size, size), |sum, block| sum + block);
        let rows = total[(0, 0)];
        let variance = |j: usize| (total[(j, j)] / rows - (total[(0, j)] / rows).powi(2)).max(0.0);
        let scale = (0..size).map(|j| if j == 0 { 0.0 } else { variance(j).sqrt() }).collect();
        Self { free, blocks, total, scale }
    }

    /// Returns the ridge regression on `columns`, without the blocks of `left_out`; one weight per column. `ridge` is relative to each
    /// column's variance.
    pub(crate) fn fit(&self, columns: &[usize], ridge: f64, left_out: &[usize]) -> Option<DVector<f64>> {
        self.solve(&self.without(left_out), columns, ridge)
    }

    /// Returns the most probable weights of all columns, without the blocks of `left_out`. The penalised ones have a normal prior around
    /// zero with this precision, in units of the precision of a row.
    pub(crate) fn fit_normal(&self, precision: &DMatrix<f64>, left_out: &[usize]) -> Option<DVector<f64>> {
        let mut gram = self.without(left_out);
        let mut penalised = gram.view_mut((self.free, self.free), precision.shape());
        penalised += precision;
        self.solve(&gram, &(0..self.scale.len() - 1).collect::<Vec<_>>(), 0.0)
    }

    /// Returns the mean squared error on blocks left out in turn, each block's mean removed.
    pub(crate) fn cross_validate(&self, columns: &[usize], ridge: f64) -> Option<f64> {
        self.left_out_variance(columns, |block| self.fit(columns, ridge, &[block]))
    }

    /// Returns the same error for weights that `fit_without` fits without a block.
    pub(crate) fn left_out_variance(
        &self,
        columns: &[usize],
        fit_without: impl Fn(usize) -> Option<DVector<f64>>,
    ) -> Option<f64> {
        let mut sum = 0.0;
        for (b, block) in self.blocks.iter().enumerate() {
            sum += block_error(block, columns, &fit_without(b)?);
        }
        Some(sum / self.blocks.len() as f64)
    }

    fn without(&self, left_out: &[usize]) -> DMatrix<f64> {
        left_out.iter().fold(self.total.clone(), |rest, &block| rest - &self.blocks[block])
    }

    /// Returns the mean squared error over the rows of all blocks left out in turn, offsets included, for regressions that cannot absorb an
    /// offset.
    pub(crate) fn left_out_error(&self, columns: &[usize], ridge: f64) -> Option<f64> {
        let mut sum = 0.0;
        for (b, block) in self.blocks.iter().enumerate() {
            sum += residual_sums(block, columns, &self.fit(columns, ridge, &[b])?).1.max(0.0);
        }
        Some(sum / self.total[(0, 0)])
    }

    fn solve(&self, gram: &DMatrix<f64>, columns: &[usize], ridge: f64) -> Option<DVector<f64>> {
        let rows = gram[(0, 0)];
        let response = gram.ncols() - 1;
        let size = |i: usize| if self.scale[i] > 0.0 { self.scale[i] } else { 1.0 };
        let mut normal = DMatrix::from_fn(columns.len(), columns.len(), |a, b| {
            gram[(columns[a], columns[b])] / (size(columns[a]) * size(columns[b]))
        });
        for (a, &i) in columns.iter().enumerate() {
            if i >= self.free {
                normal[(a, a)] += ridge * rows;
            }
        }
        let right = DVector::from_iterator(columns.len(), columns.iter().map(|&i| gram[(i, response)] / size(i)));
        let solution = cholesky(normal)?.solve(&right);
        Some(DVector::from_iterator(columns.len(), columns.iter().zip(solution.iter()).map(|(&i, w)| w / size(i))))
    }
}

/// Returns the variance of the residual in a block; the filter's baseline absorbs a constant offset.
fn block_error(block: &DMatrix<f64>, columns: &[usize], weights: &DVector<f64>) -> f64 {
    let rows = block[(0, 0)];
    let (sum, squares) = residual_sums(block, columns, weights);
    (squares / rows - (sum / rows).powi(2)).max(0.0)
}

/// Returns the sum of the residuals in a block, and that of their squares.
fn residual_sums(block: &DMatrix<f64>, columns: &[usize], weights: &DVector<f64>) -> (f64, f64) {
    let response = block.ncols() - 1;
    let (mut sum, mut squares) = (block[(0, response)], block[(response, response)]);
    for (a, &i) in columns.iter().enumerate() {
        sum -= weights[a] * block[(0, i)];
        squares -= 2.0 * weights[a] * block[(i, response)];
        for (b, &j) in columns.iter().enumerate() {
            squares += weights[a] * weights[b] * block[(i, j)];
        }
    }
    (sum, squares)
}
