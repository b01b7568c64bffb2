use ohmstrain_calib::{Lag, LagError, Samples, reference_lag};
use ohmstrain_model::Phase;

use crate::import::trace::build::Imported;
use crate::order::{extent, median, typical_step};
use crate::segment::{Segment, noise_sd, segment};

/// Step, in typical ones, above which it is a gap.
const GAP: f64 = 3.0;
/// Fraction of the reference's range, from its low end, in which drift is estimated.
const LOWEST: f64 = 0.1;

/// Steps of a clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockSurvey {
    /// Typical step, s.
    pub step_s: f64,
    /// 5 % and 95 % quantiles of the steps, s.
    pub step_range_s: (f64, f64),
    /// First and last time, s.
    pub span_s: (f64, f64),
    /// Number of steps longer than three typical ones, and the longest step, s.
    pub gaps: (usize, f64),
    /// Number of rows omitted because they had the time of the previous row.
    pub duplicates: usize,
}

/// Allan deviation at one averaging time; the least one is the limit of averaging before drift dominates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allan {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Allan deviation.
    pub deviation: f64,
}

/// Values of a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSurvey {
    /// Number of known and of missing values.
    pub counts: (usize, usize),
    /// Smallest and largest value.
    pub range: (f64, f64),
    /// Number of values in runs at the smallest and at the largest one, if such runs are rare elsewhere.
    pub clipped: (usize, usize),
    /// Standard deviation of the noise, from the distances of values from the line between their neighbours.
    pub noise: f64,
    /// Allan deviations over averaging times that double, in the longest hold, or in all rows of a recording without a
    /// reference; none if the body never holds still.
    pub allan: Vec<Allan>,
}

/// Phases of the body's motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhaseSurvey {
    /// Number and total duration, s, of each phase: extend, hold, retract.
    pub phases: [(usize, f64); 3],
    /// The segments.
    pub segments: Vec<Segment>,
}

/// Survey of a recording before it is used.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// The readings' clock.
    pub clock: ClockSurvey,
    /// The readings.
    pub readings: ChannelSurvey,
    /// The reference.
    pub reference: Option<ChannelSurvey>,
    /// Phases of the reference.
    pub phases: Option<PhaseSurvey>,
    /// Relative change of the readings from the first to the last time at rest; over the whole recording without a
    /// reference.
    pub drift: Option<f64>,
    /// Amplitude by which neighbouring readings alternate, relative to their size, if they do.
    pub alternation: Option<f64>,
    /// Lag of the reference behind the readings.
    pub lag: Option<Lag>,
    /// Reason why the lag is unknown.
    pub lag_unknown: Option<String>,
}

impl Survey {
    /// Surveys a recording.
    #[must_use]
    pub fn new(imported: &Imported) -> Self {
        let trace = &imported.trace;
        let (time_s, readings) = (&trace.time_s, &trace.readings.values);
        let reference = trace.reference.as_ref().map(|reference| reference.values.as_slice());
        let segments = reference.map(|reference| segment(time_s, reference));
        let quiet = match &segments {
            Some(segments) => longest_hold(time_s, segments).unwrap_or(0..0),
            None => 0..time_s.len(),
        };
        let found = reference.map(|reference| match Samples::new(time_s, readings, reference) {
            Ok(samples) => reference_lag(&samples),
            Err(_) => Err(LagError::Short),
        });
        Self {
            clock: clock_survey(time_s, imported.duplicates),
            readings: channel_survey(time_s, readings, &quiet),
            reference: reference.map(|reference| channel_survey(time_s, reference, &quiet)),
            phases: segments.map(|segments| phase_survey(time_s, segments)),
            alternation: imported.alternation,
            drift: drift(readings, reference),
            lag: found.and_then(Result::ok),
            lag_unknown: found.and_then(Result::err).map(|error| error.to_string()),
        }
    }
}

