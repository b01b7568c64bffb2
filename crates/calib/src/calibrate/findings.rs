//! Quality of a calibration on held-out parts of the recordings, its calibrated range, and the limits of its accuracy.

use std::collections::BTreeMap;
use std::mem;
use std::sync::Arc;

use crate::CalibrationError;
use crate::baselines::{Baseline, fit_static_cubic, running_cubic};
use crate::calibrate::correction_fit::fit_correction;
use crate::calibrate::error_budget::{Direction, WrongDirection, error_budget};
use crate::calibrate::left_out::relative_changes;
use crate::calibrate::median_rest;
use crate::calibrate::scores::{ScoredRow, score_of_full_scale};
use crate::calibrate::unstated::{error_factor, unstated};
use crate::law::fit::CrossFit;
use crate::law::identifiability::Identifiability;
use crate::law::structure::LawFit;
use crate::motion_stats::MotionStats;
use crate::prior::CorrectionPrior;
use crate::samples::Samples;
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::fusion::Member;
use ohmstrain_sensor::{
    EstimatorKind, EstimatorParams, FilterParts, Findings, Learned, NoParameters, RecordingSummary, SensorError,
    TENTHS, Unstated,
};
use rayon::prelude::*;

/// Summarises the recordings of a calibration.
pub(crate) fn seen(recordings: &[Samples], range: StrainRange<f64>, stats: &MotionStats) -> RecordingSummary {
    let mut counts = [0_usize; TENTHS];
    for samples in recordings {
        for k in samples.complete_rows() {
            let share = (samples.strain[k] - range.lower) / range.span();
            counts[((share * TENTHS as f64) as usize).min(TENTHS - 1)] += 1;
        }
    }
    let rows: usize = counts.iter().sum();
    RecordingSummary {
        range,
        tenths: counts.map(|count| count as f64 / rows.max(1) as f64),
        quartile_speeds: stats.quartile_speeds,
        fastest_rate: stats.fastest_rate,
        longest_hold_s: stats.longest_hold_s,
        longest_s: stats.longest_s,
        rows,
    }
}

/// Inputs of the scores on held-out quarters.
pub(crate) struct Check<'a> {
    pub recordings: &'a [Samples<'a>],
    /// Number of full strokes in them.
    pub strokes: f64,
    pub fit: &'a CrossFit,
    pub kind: EstimatorKind,
    /// The filter that runs: the estimator itself, or the filter that it corrects.
    pub filter: EstimatorKind,
    /// Noise and motion by estimator; those of `filter` are used.
    pub estimators: &'a BTreeMap<EstimatorKind, EstimatorParams>,
    /// Prior on the correction from other sensors of the make.
    pub of_make: Option<&'a CorrectionPrior>,
}

/// Estimate in a row of a quarter by a fit to the other quarters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeftOutRow {
    /// The recording, counted from 0.
    pub recording: usize,
    /// The row of that recording, counted from 0.
    pub row: usize,
    /// True strain.
    pub truth: f64,
    /// The filter's strain.
    pub strain: f64,
    /// Its standard deviation, including the unstated error estimated on the other quarters.
    pub strain_sd: f64,
    /// The smoother's strain with its standard deviation, which includes its unstated error.
    pub smoothed: Member,
    /// The static cubic's strain.
    pub static_cubic: f64,
}

/// Scored rows of all recordings, one after the other.
#[derive(Default)]
struct Scored {
    rows: Vec<LeftOutRow>,
    filter: Vec<ScoredRow>,
    smoother: Vec<ScoredRow>,
    static_cubic: Vec<ScoredRow>,
    /// Direction of the body's motion, the estimated rate, and the error of the strain, for each row of the filter.
    directions: Vec<(Direction, f64, f64)>,
}

impl Scored {
    /// Appends rows, at later times.
    fn append(&mut self, next: Self) {
        let offset_s = self.filter.last().map_or(0.0, |row| row.time_s);
        let later = |row: ScoredRow| ScoredRow { time_s: offset_s + row.time_s, ..row };
        self.rows.extend(next.rows);
        self.filter.extend(next.filter.into_iter().map(later));
        self.smoother.extend(next.smoother.into_iter().map(later));
        self.static_cubic.extend(next.static_cubic.into_iter().map(later));
        self.directions.extend(next.directions);
    }

