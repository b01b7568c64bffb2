use ohmstrain_ekf::{Gaussian, Reading};

use crate::CalibrationError;
use crate::calibrate::Stage;
use crate::estimator_params::{EstimatorKind, EstimatorParams, MotionParams, NoiseParams, PhaseParams};
use crate::filter::{Start, filter_from_parts};
use crate::law_fit::CrossFit;
use crate::motion_stats::{MotionStats, root_mean_square};
use crate::optimise;
use crate::params::RangeParams;
use crate::samples::Samples;

/// Standard deviation that every reference has of its own, as a share of the strain's range: no score can be had from
/// being more precise.
pub(crate) const REFERENCE_SD: f64 = 0.005;
/// Pull toward the starting values, per squared step of a log-parameter: a score from one recording must not run away.
const REGULARISATION: f64 = 1e-2;
/// Local searches: the side of the first simplex in log-parameters, and the number of steps.
const SEARCHES: [(f64, u64); 2] = [(0.7, 150), (0.5, 150)];
/// First guess of the baseline's correlation time, s.
const BASELINE_TIME_S: f64 = 8.0;
/// First guess of white noise and branch noise, as a share of the law's residual.
const SHARE_OF_RESIDUAL: f64 = 0.3;
/// First guess of the tempering: model error is correlated from reading to reading.
const TEMPERING: f64 = 0.7;

/// The filter's score on the known strain as a function of noise and motion.
///
/// Each block of the recordings is scored with the law that was fitted without it. With a law that has seen the block
/// the residuals are too small, and a filter tuned on them believes its law more than it may elsewhere.
pub(crate) struct NoiseProblem<'a> {
    samples: &'a [Samples<'a>],
    fit: &'a CrossFit,
    /// Readings relative to the R₀ of each law, `[block][recording]`.
    readings: Vec<Vec<Vec<Option<Reading<f64>>>>>,
    limits: RangeParams,
    stats: MotionStats,
}

impl<'a> NoiseProblem<'a> {
    pub(crate) fn new(samples: &'a [Samples<'a>], fit: &'a CrossFit, limits: RangeParams) -> Self {
        let relative = |rests: &[f64]| {
            samples.iter().zip(rests).map(|(samples, rest)| relative_changes(samples.reading, *rest)).collect()
        };
        let readings = fit.without_block.iter().map(|law| relative(&law.rest_readings)).collect();
        Self { samples, fit, readings, limits, stats: MotionStats::new(samples) }
    }

    /// Fits noise and motion.
    pub(crate) fn fit(
        &self,
        kind: EstimatorKind,
        progress: &mut impl FnMut(Stage),
    ) -> Result<EstimatorParams, CalibrationError> {
        let start = self.start(kind);
        // A step of the simplex evaluates one or two points.
        let expected = SEARCHES.iter().map(|(_, steps)| steps * 3 / 2).sum();
        let mut done = 0;
        let mut cost = |point: &[f64]| {
            done += 1;
            progress(Stage::Noise { done, expected });
            let pull: f64 = point.iter().zip(&start).map(|(x, s)| (x - s).powi(2)).sum();
            self.score(kind, &self.params(kind, point)) + REGULARISATION * pull
        };
        let mut point = start.clone();
        for (side, steps) in SEARCHES {
            point = optimise::polish(&mut cost, &point, side, steps)?;
        }
        let mut params = self.params(kind, &point);
        params.score = self.score(kind, &params);
        params.strain_sd_scale = self.strain_sd_scale(kind, &params);
        params.smoothed_sd_scale = self.smoothed_sd_scale(kind, &params);
        Ok(params)
    }

    /// Logarithms of the parameters that the law's residuals and the motion of the strain suggest: noise (4), motion (3)
    /// and, for filters of phases, durations, speed and tempering (4).
    fn start(&self, kind: EstimatorKind) -> Vec<f64> {
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
        start.extend(match kind {
            EstimatorKind::Ekf | EstimatorKind::Ukf => [stats.rate_sd, stats.rate_time_s, stats.strain_sd],
            EstimatorKind::SignSplit | EstimatorKind::Particles => {
                [stats.rate_sd, stats.acceleration_sd, stats.strain_sd]
            }
            EstimatorKind::Imm | EstimatorKind::Hypotheses => {
                [0.5 * stats.speed, stats.rate_time_s, 3.0 * stats.strain_sd]
            }
        });
        if kind.has_phases() {
            start.extend([stats.hold_s.unwrap_or(0.5), stats.move_s, stats.speed.max(1e-12), TEMPERING]);
        }
        start.iter().map(|x| x.ln()).collect()
    }

    fn params(&self, kind: EstimatorKind, point: &[f64]) -> EstimatorParams {
        let p: Vec<f64> = point.iter().map(|x| x.clamp(-25.0, 15.0).exp()).collect();
        let strain_mean = self.stats.strain_mean;
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

    /// Mean negative log density of the true strain under the filter, strain in units of its range. Infinite if the
    /// filter fails.
    fn score(&self, kind: EstimatorKind, params: &EstimatorParams) -> f64 {
        let span = self.limits.span();
        let (mut sum, mut count) = (0.0, 0_usize);
        let finished = self.each_left_out_row(kind, params, |strain, truth| {
            let variance = strain.variance / (span * span) + REFERENCE_SD * REFERENCE_SD;
            let error = (strain.mean - truth) / span;
            sum += 0.5 * (error * error / variance + variance.ln());
            count += 1;
        });
        if finished.is_some() { sum / count.max(1) as f64 } else { f64::INFINITY }
    }

    fn strain_sd_scale(&self, kind: EstimatorKind, params: &EstimatorParams) -> f64 {
        let mut deviations = Vec::new();
        let finished = self.each_left_out_row(kind, params, |strain, truth| {
            deviations.push((strain.mean - truth).abs() / strain.sd());
        });
        finished.map_or(1.0, |()| sd_scale(deviations))
    }

    /// Smooths whole recordings with the law that has not seen a block and looks at the block.
    fn smoothed_sd_scale(&self, kind: EstimatorKind, params: &EstimatorParams) -> Option<f64> {
        let mut deviations = Vec::new();
        for (block, law) in self.fit.without_block.iter().enumerate() {
            for (recording, samples) in self.samples.iter().enumerate() {
                let mut filter = filter_from_parts(kind, &law.law, params, self.limits, Start::Unknown).ok()?;
                let smoothed = filter.smooth(samples.time_s, &self.readings[block][recording]).ok()??;
                for k in self.fit.blocks[recording][block].clone().filter(|&k| samples.strain[k].is_finite()) {
                    let strain = smoothed[k].estimate.strain;
                    deviations.push((strain.mean - samples.strain[k]).abs() / strain.sd());
                }
            }
        }
        Some(sd_scale(deviations))
    }

    /// Visits estimate and true strain in every row of every block, under the law that was fitted without the block: the
    /// filter runs from the first row to the end of the block. `None` if it fails.
    fn each_left_out_row(
        &self,
        kind: EstimatorKind,
        params: &EstimatorParams,
        mut visit: impl FnMut(Gaussian<f64>, f64),
    ) -> Option<()> {
        for (block, law) in self.fit.without_block.iter().enumerate() {
            for (recording, samples) in self.samples.iter().enumerate() {
                let rows = &self.fit.blocks[recording][block];
                let mut filter = filter_from_parts(kind, &law.law, params, self.limits, Start::Unknown).ok()?;
                for (k, reading) in self.readings[block][recording][..rows.end].iter().enumerate() {
                    filter.step(samples.time_s[k], *reading).ok()?;
                    if k >= rows.start && samples.strain[k].is_finite() {
                        visit(filter.strain(), samples.strain[k]);
                    }
                }
            }
        }
        Some(())
    }
}

