//! A sensor whose law the filters have exactly, simulated in steps much finer than its rows, so that any error of a filter is
//! due to its step length.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Dwell, Estimator, Evidence, Mixture, Reading, State, Substeps};
use ohmstrain_model::{Branch, Gauge, ModelNoise, Motion, Phase, SensorLaw, StrainRange, SwitchedModel};

use crate::Draws;

const TAU_S: [f64; 2] = [5.0, 60.0];
const EXTEND_GAIN: [f64; 2] = [0.9, 0.4];
const RETRACT_GAIN: [f64; 2] = [-0.6, -0.2];
const SLOPE: f64 = 1.9;
const NOISE: ModelNoise<f64> =
    ModelNoise { reading_sd: 2e-3, branch_sd: 2e-3, baseline_sd: 5e-3, baseline_time_s: 10.0 };
const STRAIN_MEAN: f64 = 0.15;
const STRAIN_SD: f64 = 0.1;
const RATE_SD: f64 = 0.08;
const RATE_TIME_S: f64 = 1.5;
/// Mean rate of a motion in phases, 1/s.
const PHASE_RATE: f64 = 0.08;
const PHASE_RATE_SD: f64 = 0.03;
const HOLD_S: f64 = 4.0;
const MOVE_S: f64 = 3.0;
const FAR: StrainRange<f64> = StrainRange { lower: -2.0, upper: 2.0 };

/// Motion of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moves {
    /// An Ornstein-Uhlenbeck rate.
    Ou,
    /// The same with holds.
    OuAndHolds,
    /// Phases of extend, hold and retract, whose gains apply whatever the instantaneous sign of the rate.
    Phases,
}

/// State of the simulation.
struct Body {
    strain: f64,
    rate: f64,
    rests: bool,
    extends: bool,
    branches: [f64; 2],
    baseline: f64,
}

/// Simulates rows of a reading, relative to R₀, and the true strain.
#[must_use]
pub fn simulate(moves: Moves, dt_s: f64, seconds: f64, seed: u64) -> Vec<(f64, f64)> {
    let fine = 10_usize.max((dt_s / 0.004).ceil() as usize);
    let h = dt_s / fine as f64;
    let mut draws = Draws::new(seed);
    let (strain, rate) = (STRAIN_MEAN + STRAIN_SD * draws.normal(), RATE_SD * draws.normal());
    // An acceleration used to be drawn here; without this draw every recording would change.
    draws.normal();
    let mut body = Body {
        strain,
        rate,
        rests: false,
        extends: true,
        branches: [NOISE.branch_sd * draws.normal(), NOISE.branch_sd * draws.normal()],
        baseline: NOISE.baseline_sd * draws.normal(),
    };
    (0..(seconds / dt_s).round() as usize)
        .map(|_| {
            (0..fine).for_each(|_| body.move_on(moves, h, &mut draws));
            let rho = SLOPE * body.strain + body.branches.iter().sum::<f64>() + body.baseline;
            (rho + NOISE.reading_sd * draws.normal(), body.strain)
        })
        .collect()
}

/// Returns mean and standard deviation of the strain, and of the sum of the branches, `seconds` after a state without
/// any reading, from simulated motions that start at states drawn from it, in steps of 2 ms.
#[must_use]
pub fn spread_after<const K: usize>(
    (from, moves): (&Mixture<f64, 5, 15, K>, Moves),
    seconds: f64,
    motions: usize,
    seed: u64,
) -> [(f64, f64); 2] {
    const STEP_S: f64 = 0.002;
    let mut draws = Draws::new(seed);
    let (mut parts, mut sums) = (Vec::new(), [(0.0, 0.0); 2]);
    from.each(&mut |weight, belief| parts.push((weight, *belief)));
    for _ in 0..motions {
        let mut body = Body::drawn(&parts, from.phases(), &mut draws);
        (0..(seconds / STEP_S).round() as usize).for_each(|_| body.move_on(moves, STEP_S, &mut draws));
        for (sum, x) in sums.iter_mut().zip([body.strain, body.branches.iter().sum()]) {
            *sum = (sum.0 + x, sum.1 + x * x);
        }
    }
    let count = motions as f64;
    sums.map(|(sum, squares)| (sum / count, (squares / count - (sum / count).powi(2)).sqrt()))
}

