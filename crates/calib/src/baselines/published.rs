use std::ops::Range;

use nalgebra::{Matrix2, Vector2};
use ohmstrain_model::{Phase, StrainRange};

use super::{Baseline, Held};
use crate::CalibrationError;
use crate::enough::check;
use crate::samples::{Samples, filled_strain};

/// Number of time constants tried for each direction.
const TIME_CONSTANTS: usize = 80;
/// Longest of them, in durations of the longest movement; over that movement such an exponential is a straight line.
const LONGEST: f64 = 30.0;
/// Shortest of them, in durations of the longest movement.
const SHORTEST: f64 = 0.01;

/// A phase and its rows.
pub type PhaseRows = (Phase, Range<usize>);

/// The published law taken literally: equation 8 of NOTATION.md, solved for the strain. In a movement, `R = R_s + r₀ exp(-t/τ₀) u + η v`,
/// with the time t and the travel u since its start, the reading R_s there, and the constant speed `v = u/t` of the paper's ramps. In a
/// hold the law's readings carry no information on the strain, which keeps its value. Each direction has its own parameters. On recordings,
/// τ₀ is proportional to 1/v: the exponential mostly stands for the curvature of the gauge curve.
///
/// The law receives the times at which phases begin and the strain of the first row, both unknown on a worn sensor, so its score is the
/// best that the law allows.
#[derive(Clone, Copy, Debug)]
pub struct PublishedLaw {
    extend: Movement,
    retract: Movement,
    range: StrainRange<f64>,
}

/// The law in one direction.
#[derive(Clone, Copy, Debug)]
struct Movement {
    /// r₀: reading per strain at the start.
    stiffness: f64,
    /// η, reading · s.
    viscosity_s: f64,
    /// τ₀, s.
    tau_s: f64,
}

/// A movement in progress.
#[derive(Clone, Copy)]
struct Started {
    since_s: f64,
    strain: f64,
    /// R_s, without the dash-pot's contribution: the next movement adds its own.
    reading: f64,
    law: Movement,
}

/// A row of a movement, relative to its start; the dash-pot's contribution of the previous phase is removed.
struct MovingRow {
    elapsed_s: f64,
    travel: f64,
    rate: f64,
    reading: f64,
}

impl PublishedLaw {
    /// Fits by least squares over all movements of recordings whose phases are known.
    ///
    /// # Errors
    /// If a recording is too short, the strain is constant, or one direction has no movement.
    pub fn fit(recordings: &[Samples], phases: &[Vec<PhaseRows>]) -> Result<Self, CalibrationError> {
        let (lower, upper) = check(recordings)?;
        let law = |direction: Phase| {
            let of_recording = |(samples, phases): (&Samples, &Vec<PhaseRows>)| moving_rows(samples, phases, direction);
            let rows: Vec<MovingRow> = recordings.iter().zip(phases).flat_map(of_recording).collect();
            best_law(&rows).ok_or(CalibrationError::Singular)
        };
        let (extend, retract) = (law(Phase::Extend)?, law(Phase::Retract)?);
        Ok(Self { extend, retract, range: StrainRange { lower, upper } })
    }

    /// Starts on a recording whose phases begin at these times, s, with the strain of its first row.
    #[must_use]
    pub fn start(&self, phases: Vec<(f64, Phase)>, strain: f64) -> impl Baseline + use<> {
        let mut held = Held::new(self.range);
        held.next(strain.is_finite().then_some(strain));
        RunningPublished { law: *self, phases, next: 0, held, started: None, before: None }
    }
}

