//! Coverage of the intervals of a law's parameters: the fraction that contains the true parameters.
//!
//! The table in `docs/parameter-coverage.md` comes from
//! `cargo test --release -p ohmstrain-calib --test all parameter_coverage:: -- --ignored --nocapture`.

use std::f64::consts::TAU;

use ohmstrain_calib::{GaugeFamily, LawOptions, Samples, fit_law, identifiability};
use ohmstrain_model::{Branch, Gauge, StrainRange};
use ohmstrain_sensor::{LawParams, Uncertainty};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const REST_OHM: f64 = 1500.0;
/// Readings ten times a second for two hundred seconds.
const ROWS: usize = 2000;
/// Standard deviation of the noise, relative to R₀, and its correlation from row to row, with a correlation time of 0.3
/// s.
const NOISE: f64 = 2e-3;
const MEMORY: f64 = 0.7;
/// Half the width of a 95 % interval, in standard errors.
const NORMAL: f64 = 1.959_964;

fn law() -> LawParams {
    let branch =
        Branch { tau_s: 6.0, extend_gain: 0.5, retract_gain: -0.3, extend_gain_slope: -0.4, retract_gain_slope: 0.3 };
    LawParams {
        extend_viscosity_s: 0.05,
        retract_viscosity_s: -0.02,
        range: StrainRange { lower: 0.0, upper: 0.32 },
        gauge: Gauge::Polynomial { coefficients: [1.8, -1.1, 0.4] },
        branches: vec![branch],
    }
}

/// Returns the true parameters, by the names of the fit.
fn truth(name: &str) -> f64 {
    let law = law();
    let Gauge::Polynomial { coefficients } = law.gauge else { unreachable!() };
    let branch = law.branches[0];
    match name {
        "rest_reading" => REST_OHM,
        "gauge.coefficients[0]" => coefficients[0],
        "gauge.coefficients[1]" => coefficients[1],
        "gauge.coefficients[2]" => coefficients[2],
        "extend_viscosity_s" => law.extend_viscosity_s,
        "retract_viscosity_s" => law.retract_viscosity_s,
        "branches[0].tau_s" => branch.tau_s,
        "branches[0].extend_gain" => branch.extend_gain,
        "branches[0].retract_gain" => branch.retract_gain,
        "branches[0].extend_gain_slope" => branch.extend_gain_slope,
        "branches[0].retract_gain_slope" => branch.retract_gain_slope,
        other => unreachable!("{other}"),
    }
}

/// Simulates the law along a smooth strain, one explicit Euler step of two milliseconds at a time.
fn noiseless() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let strain_at = |t: f64| {
        0.16 + 0.09 * (TAU * t / 23.0).sin() + 0.04 * (TAU * t / 7.3 + 1.0).sin() + 0.03 * (TAU * t / 3.1).sin()
    };
    let (law, inner) = (law(), 2e-3);
    let (branch, mut relaxation) = (law.branches[0], 0.0);
    let (mut time_s, mut ratio, mut strains) = (vec![], vec![], vec![]);
    for step in 0..ROWS * 50 {
        let t = step as f64 * inner;
        let (strain, rate) = (strain_at(t), (strain_at(t + inner) - strain_at(t - inner)) / (2.0 * inner));
        if step % 50 == 0 {
            let viscosity = if rate > 0.0 { law.extend_viscosity_s } else { law.retract_viscosity_s };
            let gauge = 1.8 * strain - 1.1 * strain.powi(2) + 0.4 * strain.powi(3);
            time_s.push(t);
            ratio.push(1.0 + gauge + viscosity * rate + relaxation);
            strains.push(strain);
        }
        let middle = strain_at(t + 0.5 * inner);
        let gain = if rate > 0.0 {
            branch.extend_gain + branch.extend_gain_slope * middle
        } else {
            branch.retract_gain + branch.retract_gain_slope * middle
        };
        relaxation += inner * (-relaxation / branch.tau_s) + gain * (strain_at(t + inner) - strain);
    }
    (time_s, ratio, strains)
}