impl Body {
    /// Draws a state from hypotheses with their weights and phases.
    fn drawn(parts: &[(f64, Belief<f64, 5, 15>)], phases: &[Phase], draws: &mut Draws) -> Self {
        let (mut left, mut which) = (draws.uniform(), 0);
        while which + 1 < parts.len() && left > parts[which].0 {
            left -= parts[which].0;
            which += 1;
        }
        let belief = &parts[which].1;
        // An exactly known state has no variance, so its covariance has no Cholesky factor; the strain of 10⁻⁶ added
        // here is negligible.
        let covariance = belief.covariance.to_matrix() + SMatrix::<f64, 5, 5>::identity() * 1e-12;
        let factor = covariance.cholesky().map_or_else(SMatrix::zeros, |cholesky| cholesky.l());
        let state = belief.mean + factor * SVector::<f64, 5>::from_fn(|_, _| draws.normal());
        let rests = phases.get(which) == Some(&Phase::Hold);
        Self {
            strain: state[0],
            rate: if rests { 0.0 } else { state[1] },
            rests,
            extends: phases.get(which) == Some(&Phase::Extend),
            branches: [state[2], state[3]],
            baseline: state[4],
        }
    }

    /// Takes an Euler-Maruyama step.
    fn move_on(&mut self, moves: Moves, h: f64, draws: &mut Draws) {
        let old = self.rate;
        match moves {
            Moves::Ou => self.ornstein_uhlenbeck(0.0, RATE_SD, h, draws),
            Moves::OuAndHolds => {
                if self.rests && draws.uniform() < h / HOLD_S {
                    (self.rests, self.rate) = (false, RATE_SD * draws.normal());
                } else if !self.rests && draws.uniform() < h / MOVE_S {
                    self.rests = true;
                }
                self.ornstein_uhlenbeck(0.0, RATE_SD, h, draws);
            }
            Moves::Phases => {
                self.change_phase(h, draws);
                self.ornstein_uhlenbeck(self.phase_rate(), PHASE_RATE_SD, h, draws);
            }
        }
        if self.rests {
            self.rate = 0.0;
        }
        let way = if self.rests { 0.0 } else { 0.5 * h * (old + self.rate) };
        self.strain += way;
        let extends = if moves == Moves::Phases { self.extends } else { way > 0.0 };
        for i in 0..2 {
            let gain = if extends { EXTEND_GAIN[i] } else { RETRACT_GAIN[i] };
            let noise = NOISE.branch_sd * (2.0 * h / TAU_S[i]).sqrt() * draws.normal();
            self.branches[i] += gain * way - h * self.branches[i] / TAU_S[i] + noise;
        }
        let drift = NOISE.baseline_sd * (2.0 * h / NOISE.baseline_time_s).sqrt() * draws.normal();
        self.baseline += drift - h * self.baseline / NOISE.baseline_time_s;
    }

    fn phase_rate(&self) -> f64 {
        if self.extends { PHASE_RATE } else { -PHASE_RATE }
    }

    fn change_phase(&mut self, h: f64, draws: &mut Draws) {
        if self.rests && draws.uniform() < h / HOLD_S {
            (self.rests, self.extends) = (false, draws.uniform() < 0.5);
        } else if !self.rests && draws.uniform() < h / MOVE_S {
            if draws.uniform() < 0.5 {
                self.rests = true;
                return;
            }
            self.extends = !self.extends;
        } else {
            return;
        }
        self.rate = self.phase_rate() + PHASE_RATE_SD * draws.normal();
    }

    fn ornstein_uhlenbeck(&mut self, toward: f64, sd: f64, h: f64, draws: &mut Draws) {
        let pull = (sd / STRAIN_SD).powi(2) * (self.strain - STRAIN_MEAN);
        self.rate +=
            sd * (2.0 * h / RATE_TIME_S).sqrt() * draws.normal() - h * ((self.rate - toward) / RATE_TIME_S + pull);
    }
}

fn law() -> SensorLaw<f64, 2> {
    let branch = |i: usize| Branch {
        tau_s: TAU_S[i],
        extend_gain: EXTEND_GAIN[i],
        retract_gain: RETRACT_GAIN[i],
        extend_gain_slope: 0.0,
        retract_gain_slope: 0.0,
    };
    SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [SLOPE, 0.0, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [branch(0), branch(1)],
        range: FAR,
    }
}

