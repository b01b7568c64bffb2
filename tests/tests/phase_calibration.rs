//! Calibration of phase probabilities. Data are drawn from the process that the filters assume. Over the rows at which a
//! filter gives a phase a probability between p and p + 0.2, the mean probability must equal the share of rows with that
//! phase. A filter with wrong dwell times must fail.
//!
//! Rows of a run are correlated, runs are independent. Per run, the sum over the rows of a bin of (has the phase) minus
//! (probability given) has mean zero if the probabilities are right. The sum over runs divided by the root of the sum of
//! squares is then standard normal, whatever the correlation within a run (a cluster-robust statistic), and 99.9 % of it
//! lie within ±3.29.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{Belief, Dwell, Estimator, Evidence, Hypotheses, Imm, Mixture, PhaseMixture, Reading, State};
use ohmstrain_model::{Direction, Phase, StrainRange, Transition};
use ohmstrain_tests::{Draws, square_root, switching_sensor};
use statrs::distribution::{ContinuousCDF, Normal};

const RUNS: u64 = 1000;
const ROWS: usize = 40;
const DT_S: f64 = 0.2;
const BINS: usize = 5;
const ANYWHERE: Evidence<f64> =
    Evidence { limits: StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY }, tempering: 1.0 };

/// Returns the durations of the simulated body's phases.
fn true_dwell() -> Dwell<f64> {
    Dwell::new(2.0, 2.0, 0.3).unwrap()
}

fn start() -> Belief<f64, 3, 6> {
    Belief::independent(SVector::zeros(), &[0.0; 3])
}

/// The sensor's own stochastic process: a chain of phases, and within each the model's transition and noise.
struct Process {
    draws: Draws,
    phase: Phase,
    state: SVector<f64, 3>,
    /// Square roots of the process noise in each phase; it does not depend on the state.
    roots: [SMatrix<f64, 3, 3>; 3],
}

impl Process {
    fn new(seed: u64) -> Self {
        let roots = Phase::ALL.map(|phase| square_root(&moved(&SVector::zeros(), phase).noise));
        Self { draws: Draws::new(seed), phase: Phase::Hold, state: SVector::zeros(), roots }
    }

    /// Returns the next phase and reading.
    fn step(&mut self) -> (Phase, f64) {
        let model = switching_sensor();
        let next = self.next_phase();
        if next != Phase::Hold && next != self.phase {
            // The rate is redrawn from the phase's prior.
            let (speed, sd) = (model.motion().phase_rate(), model.motion().stationary_variance()[1].sqrt());
            self.state[1] = if next == Phase::Retract { -speed } else { speed } + sd * self.draws.normal();
        }
        self.phase = next;
        self.state = moved(&self.state, next).mean + self.roots[next.index()] * self.draws.vector::<3>();
        let observation = model.observe(&self.state, Direction::Known(next));
        (next, observation.value + observation.variance.sqrt() * self.draws.normal())
    }

    fn next_phase(&mut self) -> Phase {
        let [extend, hold, _] = true_dwell().probabilities(DT_S)[self.phase.index()];
        match self.draws.uniform() {
            draw if draw < extend => Phase::Extend,
            draw if draw < extend + hold => Phase::Hold,
            _ => Phase::Retract,
        }
    }
}

fn moved(state: &SVector<f64, 3>, phase: Phase) -> Transition<f64, 3, 6> {
    let model = switching_sensor();
    model.transition(&model.prepare(DT_S), state, Direction::Known(phase))
}

/// A statistic of independent runs whose mean should be zero.
#[derive(Clone, Copy, Default)]
struct Clustered {
    sum: f64,
    squares: f64,
    runs: u32,
}

impl Clustered {
    fn add(&mut self, of_run: f64) {
        self.sum += of_run;
        self.squares += of_run * of_run;
        self.runs += 1;
    }

