//! Fusion of several channels of one strain: the channels' filters, and regressions on all their readings at once, weighted by the
//! covariance of their errors on held-out parts of the calibration.
//!
//! Normally the readings of a row lie near those of some calibration row. For any other row, each channel is left out in turn. If
//! the rest then lies near the calibration, that channel is faulty and stays out. If no single channel explains the row, the body
//! moves as it did not in calibration, and the variance of every member is increased.

mod combine;
mod low_passes;
mod novelty;
mod params;
mod regression;

use std::collections::VecDeque;
use std::sync::Arc;

pub use combine::{Member, combine};
pub use low_passes::LowPasses;
pub use novelty::distance;
pub use params::{FUSION_FORMAT, FusionErrors, FusionParams, FusionRow, MOST_CHANNELS, RegressionParams};
pub use regression::{FusionReadings, PRIOR_SD, Regression, scaled_inputs};

/// Multiple of [`FusionParams::novelty`] beyond which a row counts as unlike the calibration.
pub const UNLIKE: f64 = 1.5;
/// Fewest other channels needed to declare a channel faulty.
const FEWEST_WITNESSES: usize = 2;
/// Largest number of channel sets whose regressions are cached.
const MOST_SETS: usize = 8;

/// State of a channel at one time.
#[derive(Clone, Copy, Debug)]
pub struct ChannelState {
    /// ln R/R₀; NaN for a missing or implausible reading.
    pub ln_r: f64,
    /// Strain of the channel's own filter or smoother.
    pub own: Member,
}

/// Fused estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Fused {
    /// Strain.
    pub strain: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Index of the faulty channel, which was left out.
    pub faulty: Option<usize>,
    /// True if the readings are unlike any of the calibration, and no single channel explains that.
    pub is_unlike: bool,
}

/// A running fusion.
#[derive(Clone, Debug)]
pub struct Fusion {
    params: Arc<FusionParams>,
    /// Errors of its members.
    errors: FusionErrors,
    low_passes: LowPasses,
    /// Regressions on sets of channels, most recently used last.
    conditioned: VecDeque<Conditioned>,
}

/// Regressions on a subset of the channels.
#[derive(Clone, Debug)]
struct Conditioned {
    channels: Vec<usize>,
    /// One for each entry of [`FusionParams::regressions`]; `None` where none can be computed.
    regressions: Arc<Vec<Option<Regression>>>,
}

impl Fusion {
    /// Creates a fusion of filters without any reading.
    #[must_use]
    pub fn new(params: Arc<FusionParams>) -> Self {
        let errors = params.errors.clone();
        Self::with_errors(params, errors)
    }

    /// Creates a fusion of smoothers; `None` if their errors are not known.
    #[must_use]
    pub fn of_smoothers(params: Arc<FusionParams>) -> Option<Self> {
        let errors = params.smoothers.clone()?;
        Some(Self::with_errors(params, errors))
    }

    fn with_errors(params: Arc<FusionParams>, errors: FusionErrors) -> Self {
        let low_passes = LowPasses::new(&params.low_pass_s, params.channels());
        Self { params, errors, low_passes, conditioned: VecDeque::new() }
    }

    /// Fuses the channels at a time.
    pub fn step(&mut self, time_s: f64, channels: &[ChannelState]) -> Fused {
        let mut ln_r: Vec<f64> = channels.iter().map(|channel| channel.ln_r).collect();
        let params = Arc::clone(&self.params);
        let (faulty, novelty) = params.faulty(&ln_r);
        if let Some(faulty) = faulty {
            ln_r[faulty] = f64::NAN;
        }
        self.low_passes.step(time_s, &ln_r);
        let read: Vec<usize> = (0..ln_r.len()).filter(|&channel| ln_r[channel].is_finite()).collect();
        let regressions = self.regressions(&read);
        let seen = FusionReadings { ln_r: &ln_r, low_passed: self.low_passes.states() };
        let mut members: Vec<Member> = channels.iter().map(|channel| channel.own).collect();
        if let Some(faulty) = faulty {
            members[faulty] = Member::UNKNOWN;
        }
        let prediction = |one: &Option<Regression>| one.as_ref().map_or(Member::UNKNOWN, |one| one.strain(seen));
        members.extend(regressions.iter().map(prediction));
        let limits = params.limits;
        let nothing = Member { strain: 0.5 * (limits.lower + limits.upper), sd: limits.span() };
        let fused = params.fused(&self.errors, &members, novelty).unwrap_or(nothing);
        Fused { strain: fused.strain.clamp(limits.lower, limits.upper), sd: fused.sd, faulty, is_unlike: novelty > 0.0 }
    }

