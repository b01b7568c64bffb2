//! Fusion of several channels that measure the same strain, learned from the estimates of each channel, and of regressions on all their
//! readings, on held-out blocks.

mod neighbours;
mod readings;
mod regressions;

use std::collections::HashMap;

use ohmstrain_model::StrainRange;
use ohmstrain_sensor::fusion::{FUSION_FORMAT, FusionErrors, FusionParams, Member};
use ohmstrain_sensor::{Quantity, Scores};

use crate::CalibrationError;
use crate::calibrate::findings::LeftOutRow;
use crate::calibrate::scores::{ScoredRow, score_of_full_scale};
use crate::motion_stats::MotionStats;
use crate::order::extent;
use crate::samples::Samples;
use crate::sd_scale::sd_scale;
use neighbours::Neighbours;
use readings::{Readings, ReadingsRow};

/// Number of blocks of each recording, left out in turn.
const BLOCKS: usize = 4;
/// Number of rows of the calibration that a fusion keeps.
const KEPT_ROWS: usize = 320;
/// Time constants of low-passes, in multiples of the time in which the strain changes by twice its standard deviation, and the low-passes
/// that each regression uses.
const LOW_PASSES: [f64; 3] = [1.0 / 3.0, 1.0, 3.0];
const REGRESSIONS: [&[usize]; 3] = [&[0], &[1], &[0, 2]];
/// Shrinkage of the errors' correlations: blocks are few, and errors within one block are alike.
const SHRINKAGE: f64 = 0.5;

/// A channel with the results of its calibration.
#[derive(Clone, Copy, Debug)]
pub struct FusionChannel<'a> {
    /// Its recordings, with the same times, row by row, as those of the other channels.
    pub recordings: &'a [Samples<'a>],
    /// R₀ of the calibrated sensor.
    pub rest_reading: f64,
    /// Its filter's and its smoother's estimates of held-out parts.
    pub left_out: &'a [LeftOutRow],
}

/// A fusion with its quality on held-out parts.
#[derive(Clone, Debug)]
pub struct FusionFit {
    /// The fusion.
    pub params: FusionParams,
    /// Scores of the fused estimate; `None` if the channels have no estimates of held-out parts.
    pub fused: Option<Scores>,
    /// Scores of the fused smoothers.
    pub smoothed: Option<Scores>,
    /// Scores of each channel alone on the same rows.
    pub channels: Vec<Option<Scores>>,
}

/// Learns the fusion of channels.
///
/// # Errors
/// If there are fewer than two channels, if their times differ, or if no row has readings of all channels and a strain.
pub fn fit_fusion(
    channels: &[FusionChannel],
    quantity: Quantity,
    made_by: &str,
) -> Result<FusionFit, CalibrationError> {
    let recordings = channels.first().map_or(&[][..], |channel| channel.recordings);
    let limits = limits(recordings)?;
    let low_pass_s = low_passes(recordings);
    let readings = Readings::new(channels, &low_pass_s)?;
    let neighbours = Neighbours::new(&readings);
    let (regressions, left_out) = regressions::fit(&readings, limits.span())?;
    let params = FusionParams {
        format: FUSION_FORMAT,
        made_by: made_by.into(),
        quantity,
        limits,
        novelty: neighbours.novelty,
        channel_sd: neighbours.channel_sd.clone(),
        low_pass_s,
        errors: FusionErrors { sd_scale: 1.0, covariance: identity(channels.len() + regressions.len()) },
        filters: None,
        smoothers: None,
        regressions,
        rows: readings.thinned(|_| true, KEPT_ROWS).map(|row| row.seen.clone()).collect(),
    };
    let judged_by = |own| judged(channels, &readings, &left_out, own);
    let filtered = judged_by(|row| Member { strain: row.strain, sd: row.strain_sd });
    if filtered.is_empty() {
        return Ok(FusionFit { params, fused: None, smoothed: None, channels: vec![None; channels.len()] });
    }
    let check = Check { params: &params, neighbours: &neighbours };
    let (all, filters) = (check.errors(&filtered, params.members()), check.errors(&filtered, channels.len()));
    let helps = check.log_loss(&all, &filtered) <= check.log_loss(&filters, &filtered);
    let errors = if helps { all } else { filters.clone() };
    let smoothed = judged_by(|row| row.smoothed);
    let smoothers = check.errors(&smoothed, errors.covariance.len());
    let fused = score(&filtered, &check.fused(&errors, &filtered));
    let smoothed_score = score(&smoothed, &check.fused(&smoothers, &smoothed));
    let of_channel =
        |channel| score(&filtered, &filtered.iter().map(|one| Some(one.members[channel])).collect::<Vec<_>>());
    let alone = (0..channels.len()).map(of_channel).collect();
    let regressions = if helps { params.regressions } else { Vec::new() };
    let params = FusionParams { errors, filters: Some(filters), smoothers: Some(smoothers), regressions, ..params };
    Ok(FusionFit { params, fused, smoothed: smoothed_score, channels: alone })
}

/// A fusion on held-out blocks.
struct Check<'a> {
    params: &'a FusionParams,
    neighbours: &'a Neighbours,
}

