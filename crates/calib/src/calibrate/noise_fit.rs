use ohmstrain_ekf::Settling;
use ohmstrain_ekf::live::news;
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::calibrate::left_out::{Fold, LeftOut};
use crate::calibrate::settling::LongHolds;
use crate::law::fit::CrossFit;
use crate::motion_stats::{MotionStats, root_mean_square};
use crate::optimise::{Ends, nelder_mead};
use crate::prior::EstimatorPrior;
use crate::samples::{Samples, usual_step_s};
use crate::sd_scale::sd_scale;
use ohmstrain_sensor::{EstimatorKind, EstimatorParams, FilterParts, MotionParams, NoiseParams, PhaseParams};

/// Pull toward the starting values, per squared step of a log-parameter; keeps the score of a single recording from running away.
const REGULARISATION: f64 = 1e-2;
/// Settings of a local search.
#[derive(Clone, Copy)]
pub(crate) struct Search {
    /// Side of the first simplex in log-parameters.
    side: f64,
    /// Number of steps of the simplex.
    steps: u64,
    /// Number of rows to which the recordings are thinned.
    rows: usize,
    /// Factor on the longest step of sign-split. Thinned rows are far apart, and would otherwise be divided into as many steps as all rows.
    step_factor: f64,
    /// Gain of the score, a mean log density of strain, in three evaluations per parameter, below which the search ends.
    least_gain: f64,
}

/// Search that measures the quality of an estimator with a law.
pub(crate) const SURVEY: Search = Search { side: 0.7, steps: 100, rows: 500, step_factor: 4.0, least_gain: 0.0 };

/// Search that measures the quality with another law, starting from the result with the law before.
const RESURVEY: Search = Search { side: 0.4, steps: 25, rows: 500, step_factor: 4.0, least_gain: 0.0 };
/// Search that refines the best survey.
pub(crate) const REFINEMENT: Search = Search { side: 0.3, steps: 45, rows: 1500, step_factor: 1.0, least_gain: 0.0 };

/// Search for a further filter, from what is known of the first. Its steps are not lengthened, so that fewer rows would save little time. It
/// ends where it hardly gains, half a percent in the standard deviation: merging and pruning make the score rough, and a simplex wanders
/// long over what is left.
pub(crate) const FURTHER: Search = Search { side: 0.7, steps: 100, least_gain: 0.005, ..REFINEMENT };

impl Search {
    /// Returns the expected number of evaluations: a step of the simplex evaluates one or two points, and a search that may end early takes
    /// half of its steps.
    pub(crate) const fn evaluations(self) -> u64 {
        let steps = if self.least_gain > 0.0 { self.steps / 2 } else { self.steps };
        steps * 3 / 2
    }
}

/// Returns the expected number of evaluations of a survey under this many laws.
pub(crate) fn survey_evaluations(laws: usize) -> u64 {
    SURVEY.evaluations() + (laws.max(1) as u64 - 1) * RESURVEY.evaluations()
}

/// Correlation times of the readings' errors that are tried, in steps of the thinned rows, from zero to much longer.
const ERROR_TIMES: [f64; 5] = [0.0, 0.25, 1.0, 4.0, 16.0];

/// Number of rows on which the smoother's intervals are checked; smoothing costs ten times as much as filtering.
const SMOOTHED_ROWS: usize = 2000;
/// First guess of the baseline's correlation time, s.
const BASELINE_TIME_S: f64 = 8.0;
/// First guess of white noise and branch noise, as a fraction of the law's residual.
const SHARE_OF_RESIDUAL: f64 = 0.3;
/// First guess of the tempering, below 1 because model error is correlated from reading to reading.
const TEMPERING: f64 = 0.7;

/// Result of a search for an estimator under a law.
pub(crate) struct Surveyed<'a> {
    pub kind: EstimatorKind,
    pub law: &'a CrossFit,
    pub tuned: Tuned,
}

/// Searches under one law after another, each from the end point of the one before.
pub(crate) fn survey<'a>(
    samples: &[Samples],
    laws: &'a [CrossFit],
    stats: MotionStats,
    (kind, of_make): (EstimatorKind, Option<&EstimatorPrior>),
    evaluated: &mut dyn FnMut(),
) -> Result<Vec<Surveyed<'a>>, CalibrationError> {
    let mut surveyed: Vec<Surveyed<'a>> = Vec::new();
    for law in laws {
        let before = surveyed.last().map(|one| one.tuned.point.as_slice());
        let search = if before.is_none() { SURVEY } else { RESURVEY };
        let problem = NoiseProblem::new(samples, law, stats, kind).with_prior(of_make);
        let tuned = problem.search(before, search, &mut *evaluated)?;
        surveyed.push(Surveyed { kind, law, tuned });
    }
    Ok(surveyed)
}

/// State of a search.
pub(crate) struct Tuned {
    /// Logarithms of the parameters.
    pub point: Vec<f64>,
    /// Minimised cost.
    pub cost: f64,
}