    /// Adds unstated errors to the standard deviations.
    fn widen(&mut self, unstated: Unstated) {
        for row in &mut self.rows {
            row.strain_sd = row.strain_sd.hypot(unstated.filter_sd);
            row.smoothed.sd = row.smoothed.sd.hypot(unstated.smoother_sd);
        }
        self.filter.iter_mut().for_each(|row| *row = row.with_unstated(unstated.filter_sd));
        self.smoother.iter_mut().for_each(|row| *row = row.with_unstated(unstated.smoother_sd));
    }

    fn wrong_direction(&self) -> WrongDirection {
        let mut wrong = WrongDirection::default();
        self.directions.iter().for_each(|(direction, rate, error)| wrong.see(*direction, *rate, *error));
        wrong
    }
}

/// Quality of a calibration on held-out quarters.
pub(crate) struct Checked {
    pub findings: Findings,
    /// Unstated errors of the estimators on them.
    pub unstated: Unstated,
    pub rows: Vec<LeftOutRow>,
}

impl Checked {
    /// True if the error of its filter is smaller than another's.
    pub(crate) fn filters_better_than(&self, other: &Self) -> bool {
        self.findings.filter.rmse < other.findings.filter.rmse
    }

    /// True if the error of its smoother is smaller than another's.
    pub(crate) fn smooths_better_than(&self, other: &Self) -> bool {
        let error = |checked: &Self| checked.findings.smoother.as_ref().map_or(f64::INFINITY, |smoother| smoother.rmse);
        error(self) < error(other)
    }

    /// Returns it with the smoother of another check of the same rows.
    pub(crate) fn smoothed_as(self, other: &Self) -> Self {
        let findings = Findings { smoother: other.findings.smoother, ..self.findings };
        let unstated = Unstated { smoother_sd: other.unstated.smoother_sd, ..self.unstated };
        let smoothed = |(row, other): (LeftOutRow, &LeftOutRow)| LeftOutRow { smoothed: other.smoothed, ..row };
        Self { findings, unstated, rows: self.rows.into_iter().zip(&other.rows).map(smoothed).collect() }
    }
}

/// Returns the unstated errors of the estimators in these quarters, with errors multiplied by `factor`.
fn unstated_in<'b>(blocks: impl Iterator<Item = &'b Scored>, factor: f64) -> Unstated {
    let (mut filter, mut smoother) = (Vec::new(), Vec::new());
    for block in blocks {
        filter.extend_from_slice(&block.filter);
        smoother.extend_from_slice(&block.smoother);
    }
    unstated(&filter, &smoother, factor)
}

/// Returns all rows. Those of each quarter include the unstated errors of the other quarters, so that its coverage is that of held-out
/// data.
fn widened(mut blocks: Vec<Scored>, factor: f64) -> Scored {
    let others = |block: usize| blocks.iter().enumerate().filter(move |(k, _)| *k != block).map(|(_, scored)| scored);
    let unstated: Vec<Unstated> = (0..blocks.len()).map(|block| unstated_in(others(block), factor)).collect();
    let mut scored = Scored::default();
    for (block, unstated) in blocks.iter_mut().zip(unstated) {
        block.widen(unstated);
        scored.append(mem::take(block));
    }
    scored
}