/// Surveys the steps of a clock, from which `duplicates` rows were omitted.
fn clock_survey(time_s: &[f64], duplicates: usize) -> ClockSurvey {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    let at = |share: f64| steps.get((share * steps.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    let step_s = typical_step(time_s).unwrap_or(f64::NAN);
    let gaps = steps.iter().filter(|step| **step > GAP * step_s).count();
    ClockSurvey {
        step_s,
        step_range_s: (at(0.05), at(0.95)),
        span_s: (time_s.first().copied().unwrap_or(f64::NAN), time_s.last().copied().unwrap_or(f64::NAN)),
        gaps: (gaps, steps.last().copied().unwrap_or(f64::NAN)),
        duplicates,
    }
}

fn channel_survey(time_s: &[f64], values: &[f64], quiet: &std::ops::Range<usize>) -> ChannelSurvey {
    let known: Vec<usize> = (0..values.len()).filter(|row| !values[*row].is_nan()).collect();
    let (times, numbers): (Vec<f64>, Vec<f64>) = known.iter().map(|row| (time_s[*row], values[*row])).unzip();
    let (low, high) = extent(numbers.iter().copied());
    ChannelSurvey {
        counts: (known.len(), values.len() - known.len()),
        range: (low, high),
        clipped: (clipped(&numbers, low), clipped(&numbers, high)),
        noise: noise_sd(&times, &numbers),
        allan: allan(&time_s[quiet.clone()], &values[quiet.clone()]),
    }
}

/// Counts values in runs at an end of the range, if neighbours are rarely equal elsewhere.
fn clipped(values: &[f64], end: f64) -> usize {
    const SHORTEST_RUN: usize = 3;
    let alike = values.windows(2).filter(|pair| pair[0] == pair[1] && pair[0] != end).count();
    if alike * 20 > values.len() {
        return 0;
    }
    let runs = values.chunk_by(|a, b| a == b).filter(|run| run[0] == end && run.len() >= SHORTEST_RUN);
    runs.map(<[f64]>::len).sum()
}

/// Returns Allan deviations of values at nearly even steps; gaps are ignored.
fn allan(time_s: &[f64], values: &[f64]) -> Vec<Allan> {
    let Some(step_s) = typical_step(time_s) else { return Vec::new() };
    let known: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    let mut sums = vec![0.0];
    for value in &known {
        // Relative to the first value, so that sums keep their digits.
        sums.push(sums[sums.len() - 1] + (value - known[0]));
    }
    let mut out = Vec::new();
    let mut width = 1;
    // Requires at least eight pairs of means.
    while known.len() >= 9 * width {
        let pairs = known.len() + 1 - 2 * width;
        let difference = |i: usize| (sums[i + 2 * width] - 2.0 * sums[i + width] + sums[i]) / width as f64;
        let square = (0..pairs).map(|i| difference(i).powi(2)).sum::<f64>() / pairs as f64;
        out.push(Allan { tau_s: width as f64 * step_s, deviation: (0.5 * square).sqrt() });
        width *= 2;
    }
    out
}

fn phase_survey(time_s: &[f64], segments: Vec<Segment>) -> PhaseSurvey {
    let mut out = PhaseSurvey::default();
    for segment in &segments {
        let phase = &mut out.phases[segment.phase.index()];
        phase.0 += 1;
        phase.1 += duration(time_s, segment);
    }
    PhaseSurvey { segments, ..out }
}

fn duration(time_s: &[f64], segment: &Segment) -> f64 {
    time_s[segment.rows.end.min(time_s.len() - 1)] - time_s[segment.rows.start]
}

fn longest_hold(time_s: &[f64], segments: &[Segment]) -> Option<std::ops::Range<usize>> {
    let holds = segments.iter().filter(|segment| segment.phase == Phase::Hold && segment.rows.len() >= 20);
    holds.max_by(|a, b| duration(time_s, a).total_cmp(&duration(time_s, b))).map(|hold| hold.rows.clone())
}

/// Returns the relative change of the readings from the first to the last tenth of those near the least strain.
fn drift(readings: &[f64], reference: Option<&[f64]>) -> Option<f64> {
    let known = reference.map(|reference| reference.iter().copied().filter(|value| !value.is_nan()));
    let range = known.map(extent);
    let is_low = |row: usize| match (reference, range) {
        (Some(reference), Some((low, high))) => reference[row] <= low + LOWEST * (high - low),
        _ => true,
    };
    let at_rest: Vec<f64> =
        (0..readings.len()).filter(|row| !readings[*row].is_nan() && is_low(*row)).map(|row| readings[row]).collect();
    let tenth = at_rest.len() / 10;
    let first = median(at_rest.get(..tenth)?.to_vec())?;
    Some(median(at_rest[at_rest.len() - tenth..].to_vec())? / first - 1.0)
}
