use crate::CalibrationError;
use crate::estimator_params::{EstimatorKind, EstimatorParams, MotionParams, NoiseParams, PhaseParams};
use crate::filter::{Filter, Setting, Start, filter_from_parts};
use crate::law_fit::CrossFit;
use crate::left_out::{Fold, LeftOut};
use crate::motion_stats::{MotionStats, root_mean_square};
use crate::optimise;
use crate::own_rest::OwnRest;
use crate::params::RangeParams;
use crate::samples::Samples;
use crate::sd_scale::sd_scale;

/// Pull toward the starting values, per squared step of a log-parameter: a score from one recording must not run away.
const REGULARISATION: f64 = 1e-2;
/// A local search: the side of the first simplex in log-parameters, the number of steps, and to how many rows the
/// recordings are thinned for it.
#[derive(Clone, Copy)]
pub(crate) struct Search {
    side: f64,
    steps: u64,
    rows: usize,
}

/// Says how well an estimator does with a law.
pub(crate) const SURVEY: Search = Search { side: 0.7, steps: 100, rows: 500 };

/// How long the searches after the first one are.
#[derive(Clone, Copy)]
pub(crate) struct Effort {
    /// Says how well an estimator does with another law, from what the first one has led to.
    pub resurvey: Search,
    /// Goes on from the best survey.
    pub refinement: Search,
}

impl Effort {
    /// Of an estimator that has the time to itself.
    pub(crate) const ALONE: Self = Self {
        resurvey: Search { side: 0.4, steps: 40, rows: 500 },
        refinement: Search { side: 0.3, steps: 60, rows: 1500 },
    };
    /// Of members of an ensemble, who share it: what one of them misses the others are there for. On halves of nine
    /// recordings the pooled error is 0.356 of the static cubic's instead of 0.347, in half the time.
    pub(crate) const SHARED: Self = Self {
        resurvey: Search { side: 0.4, steps: 25, rows: 500 },
        refinement: Search { side: 0.3, steps: 30, rows: 1000 },
    };
}

impl Search {
    /// Evaluations to expect: a step of the simplex evaluates one or two points.
    pub(crate) const fn evaluations(self) -> u64 {
        self.steps * 3 / 2
    }
}

/// Rows on which the smoother's intervals are looked at; smoothing costs ten times as much as filtering.
pub(crate) const SMOOTHED_ROWS: usize = 2000;
/// First guess of the baseline's correlation time, s.
const BASELINE_TIME_S: f64 = 8.0;
/// First guess of white noise and branch noise, as a share of the law's residual.
const SHARE_OF_RESIDUAL: f64 = 0.3;
/// First guess of the tempering: model error is correlated from reading to reading.
const TEMPERING: f64 = 0.7;

/// Where a search has got to.
#[derive(Clone, Debug)]
pub(crate) struct Tuned {
    /// Logarithms of the parameters.
    point: Vec<f64>,
    /// What was minimised.
    pub cost: f64,
}

/// Noise and motion of one estimator, given a law: fitted so that the filter's own posterior is right on the known
/// strain.
pub(crate) struct NoiseProblem<'a> {
    samples: &'a [Samples<'a>],
    fit: &'a CrossFit,
    limits: RangeParams,
    stats: MotionStats,
    kind: EstimatorKind,
    effort: Effort,
}