impl Check<'_> {
    /// Scores every quarter with the fit to the others; `None` if they cannot be estimated.
    pub(crate) fn checked(&self, seen: RecordingSummary, identifiability: &Option<Identifiability>) -> Option<Checked> {
        let blocks = self.blocks().ok()?;
        let factor = error_factor(self.strokes);
        let unstated = unstated_in(blocks.iter(), factor);
        let scored = widened(blocks, factor);
        let findings = Findings {
            filter: score_of_full_scale(&scored.filter)?,
            smoother: score_of_full_scale(&scored.smoother),
            static_cubic: score_of_full_scale(&scored.static_cubic)?,
            budget: error_budget(self.recordings, self.fit, &scored.wrong_direction()),
            seen,
            advice: identifiability.as_ref().map_or_else(Vec::new, |identifiability| identifiability.advice.clone()),
        };
        Some(Checked { findings, unstated, rows: scored.rows })
    }

    fn blocks(&self) -> Result<Vec<Scored>, CalibrationError> {
        let directions: Vec<Vec<Direction>> = self.recordings.iter().map(Direction::of_rows).collect();
        (0..self.fit.without_block.len()).into_par_iter().map(|block| self.scored_block(block, &directions)).collect()
    }

    fn scored_block(&self, block: usize, directions: &[Vec<Direction>]) -> Result<Scored, CalibrationError> {
        let (law, limits) = (&self.fit.without_block[block], self.fit.law.law.range);
        let masked: Vec<Vec<f64>> = self.recordings.iter().enumerate().map(|(r, s)| self.masked(r, s, block)).collect();
        let training: Vec<Samples> = self
            .recordings
            .iter()
            .zip(&masked)
            .map(|(samples, strain)| Samples { strain: strain.as_slice(), ..*samples })
            .collect();
        let cubic = fit_static_cubic(&training, limits)?;
        let (estimator, learned) = self.estimator_without(law, &training)?;
        let curve = cubic.curve(median_rest(&law.rest_readings)).filter(|_| self.kind == EstimatorKind::StaticCubic);
        let estimator = estimator.on_curve(curve);
        let mut scored = Scored::default();
        for (r, samples) in self.recordings.iter().enumerate() {
            let rows = self.fit.blocks[r][block].clone();
            let readings = relative_changes(samples.reading, law.rest_readings[r]);
            let failed = |row: usize, source| CalibrationError::Filter { time_s: samples.time_s[row], source };
            let mut filter = estimator.filter(learned.as_ref())?;
            let mut smoother = estimator.smoother(learned.as_ref())?;
            let smoothed = smoother.smooth(samples.time_s, &readings).map_err(|(row, e)| failed(row, e))?;
            let mut baseline = running_cubic(cubic);
            let mut of_recording = Scored::default();
            for k in 0..rows.end {
                filter.step(samples.time_s[k], readings[k]).map_err(|error| failed(k, error))?;
                let on_cubic = baseline.strain(samples.time_s[k], samples.reading[k]);
                let truth = samples.strain[k];
                if k < rows.start || !truth.is_finite() {
                    continue;
                }
                let time_s = samples.time_s[k] - samples.time_s[rows.start];
                let row = |strain: f64, sd: Option<f64>| ScoredRow { time_s, truth, strain, sd };
                let estimate = filter.output().estimate;
                let (strain, strain_sd) = (estimate.strain.mean, estimate.strain.sd());
                let smoothed = smoothed[k].estimate.strain;
                let smoothed = Member { strain: smoothed.mean, sd: smoothed.sd() };
                let left_out =
                    LeftOutRow { recording: r, row: k, truth, strain, strain_sd, smoothed, static_cubic: on_cubic };
                of_recording.rows.push(left_out);
                of_recording.filter.push(row(strain, Some(strain_sd)));
                if curve.is_none() {
                    of_recording.directions.push((directions[r][k], estimate.rate.mean, strain - truth));
                }
                of_recording.smoother.push(row(smoothed.strain, Some(smoothed.sd)));
                of_recording.static_cubic.push(row(on_cubic, None));
            }
            scored.append(of_recording);
        }
        Ok(scored)
    }

    /// Returns the strain of a recording, NaN within a block.
    fn masked(&self, recording: usize, samples: &Samples, block: usize) -> Vec<f64> {
        let mut strain = samples.strain.to_vec();
        strain[self.fit.blocks[recording][block].clone()].fill(f64::NAN);
        strain
    }

    /// Returns the recipe of filter and smoother under that law, and their correction, learned from the strains of `training` alone.
    fn estimator_without<'b>(
        &self,
        law: &'b LawFit,
        training: &[Samples],
    ) -> Result<(FilterParts<'b>, Option<Arc<Learned>>), CalibrationError> {
        let (kind, limits) = (self.filter, self.fit.law.law.range);
        let params = self.estimators.get(&kind).ok_or(SensorError::from(NoParameters { kind }))?;
        let recipe = FilterParts::of_law(kind, &law.law, *params, limits);
        let correction = if self.kind == EstimatorKind::Corrected {
            fit_correction(training, law, limits, (kind, recipe), self.of_make)?
        } else {
            None
        };
        Ok((recipe, correction.map(|correction| Learned::new(&correction, limits))))
    }
}
