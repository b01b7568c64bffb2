//! The fusion of several channels as the exported code computes it.

use nalgebra::RealField;
use ohmstrain_sensor::fusion::{FusionErrors, FusionParams, PRIOR_SD, UNLIKE};
use serde::Serialize;

use super::process::Process;
use crate::ExportError;

/// Fewest channels of which one can be declared faulty.
const FEWEST: usize = 3;

/// Constants of a fusion. With readings of all channels its members are the channels' filters and the processes, else the filters alone.
#[derive(Clone, Debug, Serialize)]
pub struct ChipFusion<T> {
    pub lower: T,
    pub upper: T,
    /// Time constants of the low-passes, s.
    pub low_pass_s: Vec<T>,
    /// ln R/R₀ of each channel in the calibration's rows, and 1 over its typical difference.
    pub rows: Vec<Vec<T>>,
    pub per_sd: Vec<T>,
    /// Squared distance per channel from the nearest row that counts as usual.
    pub novelty: T,
    pub processes: Vec<Process<T>>,
    /// Errors of filters and processes, and of filters alone.
    pub all: Errors<T>,
    pub filters: Errors<T>,
}

/// Errors of members: the factor on the fused deviation, and covariances in units of the members' deviations.
#[derive(Clone, Debug, Serialize)]
pub struct Errors<T> {
    pub sd_scale: T,
    pub covariance: Vec<Vec<T>>,
}

/// Low-passes of a running fusion.
#[derive(Clone, Debug)]
pub struct FusionState<T> {
    /// Time since the last reading of each channel, s; negative before the first one.
    since_s: Vec<T>,
    low_passed: Vec<Vec<T>>,
}

/// A channel at one time.
#[derive(Clone, Copy, Debug)]
pub struct ChipChannel<T> {
    /// ln R/R₀; NaN without a reading.
    pub ln_r: T,
    /// Strain of its filter, with standard deviation.
    pub strain: T,
    pub sd: T,
}

/// Fused strain.
#[derive(Clone, Copy, Debug)]
pub struct ChipFused<T> {
    pub strain: T,
    pub sd: T,
    pub faulty: Option<usize>,
    pub is_unlike: bool,
}

impl ChipFusion<f64> {
    /// Prepares a fusion.
    ///
    /// # Errors
    /// If its file does not have the errors of filters alone, or a matrix is not positive definite.
    pub fn new(params: &FusionParams) -> Result<Self, ExportError> {
        let missing = || ExportError::Unsupported {
            what: "a fusion without the errors of its filters alone".into(),
            instead: "calibrate again, on recordings long enough that each quarter is estimated by the others",
        };
        let singular = || ExportError::Parameter("the rows of the fusion are too much alike".into());
        let filters = params.filters.as_ref().ok_or_else(missing)?;
        let processes = params.regressions.iter().map(|regression| Process::new(params, regression));
        let errors =
            |errors: &FusionErrors| Errors { sd_scale: errors.sd_scale, covariance: errors.covariance.clone() };
        Ok(Self {
            lower: params.limits.lower,
            upper: params.limits.upper,
            low_pass_s: params.low_pass_s.clone(),
            rows: params.rows.iter().map(|row| row.ln_r.clone()).collect(),
            per_sd: params.channel_sd.iter().map(|sd| 1.0 / sd).collect(),
            novelty: params.novelty,
            processes: processes.collect::<Option<_>>().ok_or_else(singular)?,
            all: errors(&params.errors),
            filters: errors(filters),
        })
    }
}

impl<T: RealField + Copy> ChipFusion<T> {
    /// Returns the state before any reading.
    pub fn start(&self) -> FusionState<T> {
        let channels = self.per_sd.len();
        let low_passed = vec![vec![T::zero(); channels]; self.low_pass_s.len()];
        FusionState { since_s: vec![-T::one(); channels], low_passed }
    }

