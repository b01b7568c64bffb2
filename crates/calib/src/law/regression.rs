use std::ops::Range;

use nalgebra::DVector;
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::enough::check;
use crate::law::blocked_normal::BlockedNormal;
use crate::law::design::{Regressors, StrainScale};
use crate::motion_stats::MotionStats;
use crate::order::median;
use crate::samples::Samples;

/// Number of contiguous blocks of each recording that are left out in turn.
pub(crate) const VALIDATION_BLOCKS: usize = 4;
/// Largest number of rows in a regression: residuals are correlated over seconds, so more rows add no information.
const MOST_ROWS: usize = 6000;
/// Number of passes that rescale recordings by their own R₀; each one squares the relative error of the one before.
const SCALING_PASSES: usize = 3;

/// The recordings as one regression.
pub(crate) struct LawRegression {
    pub recordings: Vec<RecordingRows>,
    blocks: Vec<Range<usize>>,
    pub scale: StrainScale,
    pub range: StrainRange<f64>,
    pub tau_bounds: (f64, f64),
}

pub(crate) struct RecordingRows {
    /// Square roots of the rows' weights.
    root_weights: DVector<f64>,
    pub regressors: Regressors,
    /// Rows with reading and strain, thinned to at most [`MOST_ROWS`] over all recordings.
    pub complete: Vec<usize>,
    reading: Vec<f64>,
}

/// The regression for given nonlinear parameters: columns, and the part that is subtracted from the reading.
pub(crate) struct Design {
    pub columns: Vec<DVector<f64>>,
    pub free: usize,
    pub offset: DVector<f64>,
}

impl Design {
    /// Returns the response of the design to these weights.
    pub(crate) fn fitted(&self, weights: &DVector<f64>) -> DVector<f64> {
        let weighted = self.columns.iter().zip(weights.iter());
        weighted.fold(self.offset.clone(), |sum, (column, weight)| sum + column * *weight)
    }
}

/// Weights of a fitted design, and R₀ of each recording.
pub(crate) struct Solution {
    pub weights: DVector<f64>,
    pub rest_readings: Vec<f64>,
    pub cross_validated: f64,
}

impl LawRegression {
    /// Makes a regression with rows of equal weight; see [`robust`](crate::law::robust_loss::robust).
    pub(crate) fn new(samples: &[Samples]) -> Result<Self, CalibrationError> {
        let (lower, upper) = check(samples)?;
        Ok(Self::scaled(samples, StrainScale::of(lower, upper), StrainRange { lower, upper }))
    }

    /// Makes a regression on the strain scale of other sensors, for laws that hold at least in a given range.
    pub(crate) fn on_scale(
        samples: &[Samples],
        scale: StrainScale,
        at_least: StrainRange<f64>,
    ) -> Result<Self, CalibrationError> {
        let (lower, upper) = check(samples)?;
        let range = StrainRange { lower: lower.min(at_least.lower), upper: upper.max(at_least.upper) };
        Ok(Self::scaled(samples, scale, range))
    }

    fn scaled(samples: &[Samples], scale: StrainScale, range: StrainRange<f64>) -> Self {
        let stride = samples.iter().map(Samples::len).sum::<usize>().div_ceil(MOST_ROWS);
        let recordings: Vec<RecordingRows> = samples
            .iter()
            .map(|samples| RecordingRows {
                root_weights: DVector::from_element(samples.len(), 1.0),
                regressors: Regressors::new(samples, &scale),
                complete: samples.complete_rows().step_by(stride).collect(),
                reading: samples.reading.to_vec(),
            })
            .collect();
        let mut blocks = Vec::new();
        let mut start = 0;
        for recording in &recordings {
            let rows = recording.complete.len();
            let edges: Vec<usize> = (0..=VALIDATION_BLOCKS).map(|b| start + b * rows / VALIDATION_BLOCKS).collect();
            blocks.extend(edges.windows(2).map(|edge| edge[0]..edge[1]));
            start += rows;
        }
        let tau_bounds = tau_bounds(samples);
        Self { recordings, blocks, scale, range, tau_bounds }
    }

    /// Sets the weights of the complete rows, in their order.
    pub(crate) fn set_weights(&mut self, weights: impl IntoIterator<Item = f64>) {
        let mut weights = weights.into_iter();
        for recording in &mut self.recordings {
            for (&k, weight) in recording.complete.iter().zip(&mut weights) {
                recording.root_weights[k] = weight.sqrt();
            }
        }
    }

    /// Returns the square roots of the weights of the complete rows.
    pub(crate) fn root_weights(&self) -> DVector<f64> {
        self.column(|recording| recording.root_weights.clone())
    }

    /// Returns the rows of each block in its own recording, from the first complete row to the start of the next block.
    pub(crate) fn block_rows(&self) -> Vec<Vec<Range<usize>>> {
        let of_recording = |recording: &RecordingRows| {
            let rows = recording.complete.len();
            let edge = |b: usize| {
                recording.complete.get(b * rows / VALIDATION_BLOCKS).copied().unwrap_or(recording.reading.len())
            };
            (0..VALIDATION_BLOCKS).map(|b| edge(b)..edge(b + 1)).collect()
        };
        self.recordings.iter().map(of_recording).collect()
    }

    /// Returns one column over the complete rows of all recordings.
    pub(crate) fn column(&self, mut of: impl FnMut(&RecordingRows) -> DVector<f64>) -> DVector<f64> {
        let mut values = Vec::with_capacity(self.blocks.last().map_or(0, |block| block.end));
        for recording in &self.recordings {
            let column = of(recording);
            values.extend(recording.complete.iter().map(|&k| column[k]));
        }
        DVector::from_vec(values)
    }

