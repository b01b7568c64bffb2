use nalgebra::{SMatrix, SVector};

use crate::motion_stats::{moving_mean, strokes};
use crate::order::extent;
use crate::samples::usual_step_s;

/// Number of regressors, the constant included.
const PARAMETERS: usize = 8;
/// Largest number of rows on the reference's grid.
const MOST_MOTION_ROWS: f64 = 20_000.0;
/// Largest number of readings used.
const MOST_READINGS: f64 = 1500.0;
/// Longest window of the high-pass, as a fraction of the recording.
const SLOW_SHARE: f64 = 1.0 / 6.0;
/// Least number of rows for a regression.
const FEWEST: usize = 40;
/// Number of blocks of consecutive rows that are left out in turn.
pub(super) const BLOCKS: usize = 10;
/// Ridge of the regression, relative to each regressor's square: a held-out block may contain values that others do not.
const RIDGE: f64 = 1e-4;

type Regressors = SVector<f64, { PARAMETERS - 1 }>;
type Row = SVector<f64, PARAMETERS>;

/// High-passed regressors from a reference, on a grid of its own clock.
pub(super) struct ReferenceRegressors {
    start_s: f64,
    step_s: f64,
    rows: Vec<Regressors>,
    /// Path length from the first row to each, in full strokes.
    strokes: Vec<f64>,
    /// Time of a full stretch at the typical rate, s.
    pub stretch_s: f64,
    slow_s: f64,
}

impl ReferenceRegressors {
    /// Computes the regressors of a reference; the window of the high-pass is `slow` full stretches.
    pub(super) fn new((times, values): (&[f64], &[f64]), slow: f64) -> Option<Self> {
        let (times, values) = known(times, values);
        let step = step_s(&times)?;
        let (start_s, end_s) = (*times.first()?, *times.last()?);
        let (low, high) = extent(values.iter().copied());
        let step_s = step.max((end_s - start_s) / MOST_MOTION_ROWS);
        let grid = on_grid(&times, &values, step_s);
        let stretch_s = (high - low) / typical_rate(&grid, step_s);
        if times.len() < FEWEST || !(stretch_s > 0.0 && stretch_s.is_finite()) {
            return None;
        }
        let slow_s = (slow * stretch_s).min(SLOW_SHARE * (end_s - start_s));
        let scaled: Vec<f64> = grid.iter().map(|value| 2.0 * (value - low) / (high - low) - 1.0).collect();
        let mut rows = regressors(&scaled, step_s, stretch_s);
        take_out_slow(&mut rows, (slow_s / step_s) as usize);
        Some(Self { start_s, step_s, rows, strokes: strokes(&scaled, 2.0), stretch_s, slow_s })
    }

    pub(super) fn span(&self) -> (f64, f64) {
        (self.start_s, self.start_s + self.step_s * (self.rows.len() - 1) as f64)
    }

    /// Returns the smallest and the largest lag, s, at which readings over the same time span overlap with `least` strokes; `None` if there
    /// are fewer.
    pub(super) fn lags_with_strokes(&self, least: f64) -> Option<(f64, f64)> {
        let all = *self.strokes.last()?;
        let rows_before = |way: f64| self.strokes.partition_point(|strokes| *strokes < way);
        let early = self.strokes.len().checked_sub(rows_before(least) + 1)?;
        let late = self.strokes.partition_point(|strokes| *strokes <= all - least).checked_sub(1)?;
        Some((-self.step_s * early as f64, self.step_s * late as f64))
    }

    /// Returns the regressors at a time of the reference's clock; `None` outside of it, or near its ends.
    fn at(&self, time_s: f64) -> Option<Regressors> {
        let place = (time_s - self.start_s) / self.step_s;
        let margin = 0.5 * self.slow_s / self.step_s;
        if !(place >= margin && place + margin < (self.rows.len() - 1) as f64) {
            return None;
        }
        let share = place.fract();
        let row = place as usize;
        Some(self.rows[row] * (1.0 - share) + self.rows[row + 1] * share)
    }
}

/// Returns powers of the reference, and its movements through two low-passes each, with and without their sign.
fn regressors(scaled: &[f64], step_s: f64, stretch_s: f64) -> Vec<Regressors> {
    let keep = [stretch_s, 8.0 * stretch_s].map(|tau| (-step_s / tau).exp());
    let mut branches = [0.0; 4];
    let mut before = scaled.first().copied().unwrap_or(0.0);
    let rows = scaled.iter().map(|&x| {
        let moved = x - before;
        before = x;
        for (i, branch) in branches.iter_mut().enumerate() {
            *branch = *branch * keep[i / 2] + if i % 2 == 0 { moved } else { moved.abs() };
        }
        Regressors::from([x, x * x, x * x * x, branches[0], branches[1], branches[2], branches[3]])
    });
    rows.collect()
}

/// Subtracts the mean of a window around each row, narrower at the ends.
fn take_out_slow<const N: usize>(rows: &mut [SVector<f64, N>], window: usize) {
    let half = window / 2;
    let mut sums = vec![SVector::<f64, N>::zeros()];
    for row in rows.iter() {
        sums.push(sums[sums.len() - 1] + row);
    }
    let count = rows.len();
    for (i, row) in rows.iter_mut().enumerate() {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(count));
        *row -= (sums[to] - sums[from]) / (to - from) as f64;
    }
}

/// Readings without their slow changes.
pub(super) struct Pull {
    rows: Vec<(f64, f64)>,
}