fn moving_rows(samples: &Samples, phases: &[PhaseRows], direction: Phase) -> Vec<MovingRow> {
    let strain = filled_strain(samples);
    let mean_rate = |rows: &Range<usize>| {
        let (first, last) = (rows.start.saturating_sub(1), rows.end - 1);
        (strain[last] - strain[first]) / (samples.time_s[last] - samples.time_s[first]).max(f64::MIN_POSITIVE)
    };
    let rate_of = |(phase, rows): &PhaseRows| if *phase == Phase::Hold { 0.0 } else { mean_rate(rows) };
    let mut found = Vec::new();
    for (place, (_, rows)) in phases.iter().enumerate().filter(|(_, (phase, _))| *phase == direction) {
        let before = place.checked_sub(1).map_or(0.0, |before| rate_of(&phases[before]));
        let start = rows.start.saturating_sub(1);
        let rate = mean_rate(rows) - before;
        let row = |k: usize| MovingRow {
            elapsed_s: samples.time_s[k] - samples.time_s[start],
            travel: strain[k] - strain[start],
            rate,
            reading: samples.reading[k] - samples.reading[start],
        };
        found.extend(rows.clone().map(row).filter(|row| row.reading.is_finite()));
    }
    found
}

/// Fits r₀ and η by linear least squares for every time constant and returns the fit with the smallest residual.
fn best_law(rows: &[MovingRow]) -> Option<Movement> {
    let longest_s = rows.iter().map(|row| row.elapsed_s).fold(0.0, f64::max);
    let tau_s = |i: usize| longest_s * SHORTEST * (LONGEST / SHORTEST).powf(i as f64 / (TIME_CONSTANTS - 1) as f64);
    let fitted = |tau_s: f64| {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for row in rows {
            let basis = Vector2::new((-row.elapsed_s / tau_s).exp() * row.travel, row.rate);
            normal += basis * basis.transpose();
            right += basis * row.reading;
        }
        let weights = normal.svd(true, true).solve(&right, f64::EPSILON * normal.norm()).ok()?;
        Some((right.dot(&weights), tau_s, weights))
    };
    let (_, tau_s, weights) =
        (0..TIME_CONSTANTS).filter_map(|i| fitted(tau_s(i))).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_law = tau_s > 0.0 && weights.iter().all(|weight| weight.is_finite());
    is_law.then_some(Movement { stiffness: weights[0], viscosity_s: weights[1], tau_s })
}

struct RunningPublished {
    law: PublishedLaw,
    /// Starts of phases, s.
    phases: Vec<(f64, Phase)>,
    next: usize,
    held: Held,
    started: Option<Started>,
    /// Time, reading and rate at the last reading.
    before: Option<(f64, f64, f64)>,
}

impl RunningPublished {
    fn begin(&mut self, phase: Phase, time_s: f64, reading: f64) {
        let (since_s, before, rate) = self.before.unwrap_or((time_s, reading, 0.0));
        let law = match phase {
            Phase::Hold => None,
            Phase::Extend => Some(self.law.extend),
            Phase::Retract => Some(self.law.retract),
        };
        let strain = self.held.last;
        self.started = law.map(|law| Started { since_s, strain, reading: before - law.viscosity_s * rate, law });
    }

    /// Returns strain and strain rate.
    fn solved(&self, time_s: f64, reading: f64) -> Option<(f64, f64)> {
        let Started { since_s, strain, reading: at_start, law } = self.started?;
        let elapsed_s = time_s - since_s;
        let slope = law.stiffness * (-elapsed_s / law.tau_s).exp();
        let travel = (reading - at_start) / (slope + law.viscosity_s / elapsed_s);
        (elapsed_s > 0.0 && travel.is_finite()).then(|| (strain + travel, travel / elapsed_s))
    }
}

impl Baseline for RunningPublished {
    fn strain(&mut self, time_s: f64, reading: f64) -> f64 {
        if !reading.is_finite() {
            return self.held.next(None);
        }
        while let Some((_, phase)) = self.phases.get(self.next).filter(|(start_s, _)| *start_s <= time_s).copied() {
            self.begin(phase, time_s, reading);
            self.next += 1;
        }
        let solved = self.solved(time_s, reading);
        self.before = Some((time_s, reading, solved.map_or(0.0, |(_, rate)| rate)));
        self.held.next(solved.map(|(strain, _)| strain))
    }
}