    /// Fuses the channels after a step of `dt_s` seconds.
    pub fn step(&self, state: &mut FusionState<T>, dt_s: T, channels: &[ChipChannel<T>]) -> ChipFused<T> {
        let mut ln_r: Vec<T> = channels.iter().map(|channel| channel.ln_r).collect();
        let (faulty, novelty) = self.faulty(&ln_r);
        if let Some(faulty) = faulty {
            ln_r[faulty] = not_a_number();
        }
        self.hear(state, dt_s, &ln_r);
        let span = self.upper - self.lower;
        let prior = novelty * of::<T>(PRIOR_SD * PRIOR_SD) * span * span;
        let mut members: Vec<(usize, T, T)> = Vec::new();
        for (k, channel) in channels.iter().enumerate().filter(|(k, _)| Some(*k) != faulty) {
            members.push((k, channel.strain, (channel.sd * channel.sd + prior).sqrt()));
        }
        let has_all = ln_r.iter().all(|value| is_number(*value)) && !self.processes.is_empty();
        for (k, process) in self.processes.iter().enumerate().filter(|_| has_all) {
            let (mean, variance) = process.predict(&ln_r, &state.low_passed);
            members.push((
                channels.len() + k,
                process.mean_strain + mean * span,
                (variance * span * span + prior).sqrt(),
            ));
        }
        let errors = if has_all { &self.all } else { &self.filters };
        let (strain, variance) =
            combined(members, errors).unwrap_or((of::<T>(0.5) * (self.lower + self.upper), span * span));
        ChipFused {
            strain: strain.clamp(self.lower, self.upper),
            sd: errors.sd_scale * (variance + prior).sqrt(),
            faulty,
            is_unlike: novelty > T::zero(),
        }
    }

    /// Returns the faulty channel; without one, also the novelty of the readings, 0 to 1.
    fn faulty(&self, ln_r: &[T]) -> (Option<usize>, T) {
        let all = self.distance(ln_r, ln_r.len());
        if all <= of(UNLIKE) {
            return (None, T::zero());
        }
        let (mut nearest, mut faulty) = (T::one(), None);
        let read = ln_r.iter().filter(|value| is_number(**value)).count();
        for without in (0..ln_r.len()).filter(|k| read >= FEWEST && is_number(ln_r[*k])) {
            let distance = self.distance(ln_r, without);
            if distance < nearest || (faulty.is_none() && distance <= nearest) {
                (nearest, faulty) = (distance, Some(without));
            }
        }
        let novelty = all - of(UNLIKE);
        if faulty.is_some() { (faulty, T::zero()) } else { (None, if novelty < T::one() { novelty } else { T::one() }) }
    }

    /// Returns the squared distance per channel from the nearest row, as a share of the usual one, without one of the channels.
    fn distance(&self, ln_r: &[T], without: usize) -> T {
        let used: Vec<usize> = (0..ln_r.len()).filter(|k| *k != without && is_number(ln_r[*k])).collect();
        if used.is_empty() {
            return T::zero();
        }
        let mut nearest: Option<T> = None;
        for row in &self.rows {
            let mut squared = T::zero();
            for k in &used {
                let difference = (ln_r[*k] - row[*k]) * self.per_sd[*k];
                squared += difference * difference;
            }
            nearest = Some(nearest.map_or(squared, |nearest| if squared < nearest { squared } else { nearest }));
        }
        nearest.unwrap_or(T::zero()) / of(used.len() as f64) / self.novelty
    }

    /// Passes readings to the low-passes.
    fn hear(&self, state: &mut FusionState<T>, dt_s: T, ln_r: &[T]) {
        for (k, value) in ln_r.iter().enumerate() {
            let is_first = state.since_s[k] < T::zero();
            if !is_first {
                state.since_s[k] += dt_s;
            }
            if !is_number(*value) {
                continue;
            }
            for (low, constant_s) in state.low_passed.iter_mut().zip(&self.low_pass_s) {
                let share = T::one() - (-(state.since_s[k] / *constant_s)).exp();
                low[k] = if is_first { *value } else { low[k] + (*value - low[k]) * share };
            }
            state.since_s[k] = T::zero();
        }
    }

    /// Converts every number.
    pub fn map<U>(&self, convert: impl Fn(T) -> U + Copy) -> ChipFusion<U> {
        let list = |numbers: &[T]| numbers.iter().map(|number| convert(*number)).collect::<Vec<U>>();
        let table = |rows: &[Vec<T>]| rows.iter().map(|row| list(row)).collect::<Vec<Vec<U>>>();
        let errors =
            |errors: &Errors<T>| Errors { sd_scale: convert(errors.sd_scale), covariance: table(&errors.covariance) };
        ChipFusion {
            lower: convert(self.lower),
            upper: convert(self.upper),
            low_pass_s: list(&self.low_pass_s),
            rows: table(&self.rows),
            per_sd: list(&self.per_sd),
            novelty: convert(self.novelty),
            processes: self.processes.iter().map(|process| process.map(convert)).collect(),
            all: errors(&self.all),
            filters: errors(&self.filters),
        }
    }
}