/// Search for noise and motion of one estimator, given a law, such that the filter's posterior fits the known strain.
pub(crate) struct NoiseProblem<'a> {
    samples: &'a [Samples<'a>],
    fit: &'a CrossFit,
    limits: StrainRange<f64>,
    stats: MotionStats,
    kind: EstimatorKind,
    /// Prior from other sensors of the make.
    of_make: Option<&'a EstimatorPrior>,
    /// Logarithms of the starting values, from residuals and motion, or from those sensors.
    untuned: Vec<f64>,
}

impl<'a> NoiseProblem<'a> {
    pub(crate) fn new(samples: &'a [Samples<'a>], fit: &'a CrossFit, stats: MotionStats, kind: EstimatorKind) -> Self {
        let limits = fit.law.law.range;
        let mut problem = Self { samples, fit, limits, stats, kind, of_make: None, untuned: Vec::new() };
        problem.untuned = problem.start();
        problem
    }

    /// Adds a prior of noise and motion.
    pub(crate) fn with_prior(self, of_make: Option<&'a EstimatorPrior>) -> Self {
        let same_size = of_make.filter(|prior| prior.ln_mean.len() == self.untuned.len());
        match same_size {
            Some(prior) => Self { of_make: same_size, untuned: prior.ln_mean.clone(), ..self },
            None => self,
        }
    }

    /// Returns the penalty that keeps a search near its start.
    fn pull(&self, point: &[f64]) -> f64 {
        let flat = || point.iter().zip(&self.untuned).map(|(x, untuned)| (x - untuned).powi(2)).sum::<f64>();
        self.of_make.map_or_else(|| REGULARISATION * flat(), |prior| prior.pull(point, self.stats.longest_s))
    }

    /// Searches from the values that residuals and motion suggest, or from the end point of another search.
    pub(crate) fn search(
        &self,
        from: Option<&[f64]>,
        search: Search,
        mut evaluated: impl FnMut(),
    ) -> Result<Tuned, CalibrationError> {
        let left_out = self.left_out(self.stride(search.rows));
        let step_factor = if self.kind == EstimatorKind::SignSplit { search.step_factor } else { 1.0 };
        let mut cost = |point: &[f64]| {
            evaluated();
            let params = self.params(point);
            let score = left_out.score(&|fold| self.recipe(fold, params).in_longer_steps(step_factor));
            score + self.pull(point)
        };
        let from = from.unwrap_or(&self.untuned);
        let ends = Ends { iterations: search.steps, least_gain: search.least_gain };
        let point = nelder_mead(&mut cost, from, search.side, ends);
        Ok(Tuned { cost: cost(&point), point })
    }

    /// Returns the start of a search for this estimator, with noise and motion where another one's search ended; with a prior, its means.
    pub(crate) fn begun_at_end_of(&self, other: &Tuned) -> Vec<f64> {
        if self.of_make.is_some() {
            return self.untuned.clone();
        }
        other.point.iter().take(OF_ALL).chain(self.untuned.iter().skip(OF_ALL)).copied().collect()
    }

    /// Searches from `from`. If that thinned the rows, it also chooses the correlation time of the readings' errors with the best score on
    /// every row. The untuned values compete as well, because the search has not seen most of these rows.
    pub(crate) fn refine(
        &self,
        from: &[f64],
        search: Search,
        evaluated: impl FnMut(),
    ) -> Result<EstimatorParams, CalibrationError> {
        let refined = self.search(Some(from), search, evaluated)?.point;
        let stride = self.stride(search.rows);
        let every_row = self.left_out(1);
        let step_s = stride as f64 * usual_step_s(self.samples.iter().map(|samples| samples.time_s));
        let times = if stride > 1 { &ERROR_TIMES[..] } else { &ERROR_TIMES[..1] };
        let times = if self.of_make.is_some() { &[] } else { times };
        let alike = times.iter().map(|steps| self.alike_over(&refined, steps * step_s, step_s));
        let as_made = self.of_make.map(|_| self.params(&refined));
        let mut best = (f64::INFINITY, self.params(&refined));
        for params in alike.chain(as_made).chain([self.params(&self.untuned)]) {
            let score = every_row.score(&|fold| self.recipe(fold, params));
            if score < best.0 {
                best = (score, params);
            }
        }
        Ok(self.finish(&every_row, best.1, best.0))
    }

    /// Returns the parameters with a correlation time of `error_time_s` for the readings' errors, given those found on rows every `step_s`
    /// seconds.
    fn alike_over(&self, point: &[f64], error_time_s: f64, step_s: f64) -> EstimatorParams {
        let mut params = self.params(point);
        params.noise.reading_time_s = error_time_s;
        params.noise.reading_sd *= news(step_s, error_time_s).sqrt();
        params
    }

    /// Returns the parameters with their score and the factors that make their intervals cover the held-out blocks.
    fn finish(&self, left_out: &LeftOut, params: EstimatorParams, score: f64) -> EstimatorParams {
        // A short motion shows fewer of the possible errors.
        let of_make = self.of_make.map_or(1.0, |prior| prior.strain_sd_scale);
        let filtered = left_out.filtered_deviations(&|fold| self.recipe(fold, params));
        let smoothed = self.left_out(self.stride(SMOOTHED_ROWS)).smoothed_deviations(&|fold| self.recipe(fold, params));
        EstimatorParams {
            score,
            strain_sd_scale: filtered.map_or(1.0, |deviations| sd_scale(&deviations)).max(of_make),
            smoothed_sd_scale: smoothed.map(|deviations| sd_scale(&deviations)),
            settling: self.settling(left_out, params),
            ..params
        }
    }

    /// Returns the settling of the filter in the holds of held-out blocks.
    fn settling(&self, left_out: &LeftOut, params: EstimatorParams) -> Option<Settling<f64>> {
        let holds = LongHolds::new(self.samples, self.limits.span())?;
        let params = EstimatorParams { settling: Some(holds.law()), ..params };
        holds.settling(left_out, &|fold| self.recipe(fold, params))
    }

    fn recipe<'f>(&self, fold: Fold<'f>, params: EstimatorParams) -> FilterParts<'f> {
        FilterParts::of_law(self.kind, fold.law, params, self.limits)
    }

    fn left_out(&self, stride: usize) -> LeftOut<'a> {
        LeftOut::new(self.samples, self.fit, self.limits, stride)
    }

    /// Returns the stride that leaves no more than `rows` rows.
    fn stride(&self, rows: usize) -> usize {
        self.samples.iter().map(Samples::len).sum::<usize>().div_ceil(rows)
    }

    /// Returns the point that the law's residuals and the motion of the strain suggest, in the order in which `params` reads it.
    fn start(&self) -> Vec<f64> {
        let mut left_out = Vec::new();
        for (block, law) in self.fit.without_block.iter().enumerate() {
            for (rows, residuals) in self.fit.blocks.iter().zip(&law.residuals) {
                left_out.extend(residuals[rows[block].clone()].iter().filter(|r| r.is_finite()));
            }
        }
        let known: Vec<f64> = self.fit.law.residuals.iter().flatten().copied().filter(|r| r.is_finite()).collect();
        let fine = SHARE_OF_RESIDUAL * root_mean_square(&known).max(1e-9);
        let stats = &self.stats;
        let (rate_sd_per_s, strain_sd) = match self.kind {
            EstimatorKind::Imm | EstimatorKind::Hypotheses => (0.5 * stats.speed, 3.0 * stats.strain_sd),
            _ => (stats.rate_sd, stats.strain_sd),
        };
        let mut values = vec![root_mean_square(&left_out).max(1e-9), BASELINE_TIME_S, fine, fine];
        values.extend([rate_sd_per_s, stats.rate_time_s, strain_sd]);
        if self.kind.has_phases() {
            values.extend([stats.hold_s.unwrap_or(0.5), stats.move_s, stats.speed.max(1e-12), TEMPERING]);
        }
        values.into_iter().map(f64::ln).collect()
    }

    /// Returns the parameters at a point, the logarithms of their values; missing values are NaN.
    fn params(&self, point: &[f64]) -> EstimatorParams {
        let mut values = point.iter().map(|x| x.clamp(-25.0, 15.0).exp());
        let mut next = |_| values.next().unwrap_or(f64::NAN);
        let of_all: [f64; OF_ALL] = std::array::from_fn(&mut next);
        let [baseline_sd, baseline_time_s, reading_sd, branch_sd, rate_sd_per_s, rate_time_s, strain_sd] = of_all;
        let strain_mean = self.of_make.map_or(self.stats.strain_mean, |prior| prior.strain_mean);
        let reading_time_s = self.of_make.map_or(0.0, |prior| prior.reading_time_s);
        let phases = (point.len() > OF_ALL).then(|| {
            let [hold_time_s, move_time_s, speed_per_s, tempering] = std::array::from_fn(next);
            PhaseParams {
                hold_time_s,
                move_time_s,
                reversal: match (self.of_make, self.kind, self.stats.hold_s) {
                    (Some(prior), ..) => prior.reversal,
                    (None, EstimatorKind::SignSplit, None) => 1.0,
                    _ => self.stats.reversal,
                },
                speed_per_s: if self.kind == EstimatorKind::SignSplit { 0.0 } else { speed_per_s },
                tempering: tempering.min(1.0),
            }
        });
        EstimatorParams {
            score: f64::NAN,
            strain_sd_scale: 1.0,
            smoothed_sd_scale: None,
            motion: MotionParams { rate_sd_per_s, rate_time_s, strain_mean, strain_sd },
            noise: NoiseParams { baseline_sd, baseline_time_s, reading_sd, reading_time_s, branch_sd },
            phases,
            settling: None,
        }
    }
}

/// Number of values of a filter without phases.
const OF_ALL: usize = 7;
