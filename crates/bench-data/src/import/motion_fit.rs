use nalgebra::{SMatrix, SVector};

use crate::order::typical_step;
use crate::segment::typical_rate_of;

/// Regressors and a constant.
const PARAMETERS: usize = 8;
/// Most rows of the grid that the reference is put on.
const MOST_MOTION_ROWS: f64 = 20_000.0;
/// Most readings that take part.
const MOST_READINGS: f64 = 1500.0;
/// What is slower than this share of the recording is taken out in any case.
const SLOW_SHARE: f64 = 1.0 / 6.0;
/// Fewest rows that say something.
const FEWEST: usize = 40;

type Regressors = SVector<f64, { PARAMETERS - 1 }>;
type Row = SVector<f64, PARAMETERS>;

/// What a reference says of readings, on a grid of its own clock, without what is slow.
pub(crate) struct Motion {
    start_s: f64,
    step_s: f64,
    rows: Vec<Regressors>,
    /// Time of a full stretch at the typical rate, s.
    pub stretch_s: f64,
    slow_s: f64,
}

impl Motion {
    /// What is slower than `slow` full stretches is taken out.
    pub(crate) fn new((times, values): (&[f64], &[f64]), slow: f64) -> Option<Self> {
        let (times, values) = known(times, values);
        let step = typical_step(&times)?;
        let (start_s, end_s) = (*times.first()?, *times.last()?);
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
        let stretch_s = (high - low) / typical_rate_of(&times, &values);
        if times.len() < FEWEST || !(stretch_s > 0.0 && stretch_s.is_finite()) {
            return None;
        }
        let slow_s = (slow * stretch_s).min(SLOW_SHARE * (end_s - start_s));
        let step_s = step.max((end_s - start_s) / MOST_MOTION_ROWS);
        let grid = on_grid(&times, &values, step_s);
        let scaled: Vec<f64> = grid.iter().map(|value| 2.0 * (value - low) / (high - low) - 1.0).collect();
        let mut rows = regressors(&scaled, step_s, stretch_s);
        take_out_slow(&mut rows, (slow_s / step_s) as usize);
        Some(Self { start_s, step_s, rows, stretch_s, slow_s })
    }

    pub(crate) fn span(&self) -> (f64, f64) {
        (self.start_s, self.start_s + self.step_s * (self.rows.len() - 1) as f64)
    }

    /// Share of the variance that has no counterpart at an offset: of the readings beyond the reference, or of the reference beyond the
    /// readings, whichever is less.
    pub(crate) fn left_out(&self, pull: &Pull, offset_s: f64) -> f64 {
        let ((first_s, last_s), (start_s, end_s)) = (self.span(), pull.span());
        let share = |all: f64, inside: f64| if all > 0.0 { 1.0 - inside / all } else { 0.0 };
        let is_known = |time_s: f64| (first_s..=last_s).contains(&(time_s - offset_s));
        let squares = |is_inside: bool| -> f64 {
            let rows = pull.rows.iter().filter(|(time_s, _)| !is_inside || is_known(*time_s));
            rows.map(|(_, value)| value * value).sum()
        };
        let is_read = |i: usize| (start_s..=end_s).contains(&(self.start_s + self.step_s * i as f64 + offset_s));
        let of_reference = |is_inside: bool| -> f64 {
            let rows = self.rows.iter().enumerate().filter(|(i, _)| !is_inside || is_read(*i));
            rows.map(|(_, row)| row[0] * row[0]).sum()
        };
        share(squares(false), squares(true)).min(share(of_reference(false), of_reference(true)))
    }

    /// The regressors at a time of the reference's clock; `None` outside of it, or where its ends disturb them.
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

/// Powers of the reference, and its movements through two low-passes each, with and without their sign.
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

/// Readings without what is slow.
pub(crate) struct Pull {
    rows: Vec<(f64, f64)>,
}

impl Pull {
    pub(crate) fn new((times, values): (&[f64], &[f64]), motion: &Motion) -> Option<Self> {
        let (times, values) = known(times, values);
        let (start_s, end_s) = (*times.first()?, *times.last()?);
        let step_s = typical_step(&times)?.max((end_s - start_s) / MOST_MOTION_ROWS);
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

    pub(crate) fn span(&self) -> (f64, f64) {
        (self.rows[0].0, self.rows[self.rows.len() - 1].0)
    }

    /// Normal equations at an offset, in blocks of neighbours.
    pub(crate) fn blocks(&self, motion: &Motion, offset_s: f64, blocks: usize) -> Blocks {
        let mut out = vec![Sums::default(); blocks];
        for (i, (time_s, value)) in self.rows.iter().enumerate() {
            if let Some(regressors) = motion.at(time_s - offset_s) {
                out[i * blocks / self.rows.len()].add(&regressors.push(1.0), *value);
            }
        }
        Blocks(out)
    }
}

/// Normal equations of a regression, block by block.
pub(crate) struct Blocks(Vec<Sums>);

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

    fn join(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.matrix += other.matrix;
        self.vector += other.vector;
        self.sum += other.sum;
        self.square += other.square;
        self
    }

    /// Coefficients of least squares, with a ridge that keeps regressors of no variance from dividing by zero.
    fn solve(&self) -> Option<Row> {
        let ridge = SMatrix::from_diagonal_element(1e-9 * self.matrix.trace());
        (self.count > 2.0 * PARAMETERS as f64)
            .then(|| (self.matrix + ridge).cholesky())?
            .map(|factor| factor.solve(&self.vector))
    }

    fn residual(&self, coefficients: &Row) -> f64 {
        self.square - 2.0 * coefficients.dot(&self.vector) + coefficients.dot(&(self.matrix * coefficients))
    }
}

impl Blocks {
    fn total(&self, left_out: Option<usize>) -> Sums {
        let kept = self.0.iter().enumerate().filter(|(block, _)| Some(*block) != left_out);
        kept.fold(Sums::default(), |total, (_, block)| total.join(block))
    }

    /// Share of the variance that stays unexplained; NaN if there is too little in common.
    pub(crate) fn unexplained(&self, left_out: Option<usize>) -> f64 {
        let total = self.total(left_out);
        let Some(coefficients) = total.solve().filter(|_| total.count >= FEWEST as f64) else { return f64::NAN };
        total.residual(&coefficients) / (total.square - total.sum * total.sum / total.count)
    }

    /// Mean square of what stays unexplained, relative to all of the variance, in each block.
    pub(crate) fn by_block(&self) -> Vec<f64> {
        let total = self.total(None);
        let variance = total.square / total.count;
        let Some(coefficients) = total.solve() else { return Vec::new() };
        self.0.iter().map(|block| block.residual(&coefficients) / block.count / variance).collect()
    }
}

/// What is known of a series.
fn known(times: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    times.iter().zip(values).filter(|(_, value)| value.is_finite()).map(|(time, value)| (*time, *value)).unzip()
}

/// A series at even steps, by straight lines.
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