/// Counts of intervals that covered the truth, parameter by parameter, with estimates and errors.
#[derive(Default)]
struct Tally {
    names: Vec<String>,
    held: Vec<usize>,
    estimates: Vec<Vec<f64>>,
    errors: Vec<Vec<f64>>,
}

impl Tally {
    fn add(&mut self, found: &Uncertainty) {
        self.names.clone_from(&found.names);
        self.held.resize(found.names.len(), 0);
        for (i, name) in found.names.iter().enumerate() {
            let off = (found.values[i] - truth(name)).abs();
            self.held[i] += usize::from(off <= NORMAL * found.standard_errors[i]);
        }
        self.estimates.push(found.values.clone());
        self.errors.push(found.standard_errors.clone());
    }

    fn column(rows: &[Vec<f64>], i: usize) -> (f64, f64) {
        let mean = rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64;
        let square = rows.iter().map(|row| (row[i] - mean).powi(2)).sum::<f64>() / (rows.len() - 1) as f64;
        (mean, square.sqrt())
    }

    /// Returns the coverage in per cent, mean standard error over scatter, bias over scatter.
    fn summary(&self, i: usize) -> (f64, f64, f64) {
        let (mean, scatter) = Self::column(&self.estimates, i);
        let share = 100.0 * self.held[i] as f64 / self.estimates.len() as f64;
        (share, Self::column(&self.errors, i).0 / scatter, (mean - truth(&self.names[i])) / scatter)
    }
}

/// Visits `count` recordings, each with the noise of its own seed.
fn for_each_recording(count: u64, mut visit: impl FnMut(&Samples)) {
    let (time_s, ratio, strain) = noiseless();
    for seed in 0..count {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut noise = 0.0;
        let noisy = |ratio: &f64| {
            let shock: f64 = StandardNormal.sample(&mut rng);
            noise = MEMORY * noise + NOISE * (1.0 - MEMORY * MEMORY).sqrt() * shock;
            REST_OHM * (ratio + noise)
        };
        let reading: Vec<f64> = ratio.iter().map(noisy).collect();
        visit(&Samples::new(&time_s, &reading, &strain).unwrap());
    }
}

#[test]
fn intervals_without_the_ridge_hold_the_truth() {
    let mut tally = Tally::default();
    for_each_recording(40, |samples| tally.add(&identifiability(&[*samples], &law()).unwrap().parameters));
    for (i, name) in tally.names.iter().enumerate() {
        let (share, error, bias) = tally.summary(i);
        println!("{name}: {share:.0} %, error over scatter {error:.2}, bias over scatter {bias:+.2}");
        // Binomial with 40 draws of 0.95: fewer than 33 have a probability of 1e-4, for each of eleven parameters.
        assert!(tally.held[i] >= 33, "{name}: {} of 40", tally.held[i]);
        // The deviation of 40 draws is known to 1/√78 = 11 %: errors must be right to four of those.
        assert!((0.65..=1.6).contains(&error), "{name}: {error}");
    }
}

#[test]
#[ignore = "makes docs/parameter-coverage.md; minutes in a debug build"]
fn table_of_coverage() {
    const RECORDINGS: u64 = 300;
    let options = LawOptions { branches: 1, gauge: GaugeFamily::Polynomial };
    let mut tally = Tally::default();
    for_each_recording(RECORDINGS, |samples| {
        let law = fit_law(&[*samples], options).unwrap().law.law;
        tally.add(&identifiability(&[*samples], &law).unwrap().parameters);
    });
    println!("| parameter | truth | coverage | se / scatter | bias / scatter |");
    println!("|---|---|---|---|---|");
    for (i, name) in tally.names.iter().enumerate() {
        let (share, error, bias) = tally.summary(i);
        println!("| `{name}` | {} | {share:.1} % | {error:.2} | {bias:+.2} |", truth(name));
    }
}
