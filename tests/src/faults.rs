//! Response of a filter to faults: error, coverage, recovery and flags, before, during and after.

use std::fmt::Write;
use std::io::{Seek, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

use ohmstrain::{Estimate, FilterBuilder, Flag};
use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::faults::Episode;

/// Time before a fault for the filter to settle, s; the last third is scored.
pub const BEFORE_S: f64 = 30.0;
/// Time evaluated after a fault, s.
pub const AFTER_S: f64 = 40.0;
/// Largest excess of a recovered filter's error over that without the fault, averaged over two seconds, as a fraction of full
/// scale.
const RECOVERED: f64 = 0.03;
const AVERAGED_S: f64 = 2.0;
/// Two-sided 95 % quantile of the standard normal distribution.
const TWO_SIDED: f64 = 1.959_963_984_540_054;

/// Output of a filter for a row.
#[derive(Clone, Copy, Debug)]
pub struct FilterOutput {
    time_s: f64,
    strain: f64,
    strain_sd: f64,
    /// True if a flag reports that something is wrong with the reading, or with the use of the sensor.
    flagged: bool,
}

/// Rows that were scored together.
#[derive(Clone, Copy, Debug, Default)]
pub struct Score {
    rows: f64,
    squares: f64,
    covered: f64,
    flagged: f64,
    silent: f64,
}

impl Score {
    fn add(&mut self, row: &FilterOutput, truth: f64, full_scale: f64) {
        let error = row.strain - truth;
        let covered = error.abs() <= TWO_SIDED * row.strain_sd;
        self.rows += 1.0;
        self.squares += (error / full_scale).powi(2);
        self.covered += f64::from(u8::from(covered));
        self.flagged += f64::from(u8::from(row.flagged));
        self.silent += f64::from(u8::from(!row.flagged && !covered));
    }

    /// Adds another score.
    pub fn merge(&mut self, other: &Self) {
        self.rows += other.rows;
        self.squares += other.squares;
        self.covered += other.covered;
        self.flagged += other.flagged;
        self.silent += other.silent;
    }

    /// Root mean squared error, percent of full scale.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        100.0 * (self.squares / self.rows).sqrt()
    }

    /// Rows whose 95 % interval contains the truth, percent.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        100.0 * self.covered / self.rows
    }

    /// Rows with a flag that reports a problem, percent.
    #[must_use]
    pub fn flagged(&self) -> f64 {
        100.0 * self.flagged / self.rows
    }

    /// Rows whose interval misses the truth and that have no such flag, percent.
    #[must_use]
    pub fn silent(&self) -> f64 {
        100.0 * self.silent / self.rows
    }
}

/// True if a flag of the row reports that something is wrong with the reading, or with the use of the sensor.
fn is_flagged(row: &Estimate) -> bool {
    Flag::ALL
        .into_iter()
        .any(|flag| row.flags.has(flag) && !matches!(flag, Flag::RampBorder | Flag::AtLimit | Flag::LongRun))
}

/// Response of a filter to a fault.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    /// Settled rows before the fault.
    pub before: Score,
    /// Rows during the fault.
    pub during: Score,
    /// Rows of the first five seconds after the fault.
    pub soon: Score,
    /// Later rows.
    pub later: Score,
    /// Time after the fault's end, s, at which each filter's error last exceeded that without the fault.
    pub recovery_s: Vec<f64>,
}

impl Answer {
    /// Adds other episodes.
    pub fn merge(&mut self, other: Self) {
        self.before.merge(&other.before);
        self.during.merge(&other.during);
        self.soon.merge(&other.soon);
        self.later.merge(&other.later);
        self.recovery_s.extend(other.recovery_s);
    }

    /// Episodes with a recovery within five seconds of the fault's end, percent.
    #[must_use]
    pub fn recovered(&self) -> f64 {
        let soon = self.recovery_s.iter().filter(|seconds| **seconds <= 5.0).count();
        100.0 * soon as f64 / self.recovery_s.len() as f64
    }

    /// The longest recovery, s.
    #[must_use]
    pub fn slowest_s(&self) -> f64 {
        self.recovery_s.iter().copied().fold(0.0, f64::max)
    }
}

/// Returns the library's estimates row by row, with the true strain; rows that the filter rejects are left out.
#[must_use]
pub fn estimates(builder: FilterBuilder, trace: &Trace) -> Vec<(FilterOutput, f64)> {
    let Ok(mut filter) = builder.build() else { return Vec::new() };
    let strain = trace.reference.as_ref().map(|reference| &reference.values);
    let truth = |row: usize| strain.map_or(f64::NAN, |strain| strain[row]);
    let output = |row: Estimate| FilterOutput {
        time_s: row.time_s,
        strain: row.strain,
        strain_sd: row.strain_sd,
        flagged: is_flagged(&row),
    };
    let step =
        |row: usize| Some((output(filter.step(trace.time_s[row], trace.readings.values[row]).ok()?), truth(row)));
    (0..trace.len()).filter_map(step).collect()
}

