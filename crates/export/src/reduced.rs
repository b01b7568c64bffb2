//! A learned correction with fewer rows, computed from the sensor's file alone, without learning again.
//!
//! The mean of a process with a long length scale is nearly quadratic within the range of its rows. Therefore the means are
//! replaced by a quadratic function and kernels of the most informative rows, fitted to the processes' own means. These are the
//! first rows, since a correction lists its inducing rows first, in the order of a pivoted Cholesky decomposition. Variances
//! use the kernels of fewer inducing rows; the others are projected onto them (Nyström), as all rows are projected already. The
//! process of simulated rows is left out.

use nalgebra::{DMatrix, DVector};
use ohmstrain_ekf::correction::{self, FILTER_INPUTS, OUTPUTS, kernel};
use ohmstrain_sensor::correction::{OwnedCorrection, OwnedProcess, OwnedTriangle};

use super::quadratic::{Fit, OwnedQuadratic};

type Row = [f64; FILTER_INPUTS];
type Correction = OwnedCorrection<f64, FILTER_INPUTS>;
type Process = OwnedProcess<f64, FILTER_INPUTS>;

/// Points of the fit of the means: the rows, points half-way to these nearest other rows, and points as far beyond the row.
const BETWEEN: [usize; 4] = [1, 2, 4, 8];
const BEYOND: [usize; 2] = [2, 5];
const AS_FAR: f64 = 0.7;
/// Weight of points with inputs mixed from several rows: within the range of the rows, but unlike any observed row.
const MIXED_WEIGHT: f64 = 0.03;
const MIXED: [usize; 2] = [1, 2];
/// Distance of the rows that inputs are mixed from; a prime.
const APART: usize = 17;
/// Jitter that keeps kernels of inducing rows regular; less than the processes' own.
const JITTER: f64 = 1e-8;

/// Choice between the two processes.
#[derive(Clone, Copy)]
enum Which {
    Direct,
    Residual,
}

impl Which {
    fn inputs(self, row: &Row) -> &[f64] {
        match self {
            Self::Direct => &row[OUTPUTS..],
            Self::Residual => row,
        }
    }

    /// Returns the index of the input on which the linear part of the kernel depends.
    fn first(self) -> usize {
        match self {
            Self::Direct => OUTPUTS,
            Self::Residual => 0,
        }
    }
}

/// Number of rows that a reduced correction keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowBudget {
    /// Rows for its means, beside a quadratic function.
    pub mean: usize,
    /// Rows for its variances.
    pub variance: usize,
}

/// Returns the correction with at most these rows, and the quadratic functions that replace the others; `None` if kernels are
/// singular.
pub fn reduced(full: &Correction, to: RowBudget) -> Option<(Correction, [OwnedQuadratic; 2])> {
    let inducing = full.direct.explained.side().min(full.residual.explained.side());
    let rows = to.mean.max(to.variance).min(inducing).max(1);
    let to = RowBudget { mean: rows, variance: to.variance.clamp(1, rows) };
    let points = points(&full.rows);
    let (direct, of_direct) = process(&full.direct, Which::Direct, &full.rows, &points, to)?;
    let (residual, of_residual) = process(&full.residual, Which::Residual, &full.rows, &points, to)?;
    let rows = full.rows[..rows].iter().copied().collect();
    Some((Correction { rows, direct, residual, simulated: None, ..full.clone() }, [of_direct, of_residual]))
}

fn process(
    full: &Process,
    which: Which,
    rows: &[Row],
    points: &[(Row, f64)],
    to: RowBudget,
) -> Option<(Process, OwnedQuadratic)> {
    let at: Vec<&[f64]> = points.iter().map(|(row, _)| which.inputs(row)).collect();
    let weights: Vec<f64> = points.iter().map(|(_, weight)| *weight).collect();
    let in_points: Vec<&Row> = points.iter().map(|(row, _)| row).collect();
    let all: Vec<&Row> = rows.iter().collect();
    let kernels = kernels(full, which, &in_points, &all);
    let means = &kernels * DVector::from_column_slice(&full.weights);
    let fit = Fit::new(&at, &kernels.columns(0, to.mean).into_owned(), &means, &weights)?;
    let explained = explained(full, which, &all, to.variance)?;
    let numbers = correction::Process { mean: full.numbers.mean + fit.constant, ..full.numbers };
    let process = Process { weights: fit.weights, explained, numbers };
    Some((process, fit.quadratic))
}

/// Computes the kernels of two lists of rows.
fn kernels(of: &Process, which: Which, a: &[&Row], b: &[&Row]) -> DMatrix<f64> {
    let first = which.first();
    DMatrix::from_fn(a.len(), b.len(), |i, j| {
        let apart = a[i].iter().zip(b[j]).map(|(a, b)| (a - b).powi(2));
        let sum = apart.zip(of.numbers.relevance).map(|(square, relevance)| square * relevance).sum();
        kernel(sum, a[i][first] * b[j][first])
    })
}

/// Returns the triangle of the variance that the first few inducing rows explain.
fn explained(full: &Process, which: Which, rows: &[&Row], few: usize) -> Option<OwnedTriangle<f64>> {
    let inducing = full.explained.side();
    let triangle = DMatrix::from_row_iterator(inducing, inducing, full.explained.rows().into_iter().flatten());
    let among = kernels(full, which, &rows[..few], &rows[..few]) + DMatrix::identity(few, few) * JITTER;
    let with_others = kernels(full, which, &rows[..few], &rows[..inducing]);
    let projection = among.cholesky()?.solve(&with_others).transpose();
    let triangle = (triangle * projection).qr().r();
    Some(OwnedTriangle::new(few, |i, j| triangle[(i, j)]))
}

/// Returns the points at which the means are fitted, with their weights.
fn points(rows: &[Row]) -> Vec<(Row, f64)> {
    let range: [(f64, f64); FILTER_INPUTS] = std::array::from_fn(|i| {
        let column = rows.iter().map(|row| row[i]);
        (column.clone().fold(f64::INFINITY, f64::min), column.fold(f64::NEG_INFINITY, f64::max))
    });
    let toward = |a: &Row, b: &Row, share: f64| -> Row {
        std::array::from_fn(|i| (a[i] + share * (b[i] - a[i])).clamp(range[i].0, range[i].1))
    };
    let mut points = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        let nearest = nearest(rows, row);
        let other = |rank: &usize| &rows[nearest[*rank % nearest.len()]];
        points.push((*row, 1.0));
        points.extend(BETWEEN.iter().map(|rank| (toward(row, other(rank), 0.5), 1.0)));
        points.extend(BEYOND.iter().map(|rank| (toward(row, other(rank), -AS_FAR), 1.0)));
        for apart in MIXED {
            let mixed = std::array::from_fn(|i| rows[(k + apart * (i + 1) * APART) % rows.len()][i]);
            points.extend([(mixed, MIXED_WEIGHT), (toward(row, &mixed, 0.5), MIXED_WEIGHT)]);
        }
    }
    points
}

/// Returns all rows, the nearest first.
fn nearest(rows: &[Row], to: &Row) -> Vec<usize> {
    let square = |k: usize| -> f64 { rows[k].iter().zip(to).map(|(a, b)| (a - b).powi(2)).sum() };
    let mut order: Vec<(f64, usize)> = (0..rows.len()).map(|k| (square(k), k)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    order.into_iter().map(|(_, k)| k).collect()
}