    /// Returns the z-score, which is standard normal if the mean is zero.
    fn z(&self) -> f64 {
        assert!(self.runs >= 100, "too few runs for a normal distribution: {}", self.runs);
        self.sum / self.squares.sqrt()
    }
}

/// Reliability table of a filter, by phase and probability, and its mean NIS minus one.
struct Reliability {
    bins: [[Clustered; BINS]; 3],
    nis: Clustered,
}

impl Reliability {
    fn of<E: Estimator<f64, 3, 6>>(filter: &E, from: &E::State) -> Self {
        let prepared = filter.prepare(DT_S);
        let mut table = Self { bins: [[Clustered::default(); BINS]; 3], nis: Clustered::default() };
        for seed in 0..RUNS {
            let mut process = Process::new(seed);
            let mut state = from.clone();
            let (mut surplus, mut seen, mut nis) = ([[0.0; BINS]; 3], [[false; BINS]; 3], 0.0);
            for _ in 0..ROWS {
                let (truth, reading) = process.step();
                let step = filter.advance(&state, &prepared, Some(Reading::from(reading))).unwrap();
                state = step.state;
                nis += step.innovation.unwrap().nis - 1.0;
                for (phase, probability) in Phase::ALL.into_iter().zip(state.phases().unwrap()) {
                    let bin = ((probability * BINS as f64) as usize).min(BINS - 1);
                    surplus[phase.index()][bin] += f64::from(u8::from(truth == phase)) - probability;
                    seen[phase.index()][bin] = true;
                }
            }
            table.nis.add(nis);
            for (row, (surplus, seen)) in table.bins.iter_mut().zip(surplus.iter().zip(&seen)) {
                for ((bin, surplus), seen) in row.iter_mut().zip(surplus).zip(seen) {
                    if *seen {
                        bin.add(*surplus);
                    }
                }
            }
        }
        table
    }

    fn z_scores(&self) -> [[f64; BINS]; 3] {
        self.bins.map(|row| row.map(|bin| bin.z()))
    }

    /// Returns the largest deviation in the table.
    fn worst(&self) -> f64 {
        self.z_scores().iter().flatten().fold(0.0, |worst, z| z.abs().max(worst))
    }
}

fn imm(dwell: Dwell<f64>) -> Reliability {
    let filter = Imm::<f64, 1, 3>::new(switching_sensor(), DT_S, dwell, ANYWHERE).unwrap();
    Reliability::of(&filter, &PhaseMixture::single(start(), Phase::Hold))
}

fn hypotheses(dwell: Dwell<f64>) -> Reliability {
    let filter = Hypotheses::<f64, 1, 3, 16>::new(switching_sensor(), DT_S, dwell, ANYWHERE).unwrap();
    Reliability::of(&filter, &Mixture::single(start(), Phase::Hold))
}

/// Returns the two-sided 99.9 % quantile of the standard normal.
fn bound() -> f64 {
    Normal::standard().inverse_cdf(0.9995)
}

#[test]
fn phase_probabilities_mean_what_they_say() {
    for (name, table) in [("imm", imm(true_dwell())), ("hypotheses", hypotheses(true_dwell()))] {
        println!("{name}: {:.1?}, NIS {:.1}", table.z_scores(), table.nis.z());
        assert!(table.worst() < bound(), "{name}: {:.1?}", table.z_scores());
        assert!(table.nis.z().abs() < bound(), "{name}: NIS {}", table.nis.z());
    }
}

#[test]
fn wrong_dwell_times_are_found_out() {
    for factor in [4.0, 0.25] {
        let wrong = Dwell::new(2.0 * factor, 2.0 * factor, 0.3).unwrap();
        for (name, table) in [("imm", imm(wrong)), ("hypotheses", hypotheses(wrong))] {
            println!("{name} × {factor}: {:.1?}", table.z_scores());
            assert!(table.worst() > bound(), "{name}, dwell times × {factor}: {:.1?}", table.z_scores());
        }
    }
}