impl Pull {
    pub(super) fn new((times, values): (&[f64], &[f64]), motion: &ReferenceRegressors) -> Option<Self> {
        let (times, values) = known(times, values);
        let (start_s, end_s) = (*times.first()?, *times.last()?);
        let step_s = self::step_s(&times)?.max((end_s - start_s) / MOST_MOTION_ROWS);
        let mut grid: Vec<SVector<f64, 1>> =
            on_grid(&times, &values, step_s).into_iter().map(|x| SVector::from([x])).collect();
        let window = (motion.slow_s / step_s) as usize;
        take_out_slow(&mut grid, window);
        let every = ((end_s - start_s) / step_s / MOST_READINGS).ceil().max(1.0) as usize;
        let inside = grid.len().checked_sub(window / 2)?;
        let rows: Vec<(f64, f64)> =
            (window / 2..inside).step_by(every).map(|i| (start_s + i as f64 * step_s, grid[i][0])).collect();
        (rows.len() >= FEWEST).then_some(Self { rows })
    }

    pub(super) fn span(&self) -> (f64, f64) {
        (self.rows[0].0, self.rows[self.rows.len() - 1].0)
    }

    /// Fits the regression at a lag of the reference; `None` if there is too little overlap.
    pub(super) fn fit(&self, motion: &ReferenceRegressors, lag_s: f64) -> Option<Fit> {
        let known = self.rows.iter().filter_map(|(time_s, value)| Some((motion.at(time_s + lag_s)?.push(1.0), *value)));
        let rows: Vec<(Row, f64)> = known.collect();
        if rows.len() < FEWEST {
            return None;
        }
        let mut blocks = vec![Sums::default(); BLOCKS];
        rows.iter().enumerate().for_each(|(i, (row, value))| blocks[i * BLOCKS / rows.len()].add(row, *value));
        let total = blocks.iter().fold(Sums::default(), |total, block| total.with(block, 1.0));
        let square = total.square - total.sum * total.sum / total.count;
        let error =
            |block| Some(total.clone().with(block, -1.0).solve().map(|weights| block.residual(&weights))? / square);
        let by_block: Vec<f64> = blocks.iter().map(error).collect::<Option<_>>()?;
        let ((r0, r1), (s0, s1)) = (self.span(), motion.span());
        let most = (self.rows.len() as f64).min((s1 - s0 - motion.slow_s) / (r1 - r0) * (self.rows.len() - 1) as f64);
        Some(Fit { unexplained: by_block.iter().sum(), by_block, overlap: (rows.len() as f64 / most).min(1.0) })
    }
}

/// Residual of the regression at one lag.
pub(super) struct Fit {
    /// Squared error on held-out blocks, as a fraction of the readings' variance.
    pub unexplained: f64,
    /// Residual of each block.
    by_block: Vec<f64>,
    /// Fraction of the largest possible number of rows that overlap at this lag.
    pub overlap: f64,
}

impl Fit {
    /// Returns the unexplained fraction without a block.
    pub(super) fn without(&self, left_out: Option<usize>) -> f64 {
        self.unexplained - left_out.map_or(0.0, |block| self.by_block[block])
    }
}

/// Normal equations of a regression.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    vector: Row,
    sum: f64,
    square: f64,
}

impl Sums {
    fn add(&mut self, row: &Row, value: f64) {
        self.count += 1.0;
        self.matrix += row * row.transpose();
        self.vector += row * value;
        self.sum += value;
        self.square += value * value;
    }

    /// Adds the rows of another sum, or removes them (`sign` -1).
    fn with(mut self, other: &Self, sign: f64) -> Self {
        self.count += sign * other.count;
        self.matrix += other.matrix * sign;
        self.vector += other.vector * sign;
        self.sum += sign * other.sum;
        self.square += sign * other.square;
        self
    }

    fn solve(&self) -> Option<Row> {
        let least = 1e-9 * self.matrix.trace();
        let ridge = SMatrix::from_diagonal(
            &self.matrix.diagonal().map(|square| RIDGE * square.max(least) + 1e-12 * self.count),
        );
        (self.count > 2.0 * PARAMETERS as f64)
            .then(|| (self.matrix + ridge).cholesky())?
            .map(|factor| factor.solve(&self.vector))
    }

    fn residual(&self, coefficients: &Row) -> f64 {
        let products = coefficients.dot(&(self.matrix * coefficients));
        (self.square - 2.0 * coefficients.dot(&self.vector) + products).max(0.0)
    }
}

/// Returns the usual step of times, s.
fn step_s(times: &[f64]) -> Option<f64> {
    Some(usual_step_s([times].into_iter())).filter(|step| *step > 0.0)
}

/// Returns the mean speed along the path, smoothed, because a reference's noise is larger than its steps; holds do not count.
fn typical_rate(grid: &[f64], step_s: f64) -> f64 {
    let smooth = moving_mean(grid);
    let ways = smooth.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let (squares, sum) = ways.fold((0.0, 0.0), |(squares, sum), way| (squares + way * way, sum + way));
    squares / sum / step_s
}

/// Returns the known values of a series.
fn known(times: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    times.iter().zip(values).filter(|(_, value)| value.is_finite()).map(|(time, value)| (*time, *value)).unzip()
}

/// Interpolates a series linearly at even steps.
fn on_grid(times: &[f64], values: &[f64], step_s: f64) -> Vec<f64> {
    let (Some(start), Some(end)) = (times.first(), times.last()) else { return Vec::new() };
    let mut next = 1;
    let at = |i: usize| {
        let time = start + i as f64 * step_s;
        while next + 1 < times.len() && times[next] < time {
            next += 1;
        }
        let share = (time - times[next - 1]) / (times[next] - times[next - 1]);
        values[next - 1] + share.clamp(0.0, 1.0) * (values[next] - values[next - 1])
    };
    (0..=((end - start) / step_s) as usize).map(at).collect()
}