    /// Distributes values of the complete rows to the rows of each recording, NaN elsewhere.
    pub(crate) fn by_recording(&self, values: &DVector<f64>) -> Vec<Vec<f64>> {
        let mut values = values.iter();
        let spread = |recording: &RecordingRows| {
            let mut rows = vec![f64::NAN; recording.reading.len()];
            for &k in &recording.complete {
                rows[k] = values.next().copied().unwrap_or(f64::NAN);
            }
            rows
        };
        self.recordings.iter().map(spread).collect()
    }

    pub(crate) fn columns<const K: usize>(
        &self,
        of: impl Fn(&RecordingRows) -> [DVector<f64>; K],
    ) -> Vec<DVector<f64>> {
        (0..K).map(|j| self.column(|recording| of(recording)[j].clone())).collect()
    }

    /// Returns a column that is 1 in the rows of recording `r` and 0 elsewhere: every recording has an R₀ of its own.
    pub(crate) fn own_constant(&self, r: usize) -> DVector<f64> {
        let first = std::ptr::from_ref(&self.recordings[r]);
        self.column(|recording| {
            let value = f64::from(u8::from(std::ptr::eq(recording, first)));
            DVector::from_element(recording.reading.len(), value)
        })
    }

    /// Returns the readings over the R₀ of their recording.
    pub(crate) fn response(&self, rest_readings: &[f64]) -> DVector<f64> {
        let mut rests = rest_readings.iter();
        self.column(|recording| {
            let rest = rests.next().copied().unwrap_or(1.0);
            DVector::from_iterator(recording.reading.len(), recording.reading.iter().map(|r| r / rest))
        })
    }

    /// Converts values relative to the R₀ of each recording to units of its median reading.
    pub(crate) fn in_readings(&self, relative: &DVector<f64>, rest_readings: &[f64]) -> DVector<f64> {
        let mut rests = rest_readings.iter();
        let scale = self.column(|recording| {
            let share = rests.next().copied().unwrap_or(1.0) / recording.median_reading();
            DVector::from_element(recording.reading.len(), share)
        });
        relative.component_mul(&scale)
    }

    /// Returns the normal equations of a design.
    pub(crate) fn normal(&self, design: &Design, rest_readings: &[f64]) -> BlockedNormal {
        let root_weights = self.root_weights();
        let response = (self.response(rest_readings) - &design.offset).component_mul(&root_weights);
        let columns: Vec<DVector<f64>> =
            design.columns.iter().map(|column| column.component_mul(&root_weights)).collect();
        BlockedNormal::new(&columns, design.free, &response, &self.blocks)
    }

    pub(crate) fn median_readings(&self) -> Vec<f64> {
        self.recordings.iter().map(RecordingRows::median_reading).collect()
    }

    /// Fits a design without block `left_out` of every recording. R₀ multiplies everything, so each pass divides a
    /// recording by the R₀ of the pass before.
    pub(crate) fn solve(&self, design: &Design, ridge: f64, left_out: Option<usize>) -> Option<Solution> {
        let all: Vec<usize> = (0..design.columns.len()).collect();
        let left_out = self.left_out(left_out);
        let fitted = self.with_own_rests(design, |normal| normal.fit(&all, ridge, &left_out));
        let (weights, rest_readings, normal) = fitted?;
        Some(Solution { weights, rest_readings, cross_validated: normal.cross_validate(&all, ridge)? })
    }

    /// Returns the indices of the normal equations' blocks that together are one block of every recording.
    pub(crate) fn left_out(&self, block: Option<usize>) -> Vec<usize> {
        block.map_or(vec![], |block| (0..self.recordings.len()).map(|r| r * VALIDATION_BLOCKS + block).collect())
    }

    /// Returns the weights by `fit`, R₀ of each recording, and the normal equations relative to these R₀.
    pub(crate) fn with_own_rests(
        &self,
        design: &Design,
        fit: impl Fn(&BlockedNormal) -> Option<DVector<f64>>,
    ) -> Option<(DVector<f64>, Vec<f64>, BlockedNormal)> {
        let normal = |rest_readings: &[f64]| self.normal(design, rest_readings);
        let mut rest_readings: Vec<f64> = self.median_readings();
        for _ in 0..SCALING_PASSES {
            let weights = fit(&normal(&rest_readings))?;
            for (r, rest) in rest_readings.iter_mut().enumerate() {
                *rest *= weights[0] + if r == 0 { 0.0 } else { weights[r] };
            }
            if !rest_readings.iter().all(|rest| *rest > 0.0) {
                return None;
            }
        }
        let normal = normal(&rest_readings);
        Some((fit(&normal)?, rest_readings, normal))
    }
}

impl RecordingRows {
    pub(crate) fn median_reading(&self) -> f64 {
        median(self.complete.iter().map(|&k| self.reading[k])).unwrap_or(f64::NAN)
    }
}

/// Returns the range of time constants, from the pace of the motion (or three sampling intervals) to a quarter of the longest recording.
///
/// A branch faster than the motion cannot be distinguished from the dash-pot. A law with such a branch explains the recording better, but
/// its filter confuses stretching with releasing.
fn tau_bounds(samples: &[Samples]) -> (f64, f64) {
    let stats = MotionStats::new(samples);
    let intervals = samples.iter().map(|samples| samples.duration_s() / (samples.len() - 1) as f64);
    let shortest = stats.rate_time_s.max(3.0 * intervals.fold(0.0, f64::max));
    (shortest, (0.25 * stats.longest_s).max(8.0 * shortest))
}