impl Check<'_> {
    /// Returns the errors of the first `members`, with the factor that makes the fused interval cover the worst block.
    fn errors(&self, judged: &[Judged], members: usize) -> FusionErrors {
        let unscaled = FusionErrors { sd_scale: 1.0, covariance: covariance(judged, members) };
        let mut blocks = vec![Vec::new(); BLOCKS];
        for (one, member) in judged.iter().zip(self.fused(&unscaled, judged)) {
            blocks[one.row.block].extend(member.map(|member| (member.strain - one.row.seen.strain).abs() / member.sd));
        }
        FusionErrors { sd_scale: sd_scale(&blocks), ..unscaled }
    }

    /// Returns the fused estimates of judged rows.
    fn fused(&self, errors: &FusionErrors, judged: &[Judged]) -> Vec<Option<Member>> {
        let members = errors.covariance.len();
        let fused =
            |one: &Judged| self.params.fused(errors, &one.members[..members], self.neighbours.excess(one.row.place));
        judged.iter().map(fused).collect()
    }

    /// Returns the mean negative log density of the strain under the fused estimate.
    fn log_loss(&self, errors: &FusionErrors, judged: &[Judged]) -> f64 {
        let fused = self.fused(errors, judged);
        let losses = judged.iter().zip(&fused).map(|(one, member)| {
            let loss =
                |member: &Member| 0.5 * ((member.strain - one.row.seen.strain) / member.sd).powi(2) + member.sd.ln();
            member.as_ref().map_or(f64::INFINITY, loss)
        });
        losses.sum::<f64>() / judged.len() as f64
    }
}

/// Returns the range of the strain.
fn limits(recordings: &[Samples]) -> Result<StrainRange<f64>, CalibrationError> {
    let strains = recordings.iter().flat_map(|samples| samples.strain).copied().filter(|strain| strain.is_finite());
    let (lower, upper) = extent(strains);
    if lower < upper { Ok(StrainRange { lower, upper }) } else { Err(CalibrationError::NoCommonRows) }
}

/// Returns low-pass time constants for the motion of these recordings, s.
fn low_passes(recordings: &[Samples]) -> Vec<f64> {
    let stats = MotionStats::new(recordings);
    let time_s = 2.0 * stats.strain_sd / stats.rate_sd.max(1e-12);
    LOW_PASSES.iter().map(|share| share * time_s).collect()
}

/// A row with the estimates of all members, each made without the row's block.
struct Judged<'a> {
    row: &'a ReadingsRow,
    members: Vec<Member>,
}

/// Returns the rows that all channels have estimated, with the regressions' estimates; `own` is the estimate of a channel.
fn judged<'a>(
    channels: &[FusionChannel],
    readings: &'a Readings,
    regressions: &[Vec<Member>],
    own: fn(&LeftOutRow) -> Member,
) -> Vec<Judged<'a>> {
    let by_row = |channel: &FusionChannel| -> HashMap<(usize, usize), Member> {
        channel.left_out.iter().map(|one| ((one.recording, one.row), own(one))).collect()
    };
    let own: Vec<HashMap<(usize, usize), Member>> = channels.iter().map(by_row).collect();
    let of_row = |row: &'a ReadingsRow| {
        let of_channel = |own: &HashMap<(usize, usize), Member>| own.get(&(row.recording, row.row)).copied();
        let mut members: Vec<Member> = own.iter().map(of_channel).collect::<Option<_>>()?;
        members.extend(regressions.iter().map(|regression| regression[row.place]));
        Some(Judged { row, members })
    };
    readings.rows.iter().filter_map(of_row).collect()
}

/// Returns covariances about zero of the first members' errors in units of their standard deviations. Correlations are shrunk toward zero,
/// and a member that errs less than it states gets no extra weight.
fn covariance(judged: &[Judged], members: usize) -> Vec<Vec<f64>> {
    let mut sums = vec![vec![0.0; members]; members];
    for one in judged {
        let deviations: Vec<f64> =
            one.members[..members].iter().map(|member| (member.strain - one.row.seen.strain) / member.sd).collect();
        for (i, of_member) in sums.iter_mut().enumerate() {
            of_member.iter_mut().zip(&deviations).for_each(|(sum, other)| *sum += deviations[i] * other);
        }
    }
    let size = |member: usize| (sums[member][member] / judged.len() as f64).sqrt().max(1.0);
    let shrunken = |i: usize, j: usize| {
        let correlation = sums[i][j] / (sums[i][i] * sums[j][j]).sqrt().max(f64::MIN_POSITIVE);
        size(i) * size(j) * if i == j { 1.0 } else { (1.0 - SHRINKAGE) * correlation }
    };
    (0..members).map(|i| (0..members).map(|j| shrunken(i, j)).collect()).collect()
}

fn identity(members: usize) -> Vec<Vec<f64>> {
    (0..members).map(|i| (0..members).map(|j| f64::from(u8::from(i == j))).collect()).collect()
}

/// Scores estimates of these rows.
fn score(judged: &[Judged], members: &[Option<Member>]) -> Option<Scores> {
    let row = |(one, member): (&Judged, &Option<Member>)| {
        let member = (*member)?;
        let (time_s, truth) = (one.row.time_s, one.row.seen.strain);
        Some(ScoredRow { time_s, truth, strain: member.strain, sd: Some(member.sd) })
    };
    let rows: Vec<ScoredRow> = judged.iter().zip(members).filter_map(row).collect();
    score_of_full_scale(&rows)
}