    /// Returns the regressions on these channels, computed at first use.
    fn regressions(&mut self, channels: &[usize]) -> Arc<Vec<Option<Regression>>> {
        let place = self.conditioned.iter().position(|one| one.channels == channels);
        let known = place.and_then(|place| self.conditioned.remove(place));
        let one = known.unwrap_or_else(|| Conditioned {
            channels: channels.to_vec(),
            regressions: Arc::new(self.params.conditioned(channels)),
        });
        if self.conditioned.len() == MOST_SETS {
            self.conditioned.pop_front();
        }
        let regressions = Arc::clone(&one.regressions);
        self.conditioned.push_back(one);
        regressions
    }
}

impl FusionParams {
    /// Computes the regressions on these channels; `None` for each if there is no channel. Noise and length are those of a fit to all
    /// channels; fewer leave larger errors than these state, of which the rows of the calibration tell the size.
    fn conditioned(&self, channels: &[usize]) -> Vec<Option<Regression>> {
        let rows: Vec<&FusionRow> = self.rows.iter().collect();
        let (all, span) = ((0..self.channels()).collect::<Vec<usize>>(), self.limits.span());
        let on = |params: &RegressionParams| {
            let some = Regression::new(&rows, params, channels, span)?;
            if channels == all {
                return Some(some);
            }
            // If the fit to all channels states too much, the smaller excess of a part is measured from there.
            let of_all = Regression::new(&rows, params, &all, span).map_or(0.0, |all| all.excess());
            let unstated = some.excess() - of_all.min(0.0);
            Some(some.with_unstated(unstated))
        };
        self.regressions.iter().map(on).collect()
    }

    /// Returns the faulty channel: the one without which the readings are like some of the calibration, although they are not with
    /// it. If there is none, also returns the novelty of the readings, 0 to 1.
    fn faulty(&self, ln_r: &[f64]) -> (Option<usize>, f64) {
        let unlike = |ln_r: &[f64]| {
            distance(ln_r, self.rows.iter().map(|row| row.ln_r.as_slice()), &self.channel_sd) / self.novelty
        };
        let all = unlike(ln_r);
        if all <= UNLIKE {
            return (None, 0.0);
        }
        let read: Vec<usize> = (0..ln_r.len()).filter(|&channel| ln_r[channel].is_finite()).collect();
        let without = |channel: &usize| {
            let mut others = ln_r.to_vec();
            others[*channel] = f64::NAN;
            (*channel, unlike(&others))
        };
        let nearest = read.iter().map(without).min_by(|a, b| a.1.total_cmp(&b.1));
        let explains = nearest.filter(|(_, unlike)| *unlike <= 1.0 && read.len() > FEWEST_WITNESSES);
        explains.map_or_else(|| (None, (all - UNLIKE).min(1.0)), |(channel, _)| (Some(channel), 0.0))
    }

    /// Combines members with these errors. With a `novelty` of the readings of 0 to 1, that share of the prior variance is added to each
    /// member and to the result.
    #[must_use]
    pub fn fused(&self, errors: &FusionErrors, members: &[Member], novelty: f64) -> Option<Member> {
        let prior = novelty * (PRIOR_SD * self.limits.span()).powi(2);
        let doubted = |member: &Member| Member { sd: (member.sd * member.sd + prior).sqrt(), ..*member };
        let members: Vec<Member> = members.iter().map(doubted).collect();
        let fused = combine(&members, |i, j| errors.covariance[i][j])?;
        Some(Member { strain: fused.strain, sd: errors.sd_scale * (fused.sd * fused.sd + prior).sqrt() })
    }
}