impl<'a> NoiseProblem<'a> {
    pub(crate) fn new(
        samples: &'a [Samples<'a>],
        fit: &'a CrossFit,
        stats: MotionStats,
        kind: EstimatorKind,
        effort: Effort,
    ) -> Self {
        Self { samples, fit, limits: fit.law.law.range, stats, kind, effort }
    }

    /// Searches from the values that residuals and motion suggest, or from where another search has got to.
    pub(crate) fn search(
        &self,
        from: Option<&Tuned>,
        search: Search,
        mut evaluated: impl FnMut(),
    ) -> Result<Tuned, CalibrationError> {
        let start = self.start();
        let left_out = self.left_out(self.stride(search.rows));
        let mut cost = |point: &[f64]| {
            evaluated();
            let pull: f64 = point.iter().zip(&start).map(|(x, s)| (x - s).powi(2)).sum();
            let params = self.params(point);
            left_out.score(&|fold| self.build(self.kind.tuned_as(), fold, &params)) + REGULARISATION * pull
        };
        let from = from.map_or(&start, |tuned| &tuned.point);
        let point = optimise::polish(&mut cost, from, search.side, search.steps)?;
        Ok(Tuned { cost: cost(&point), point })
    }

    /// The parameters, scored on every row.
    pub(crate) fn finish(&self, tuned: &Tuned) -> EstimatorParams {
        let left_out = self.left_out(1);
        let score = |mut params: EstimatorParams| {
            params.score = left_out.score(&|fold| self.build(self.kind, fold, &params));
            params
        };
        let candidates = self.at_every_row(self.params(&tuned.point), self.stride(self.effort.refinement.rows));
        let best = candidates.into_iter().map(score).reduce(|a, b| if b.score < a.score { b } else { a });
        let mut params = best.unwrap_or_else(|| self.params(&tuned.point));
        let build = |fold: Fold| self.build(self.kind, fold, &params);
        let filtered = left_out.filtered_deviations(&build);
        let smoothed = self.left_out(self.stride(SMOOTHED_ROWS)).smoothed_deviations(&build);
        params.strain_sd_scale = filtered.map_or(1.0, |deviations| sd_scale(&deviations));
        params.smoothed_sd_scale = smoothed.map(|deviations| sd_scale(&deviations));
        params
    }

    fn build(
        &self,
        kind: EstimatorKind,
        fold: Fold,
        params: &EstimatorParams,
    ) -> Result<Box<dyn Filter>, CalibrationError> {
        let setting = Setting { limits: self.limits, start: Start::Unknown, own_rest: OwnRest::SHARED };
        filter_from_parts(kind, fold.law, params, setting)
    }

    /// What parameters that were found on every `stride`-th row may mean for every row. White noise stays what it is; if
    /// it stands for model error that is correlated over `stride` rows, it is that much larger, or the likelihood of a
    /// row counts that much less.
    fn at_every_row(&self, params: EstimatorParams, stride: usize) -> Vec<EstimatorParams> {
        let mut candidates = vec![params];
        if stride > 1 {
            let mut noisier = params;
            noisier.noise.reading_sd *= (stride as f64).sqrt();
            candidates.push(noisier);
            for mut candidate in candidates.clone() {
                if let Some(phases) = &mut candidate.phases {
                    phases.tempering /= stride as f64;
                    candidates.push(candidate);
                }
            }
        }
        candidates
    }

    fn left_out(&self, stride: usize) -> LeftOut<'a> {
        LeftOut::new(self.samples, self.fit, self.limits, stride)
    }

    fn stride(&self, rows: usize) -> usize {
        stride(self.samples, rows)
    }

    /// Logarithms of the parameters that the law's residuals and the motion of the strain suggest: noise (4), motion (3)
    /// and, for filters of phases, durations, speed and tempering (4).
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
        let mut start = vec![root_mean_square(&left_out).max(1e-9), BASELINE_TIME_S, fine, fine];
        start.extend(match self.kind.tuned_as() {
            EstimatorKind::Ekf | EstimatorKind::Ukf => [stats.rate_sd, stats.rate_time_s, stats.strain_sd],
            EstimatorKind::SignSplit | EstimatorKind::Particles | EstimatorKind::Ensemble => {
                [stats.rate_sd, stats.acceleration_sd, stats.strain_sd]
            }
            EstimatorKind::Imm | EstimatorKind::Hypotheses => {
                [0.5 * stats.speed, stats.rate_time_s, 3.0 * stats.strain_sd]
            }
        });
        if self.kind.has_phases() {
            start.extend([stats.hold_s.unwrap_or(0.5), stats.move_s, stats.speed.max(1e-12), TEMPERING]);
        }
        start.iter().map(|x| x.ln()).collect()
    }

    fn params(&self, point: &[f64]) -> EstimatorParams {
        let p: Vec<f64> = point.iter().map(|x| x.clamp(-25.0, 15.0).exp()).collect();
        let strain_mean = self.stats.strain_mean;
        let kind = self.kind.tuned_as();
        let motion = if kind == EstimatorKind::SignSplit {
            MotionParams::Smooth {
                rate_sd_per_s: p[4],
                // A stationary motion has σ_v² < σ_ε σ_a.
                acceleration_sd_per_s2: p[5].max(1.2 * p[4] * p[4] / p[6]),
                strain_mean,
                strain_sd: p[6],
            }
        } else {
            MotionParams::OrnsteinUhlenbeck { rate_sd_per_s: p[4], rate_time_s: p[5], strain_mean, strain_sd: p[6] }
        };
        let phases = kind.has_phases().then(|| PhaseParams {
            hold_time_s: p[7],
            move_time_s: p[8],
            reversal: match (kind, self.stats.hold_s) {
                (EstimatorKind::SignSplit, None) => 1.0,
                _ => self.stats.reversal,
            },
            speed_per_s: if kind == EstimatorKind::SignSplit { 0.0 } else { p[9] },
            tempering: p[10].min(1.0),
        });
        EstimatorParams {
            score: f64::NAN,
            strain_sd_scale: 1.0,
            smoothed_sd_scale: None,
            motion,
            noise: NoiseParams { baseline_sd: p[0], baseline_time_s: p[1], reading_sd: p[2], branch_sd: p[3] },
            phases,
        }
    }
}

/// Every how manieth row to take so that no more than `rows` are left.
pub(crate) fn stride(samples: &[Samples], rows: usize) -> usize {
    samples.iter().map(Samples::len).sum::<usize>().div_ceil(rows)
}
