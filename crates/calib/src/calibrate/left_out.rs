use std::ops::Range;

use ohmstrain_ekf::{Gaussian, Reading};
use ohmstrain_model::StrainRange;
use rayon::prelude::*;

use crate::law::fit::CrossFit;
use crate::samples::Samples;
use ohmstrain_sensor::{FilterParts, LawParams};

/// Standard deviation assumed for every reference, as a fraction of the strain's range; greater precision does not improve the score.
pub(crate) const REFERENCE_SD: f64 = 0.005;

/// The recordings, block by block, each with the law that was fitted without it.
///
/// Residuals of a law that has seen the block are too small. A filter tuned on them would trust its law more than is justified elsewhere.
pub(crate) struct LeftOut<'a> {
    runs: Vec<Run<'a>>,
    limits: StrainRange<f64>,
}

/// Function that builds the parts of a filter for a law fitted without a block.
pub(crate) type Build<'a> = dyn Fn(Fold<'_>) -> FilterParts<'_> + Sync + 'a;

/// A law that was fitted without a block.
#[derive(Clone, Copy)]
pub(crate) struct Fold<'a> {
    pub law: &'a LawParams,
    /// R₀ of that law in the recording; readings are relative to it.
    pub rest_reading: f64,
}

/// Predicted fall of a reading, by a law that has not seen it.
pub(crate) struct PredictedFall {
    pub recording: usize,
    pub row: usize,
    /// Predicted fall, relative to R₀.
    pub predicted: f64,
    /// R₀ of that law.
    pub rest_reading: f64,
}

/// One recording up to the end of the block that its law has not seen.
struct Run<'a> {
    fold: Fold<'a>,
    recording: usize,
    time_s: Vec<f64>,
    /// Readings relative to the R₀ of that law.
    reading: Vec<Option<Reading<f64>>>,
    strain: Vec<f64>,
    /// Standard deviations of the true strains.
    strain_sd: Vec<f64>,
    block: Range<usize>,
}

/// A true strain with its standard deviation.
#[derive(Clone, Copy)]
struct Truth {
    strain: f64,
    sd: f64,
}

impl Truth {
    /// Returns the error of an estimate in units of its standard deviation. The reference's error may have been learned with the strain,
    /// and then the difference does not show it; it is added in quadrature.
    fn deviation(self, strain: Gaussian<f64>) -> f64 {
        (strain.mean - self.strain).hypot(self.sd) / strain.sd()
    }
}

impl Run<'_> {
    fn truth(&self, row: usize) -> Truth {
        Truth { strain: self.strain[row], sd: self.strain_sd[row] }
    }
}

impl<'a> LeftOut<'a> {
    /// Takes every `stride`-th row. The model is continuous in time, so the same parameters fit any sampling.
    pub(crate) fn new(samples: &[Samples], fit: &'a CrossFit, limits: StrainRange<f64>, stride: usize) -> Self {
        let mut runs = Vec::new();
        for (block, law) in fit.without_block.iter().enumerate() {
            for (recording, samples) in samples.iter().enumerate() {
                let pick = |values: &[f64]| values.iter().copied().step_by(stride).collect::<Vec<f64>>();
                let rows = &fit.blocks[recording][block];
                let fold = Fold { law: &law.law, rest_reading: law.rest_readings[recording] };
                runs.push(Run {
                    fold,
                    recording,
                    time_s: pick(samples.time_s),
                    reading: relative_changes(&pick(samples.reading), fold.rest_reading),
                    strain: pick(samples.strain),
                    strain_sd: (0..samples.len()).step_by(stride).map(|k| samples.sd_of_strain(k)).collect(),
                    block: rows.start.div_ceil(stride)..rows.end.div_ceil(stride),
                });
            }
        }
        Self { runs, limits }
    }