/// Returns the best linear unbiased estimate without negative weights of members, each with its index, strain and standard deviation;
/// `None` without a member.
fn combined<T: RealField + Copy>(mut members: Vec<(usize, T, T)>, errors: &Errors<T>) -> Option<(T, T)> {
    while !members.is_empty() {
        // The solution of C D w = 1/D with the covariance D C D, by a Cholesky decomposition of C.
        let n = members.len();
        let mut factor = vec![vec![T::zero(); n]; n];
        let mut weights: Vec<T> = members.iter().map(|member| T::one() / member.2).collect();
        for i in 0..n {
            for j in 0..=i {
                let mut entry = errors.covariance[members[i].0][members[j].0];
                for k in 0..j {
                    entry -= factor[i][k] * factor[j][k];
                }
                factor[i][j] = if i == j { entry.sqrt() } else { entry / factor[j][j] };
            }
            for k in 0..i {
                let known = weights[k];
                weights[i] -= factor[i][k] * known;
            }
            weights[i] /= factor[i][i];
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                let known = weights[k];
                weights[i] -= factor[k][i] * known;
            }
            weights[i] /= factor[i][i];
        }
        let (mut sum, mut strain) = (T::zero(), T::zero());
        for (weight, member) in weights.iter_mut().zip(&members) {
            *weight /= member.2;
            sum += *weight;
            strain += *weight * member.1;
        }
        if weights.iter().all(|weight| *weight >= T::zero()) {
            return Some((strain / sum, T::one() / sum));
        }
        let mut kept = weights.iter().map(|weight| *weight >= T::zero());
        members.retain(|_| kept.next().unwrap_or(false));
    }
    None
}

fn of<T: RealField>(number: f64) -> T {
    nalgebra::convert(number)
}

fn not_a_number<T: RealField>() -> T {
    of(f64::NAN)
}

fn is_number<T: RealField + Copy>(value: T) -> bool {
    value.is_finite()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use ohmstrain_sensor::fusion::{ChannelState, Fusion, Member};

    use super::{ChipChannel, ChipFusion};
    use crate::hand::tests::fusion;

    /// Over the rows of the calibration, between them, with a gain of 1.6 in one channel, and with all channels changed: the same channel is
    /// left out, the same rows are unlike the calibration, and with all channels the estimates are nearly those of the computer, whose
    /// processes stand on all rows.
    #[test]
    fn the_exported_fusion_is_that_of_the_computer() {
        let params = fusion();
        let chip = ChipFusion::new(&params).unwrap();
        let (mut state, mut computer) = (chip.start(), Fusion::new(Arc::new(params.clone())));
        let mut seen = [0; 3];
        for k in 0..4 * (params.rows.len() - 1) {
            let (row, share) = (k / 4, 0.25 * (k % 4) as f64);
            let between = |channel: usize| {
                let at = |row: usize| params.rows[row].ln_r[channel];
                at(row) + share * (at(row + 1) - at(row))
            };
            let change = |channel: usize| match k {
                200..240 if channel == 1 => 1.6_f64.ln(),
                300..340 => [0.5, -0.4, 0.3][channel],
                _ => 0.0,
            };
            let strain = params.rows[row].strain;
            let own = |channel: usize| (strain + 0.01 * (channel as f64 - 1.0), 0.01 + 0.002 * channel as f64);
            let ln_r = |channel: usize| between(channel) + change(channel);
            let for_chip: Vec<ChipChannel<f64>> = (0..3)
                .map(|channel| ChipChannel { ln_r: ln_r(channel), strain: own(channel).0, sd: own(channel).1 })
                .collect();
            let for_computer: Vec<ChannelState> = (0..3)
                .map(|channel| ChannelState {
                    ln_r: ln_r(channel),
                    own: Member { strain: own(channel).0, sd: own(channel).1 },
                })
                .collect();
            let found = chip.step(&mut state, 0.025, &for_chip);
            let expected = computer.step(0.025 * k as f64, &for_computer);
            assert_eq!((found.faulty, found.is_unlike), (expected.faulty, expected.is_unlike), "{k}");
            seen[usize::from(found.faulty.is_some()) + 2 * usize::from(found.is_unlike)] += 1;
            if found.faulty.is_none() {
                let off = (found.strain - expected.strain).abs() / expected.sd;
                assert!(off < 0.1 && (found.sd / expected.sd - 1.0).abs() < 0.1, "{k}: {found:?} {expected:?}");
            }
        }
        assert!(seen.iter().all(|rows| *rows >= 20), "{seen:?}");
    }
}