/// Factors beyond these say that something else is wrong.
const SD_SCALES: std::ops::RangeInclusive<f64> = 0.5..=5.0;
/// Half-width of the 95 % interval of a standard normal.
const Z_95: f64 = 1.959_963_984_540_054;

/// What the standard deviations are multiplied with so that 95 % of the errors lie in the 95 % interval, from errors in
/// units of their deviations: split conformal prediction (Papadopoulos et al., *ECML* 2002) with the blocks left out.
///
/// Widening is taken whole, narrowing by its square root only: an easy recording is no promise for the next one.
fn sd_scale(mut deviations: Vec<f64>) -> f64 {
    deviations.sort_by(f64::total_cmp);
    let rank = (deviations.len().saturating_sub(1) * 95).div_ceil(100);
    let Some(deviation) = deviations.get(rank) else { return 1.0 };
    let factor = deviation / Z_95;
    let cautious = if factor < 1.0 { factor.sqrt() } else { factor };
    cautious.clamp(*SD_SCALES.start(), *SD_SCALES.end())
}

/// Readings over R₀ minus 1; `None` where missing.
pub(crate) fn relative_changes(reading: &[f64], rest_reading: f64) -> Vec<Option<Reading<f64>>> {
    reading.iter().map(|r| r.is_finite().then(|| Reading::from(r / rest_reading - 1.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::{Z_95, sd_scale};

    /// Deviations 1/100, 2/100, … 1 in units of `factor` interval widths: the 95 % quantile is 0.95 of them.
    fn deviations(factor: f64) -> Vec<f64> {
        (1..=100).rev().map(|k| factor * Z_95 * f64::from(k) / 95.0).collect()
    }

    #[test]
    fn the_interval_is_widened_whole_and_narrowed_by_half() {
        assert!((sd_scale(deviations(2.0)) - 2.0 * 96.0 / 95.0).abs() < 1e-12);
        assert!((sd_scale(deviations(0.64)) - (0.64 * 96.0 / 95.0_f64).sqrt()).abs() < 1e-12);
        assert_eq!((sd_scale(deviations(100.0)), sd_scale(deviations(1e-3))), (5.0, 0.5));
        assert_eq!(sd_scale(vec![]), 1.0);
    }
}