    /// Returns the mean negative log density of the true strain under the filter, with strain in units of its range. Infinite if the filter
    /// fails.
    pub(crate) fn score(&self, build: &Build) -> f64 {
        let span = self.limits.span();
        let terms = self.of_rows(build, |strain, truth| {
            let variance = (strain.variance + truth.sd * truth.sd) / (span * span) + REFERENCE_SD * REFERENCE_SD;
            let error = (strain.mean - truth.strain) / span;
            0.5 * (error * error / variance + variance.ln())
        });
        let Some(terms) = terms else { return f64::INFINITY };
        let (sum, count) = terms.iter().flatten().fold((0.0, 0_usize), |(sum, count), term| (sum + term, count + 1));
        sum / count.max(1) as f64
    }

    /// Returns the filter's errors in units of their standard deviation, block by block; `None` if it fails.
    pub(crate) fn filtered_deviations(&self, build: &Build) -> Option<Vec<Vec<f64>>> {
        self.of_rows(build, |strain, truth| truth.deviation(strain))
    }

    /// Returns the same for the smoother of whole recordings.
    pub(crate) fn smoothed_deviations(&self, build: &Build) -> Option<Vec<Vec<f64>>> {
        let of_run = |run: &Run| {
            let mut smoother = build(run.fold).smoother(None).ok()?;
            let smoothed = smoother.smooth(&run.time_s, &run.reading).ok()?;
            let known = run.block.clone().filter(|&k| run.strain[k].is_finite());
            Some(known.map(|k| run.truth(k).deviation(smoothed[k].estimate.strain)).collect())
        };
        self.of_runs(of_run)
    }

    /// Returns the filter's predictions of the fall of the readings, in the given `rows` of each recording, in order; `None` if it fails.
    /// Valid only at a stride of 1.
    pub(crate) fn falls(&self, build: &Build, rows: &[Vec<usize>]) -> Option<Vec<PredictedFall>> {
        let mut falls = Vec::new();
        for run in &self.runs {
            let mut filter = build(run.fold).filter(None).ok()?;
            for k in 0..run.block.end {
                filter.step(run.time_s[k], run.reading[k]).ok()?;
                if k >= run.block.start && rows[run.recording].binary_search(&k).is_ok() {
                    let predicted = filter.output().estimate.still_relaxes.mean;
                    falls.push(PredictedFall {
                        recording: run.recording,
                        row: k,
                        predicted,
                        rest_reading: run.fold.rest_reading,
                    });
                }
            }
        }
        Some(falls)
    }

    /// Applies `of` to the runs, the longest first, so that no long run starts last. Results are in the order of the runs.
    fn of_runs<X: Send>(&self, of: impl Fn(&Run) -> Option<X> + Sync) -> Option<Vec<X>> {
        let mut backwards: Vec<X> = self.runs.par_iter().rev().map(&of).collect::<Option<_>>()?;
        backwards.reverse();
        Some(backwards)
    }

    /// Applies `of` to estimate and true strain in every row of every block. For each block, the filter runs from the first row of the
    /// recording to the end of the block. Returns `None` if it fails.
    fn of_rows(&self, build: &Build, of: impl Fn(Gaussian<f64>, Truth) -> f64 + Sync) -> Option<Vec<Vec<f64>>> {
        let of_run = |run: &Run| {
            let mut filter = build(run.fold).filter(None).ok()?;
            let mut rows = Vec::with_capacity(run.block.len());
            for k in 0..run.block.end {
                filter.step(run.time_s[k], run.reading[k]).ok()?;
                if k >= run.block.start && run.strain[k].is_finite() {
                    rows.push(of(filter.strain(), run.truth(k)));
                }
            }
            Some(rows)
        };
        self.of_runs(of_run)
    }
}

/// Returns readings over R₀ minus 1; `None` where missing.
pub(crate) fn relative_changes(reading: &[f64], rest_reading: f64) -> Vec<Option<Reading<f64>>> {
    reading.iter().map(|r| r.is_finite().then(|| Reading::from(r / rest_reading - 1.0))).collect()
}