/// Returns the model of the sensor and the body.
///
/// # Panics
/// Never: its parameters are fixed.
#[must_use]
pub fn sensor(moves: Moves) -> SwitchedModel<f64, 2, 5> {
    let (sd, phase_rate) = if moves == Moves::Phases { (PHASE_RATE_SD, PHASE_RATE) } else { (RATE_SD, 0.0) };
    Motion::ornstein_uhlenbeck(RATE_TIME_S, sd, STRAIN_MEAN, STRAIN_SD)
        .and_then(|motion| motion.with_phase_rate(phase_rate))
        .and_then(|motion| SwitchedModel::new(law(), motion, NOISE))
        .unwrap_or_else(|_| unreachable!("fixed parameters"))
}

/// Returns the durations of its holds and movements.
///
/// # Panics
/// Never: its parameters are fixed.
#[must_use]
pub fn dwell(moves: Moves) -> Dwell<f64> {
    let reversal = if moves == Moves::Phases { 0.5 } else { 0.0 };
    Dwell::new(HOLD_S, MOVE_S, reversal).unwrap_or_else(|_| unreachable!("fixed parameters"))
}

/// Evidence with limits that no strain reaches.
pub const EVIDENCE: Evidence<f64> = Evidence { limits: FAR, tempering: 1.0 };

/// Consistency of a filter on such recordings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Honesty {
    rows: f64,
    inside: f64,
    squares: f64,
    deviations: f64,
}

impl Honesty {
    /// Share of the rows whose 95 % interval contains the strain, percent.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        100.0 * self.inside / self.rows
    }

    /// Root mean square error of strain.
    #[must_use]
    pub fn rmse(&self) -> f64 {
        (self.squares / self.rows).sqrt()
    }

    /// Mean standard deviation that the filter states.
    #[must_use]
    pub fn stated_sd(&self) -> f64 {
        self.deviations / self.rows
    }
}

/// Runs an estimator over recordings of 60 s with these seeds; the first 5 s are not scored. With `third_missing`, a
/// random third of the rows has no reading.
pub fn honesty<E, const N: usize, const L: usize>(
    estimator: E,
    start: &E::State,
    (moves, dt_s, third_missing): (Moves, f64, bool),
    seeds: core::ops::Range<u64>,
) -> Honesty
where
    E: Estimator<f64, N, L>,
{
    let estimator = Substeps(estimator);
    let prepared = estimator.prepare(dt_s);
    let mut honesty = Honesty::default();
    for seed in seeds {
        let mut state = start.clone();
        let mut missing = Draws::new(1000 + seed);
        for (row, (rho, strain)) in simulate(moves, dt_s, 60.0, seed).into_iter().enumerate() {
            let reading = (!third_missing || missing.uniform() > 1.0 / 3.0).then(|| Reading::from(rho));
            if let Ok(advanced) = estimator.advance(&state, &prepared, reading) {
                state = advanced.state;
            }
            if row as f64 * dt_s >= 5.0 {
                honesty.add(&state.moments(), strain);
            }
        }
    }
    honesty
}

/// Returns the state after rows that each have this reading, or none.
///
/// # Panics
/// If the estimator rejects a step.
pub fn after_rows<E, const N: usize, const L: usize>(
    estimator: E,
    start: &E::State,
    dt_s: f64,
    readings: impl IntoIterator<Item = Option<f64>>,
) -> E::State
where
    E: Estimator<f64, N, L>,
{
    let estimator = Substeps(estimator);
    let prepared = estimator.prepare(dt_s);
    readings.into_iter().fold(start.clone(), |state, reading| {
        match estimator.advance(&state, &prepared, reading.map(Reading::from)) {
            Ok(advanced) => advanced.state,
            Err(error) => unreachable!("{error}"),
        }
    })
}

impl Honesty {
    fn add<const N: usize, const L: usize>(&mut self, belief: &Belief<f64, N, L>, strain: f64) {
        let (error, variance) = (belief.mean[0] - strain, belief.covariance[(0, 0)]);
        self.rows += 1.0;
        self.inside += f64::from(u8::from(error * error < 3.841_458_820_694_124 * variance));
        self.squares += error * error;
        self.deviations += variance.sqrt();
    }
}