/// `OHMSTRAIN_LONG_RUN` of exported C: its only flag that does not report a problem.
const LONG_RUN: u32 = 256;

/// Returns the estimates of the compiled `replay.c` of an exported folder; rows whose time goes back, which it rejects,
/// are left out.
///
/// # Errors
/// If it cannot be run, or its output has another form.
pub fn replayed(program: &Path, trace: &Trace) -> std::io::Result<Vec<(FilterOutput, f64)>> {
    let strain = trace.reference.as_ref().map(|reference| &reference.values);
    let (mut recording, mut truths, mut last_s) = ("time_s,resistance_ohm\n".to_owned(), Vec::new(), f64::NEG_INFINITY);
    for (row, &time_s) in trace.time_s.iter().enumerate().filter(|(_, time_s)| !time_s.is_nan()) {
        if time_s < last_s {
            continue;
        }
        last_s = time_s;
        let reading = trace.readings.values[row];
        let cell = if reading.is_nan() { String::new() } else { reading.to_string() };
        writeln!(recording, "{time_s},{cell}").map_err(std::io::Error::other)?;
        truths.push(strain.map_or(f64::NAN, |strain| strain[row]));
    }
    let mut stdin = tempfile::tempfile()?;
    stdin.write_all(recording.as_bytes())?;
    stdin.rewind()?;
    let printed = Command::new(program).stdin(stdin).stderr(Stdio::inherit()).output()?.stdout;
    let output = |line: &str| {
        let numbers: Option<Vec<f64>> = line.split(',').map(|cell| cell.parse().ok()).collect();
        let [time_s, strain, strain_sd, flags] = numbers?[..] else { return None };
        Some(FilterOutput { time_s, strain, strain_sd, flagged: flags as u32 & !LONG_RUN != 0 })
    };
    let rows: Option<Vec<FilterOutput>> = String::from_utf8_lossy(&printed).lines().skip(1).map(output).collect();
    match rows.filter(|rows| rows.len() == truths.len()) {
        Some(rows) => Ok(rows.into_iter().zip(truths).collect()),
        None => Err(std::io::Error::other(format!("{}: printed other rows", program.display()))),
    }
}

/// Injects a fault into a recording at several times, and accumulates the filter's response.
pub fn answer(
    run: &dyn Fn(&Trace) -> Vec<(FilterOutput, f64)>,
    trace: &Trace,
    (episode, onsets_s): (Episode, &[f64]),
    full_scale: f64,
) -> Answer {
    let mut answer = Answer::default();
    let lasts_s = episode.until_s - episode.from_s;
    for (k, &from_s) in onsets_s.iter().enumerate() {
        let until_s = from_s + lasts_s;
        let row_at = |time_s: f64| trace.time_s.partition_point(|earlier_s| *earlier_s < time_s);
        let part = trace.rows(row_at(from_s - BEFORE_S)..row_at(until_s + AFTER_S));
        let episode = Episode { from_s, until_s, seed: episode.seed + k as u64, ..episode };
        let faulty = run(&episode.put_into(&part));
        let clean = run(&part);
        // With a wrong clock, the fault does not end at its nominal time.
        let rows = |time_s: f64| part.time_s.partition_point(|time| *time < time_s);
        let end_s =
            faulty.get(rows(until_s) + faulty.len() - part.len().min(faulty.len())).map_or(until_s, |row| row.0.time_s);
        for (row, truth) in faulty.iter().filter(|row| row.1.is_finite()) {
            let time_s = row.time_s;
            let score = if time_s < from_s - BEFORE_S / 3.0 {
                continue;
            } else if time_s < from_s {
                &mut answer.before
            } else if time_s < end_s {
                &mut answer.during
            } else if time_s < end_s + 5.0 {
                &mut answer.soon
            } else {
                &mut answer.later
            };
            score.add(row, *truth, full_scale);
        }
        answer.recovery_s.push(recovery_s(&faulty, &clean, end_s, full_scale));
    }
    answer
}

/// Returns the time after a fault's end at which the mean error was last too large, s. Rows are compared from the end backwards,
/// where both runs have the same ones.
fn recovery_s(faulty: &[(FilterOutput, f64)], clean: &[(FilterOutput, f64)], end_s: f64, full_scale: f64) -> f64 {
    let error = |(row, truth): &(FilterOutput, f64)| (row.strain - truth).abs();
    let pairs = faulty.iter().rev().zip(clean.iter().rev());
    let worse: Vec<(f64, f64)> = pairs
        .take_while(|(row, _)| row.0.time_s >= end_s)
        .map(|(row, without)| (row.0.time_s, error(row) - error(without)))
        .filter(|(_, worse)| worse.is_finite())
        .collect();
    let too_large = |k: usize| {
        let around: Vec<f64> =
            worse[k..].iter().take_while(|row| worse[k].0 - row.0 < AVERAGED_S).map(|row| row.1).collect();
        around.iter().sum::<f64>() > RECOVERED * full_scale * around.len() as f64
    };
    (0..worse.len()).find(|&k| too_large(k)).map_or(0.0, |k| worse[k].0 - end_s)
}
