//! `refine`: the noise of readings is recovered from a wrong start; and refusals.

use std::fmt::Write;

use crate::common::{Bench, Run};
use ohmstrain_bench_data::simulate::{Disturbances, Material, Protocol, SimulationSettings, simulate};
use ohmstrain_model::{Branch, Direction, Gauge, Motion, Phase, StrainRange, SwitchedModel, Transition};
use ohmstrain_sensor::{EstimatorKind, LawParams, MotionParams, NoiseParams, SensorParams};
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const REST_OHM: f64 = 1600.0;
const STEP_S: f64 = 0.05;
const TRUE_NOISE: NoiseParams =
    NoiseParams { reading_sd: 1e-2, reading_time_s: 0.0, branch_sd: 0.0, baseline_sd: 0.1, baseline_time_s: 10.0 };
const TRUE_MOTION: MotionParams =
    MotionParams { rate_time_s: 0.5, rate_sd_per_s: 0.2, strain_mean: 0.15, strain_sd: 0.08 };

/// Returns a linear law that is the same in both directions, for which the filter and its likelihood are exact.
fn linear_law() -> LawParams {
    LawParams {
        extend_viscosity_s: 0.02,
        retract_viscosity_s: 0.02,
        range: StrainRange { lower: -1.0, upper: 1.5 },
        gauge: Gauge::Polynomial { coefficients: [1.8, 0.0, 0.0] },
        branches: vec![branch(4.0, [0.6, 0.6], [0.0, 0.0])],
    }
}

fn branch(tau_s: f64, gains: [f64; 2], slopes: [f64; 2]) -> Branch<f64> {
    Branch {
        tau_s,
        extend_gain: gains[0],
        retract_gain: gains[1],
        extend_gain_slope: slopes[0],
        retract_gain_slope: slopes[1],
    }
}

/// Draws a recording from the model itself, without a reference.
fn drawn(rows: usize) -> String {
    let MotionParams { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = TRUE_MOTION;
    let motion = Motion::ornstein_uhlenbeck(rate_time_s, rate_sd_per_s, strain_mean, strain_sd).unwrap();
    let model =
        SwitchedModel::<f64, 1, 4>::new(linear_law().to_model().unwrap(), motion, TRUE_NOISE.to_model()).unwrap();
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let (mut state, variance) = model.initial_distribution();
    for i in 0..4 {
        state[i] += variance[i].sqrt() * normal();
    }
    let (step, direction) = (model.prepare(STEP_S), Direction::Known(Phase::Extend));
    let mut text = "time_s,resistance_ohm\n".to_string();
    for row in 0..rows {
        let observation = model.observe(&state, direction);
        let relative = observation.value + observation.variance.sqrt() * normal();
        writeln!(text, "{},{}", row as f64 * STEP_S, REST_OHM * (1.0 + relative)).unwrap();
        let transition: Transition<f64, 4, 10> = model.transition(&step, &state, direction);
        // The noise of strain, rate and the branch, which does not wander, has rank two, hence a root by eigenvalues.
        let eigen = transition.noise.to_matrix().symmetric_eigen();
        state = transition.mean;
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            state += vector * (value.max(0.0).sqrt() * normal());
        }
    }
    text
}

/// Writes the calibrated sensor's file with another law, and noise and motion for the extended Kalman filter.
fn write_sensor(bench: &Bench, law: LawParams, noise: NoiseParams, motion: MotionParams) {
    let mut params = read_sensor(bench, "sensor.toml");
    (params.law, params.rest_reading) = (law, REST_OHM);
    let ekf = params.estimators.get_mut(&EstimatorKind::Ekf).unwrap();
    (ekf.noise, ekf.motion) = (noise, motion);
    bench.write("start.toml", toml::to_string(&params).unwrap());
}

fn read_sensor(bench: &Bench, name: &str) -> SensorParams {
    toml::from_str(&bench.read(name)).unwrap()
}

fn ekf_noise(params: &SensorParams) -> NoiseParams {
    params.estimators[&EstimatorKind::Ekf].noise
}

/// Returns the cells of a parameter's row in the table.
fn row<'a>(printed: &'a str, parameter: &str) -> Vec<&'a str> {
    let line = printed.lines().find(|line| line.contains(&format!("| {parameter} "))).unwrap();
    line.trim_matches('|').split('|').map(str::trim).collect()
}

/// Returns the log-likelihood before and after.
fn log_likelihoods(printed: &str) -> [f64; 2] {
    let line = printed.lines().find(|line| line.starts_with("log-likelihood")).unwrap();
    let (_, numbers) = line.split_once(": ").unwrap();
    let (before, after) = numbers.split_once(", ").unwrap();
    [before, after].map(|text| text.split(' ').next().unwrap().parse().unwrap())
}

/// Asserts success, and returns stdout.
#[track_caller]
fn done(run: &Run) -> &str {
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let trust = "ohmstrain: warning: the likelihood of readings trusts the law: where the law is wrong, intervals of \
                 strain are too narrow; where a reference exists, use calibrate\n";
    assert_eq!(run.warnings.last().unwrap(), trust);
    &run.stdout
}

const REFINE: [&str; 6] = ["refine", "drawn.csv", "--sensor", "start.toml", "-o", "refined.toml"];

#[test]
fn the_noise_that_was_drawn_is_found_from_a_start_three_times_off() {
    let bench = Bench::calibrated();
    bench.write("drawn.csv", drawn(1500));
    let noise = NoiseParams {
        reading_sd: 3e-2,
        reading_time_s: 0.0,
        branch_sd: 0.0,
        baseline_sd: 0.033,
        baseline_time_s: 30.0,
    };
    let motion = MotionParams { rate_time_s: 1.5, rate_sd_per_s: 0.067, strain_mean: 0.15, strain_sd: 0.08 };
    write_sensor(&bench, linear_law(), noise, motion);
    let run = bench.run(&REFINE);
    let printed = done(&run);
    assert_eq!(run.stderr, "");

    let [before, after] = log_likelihoods(printed);
    assert!(after > before, "{printed}");
    for (name, truth) in [("reading_sd", 1e-2), ("rate_sd_per_s", 0.2)] {
        let cells = row(printed, name);
        let (found, error): (f64, f64) = (cells[2].parse().unwrap(), cells[3].parse().unwrap());
        // The data are drawn from the model, so that the logarithm is normal around the truth; four standard errors contain all
        // but 6e-5 of the draws.
        assert!((found / truth).ln().abs() <= 4.0 * error, "{printed}");
        let (lower, upper) = cells[4].split_once(" to ").unwrap();
        let (lower, upper): (f64, f64) = (lower.parse().unwrap(), upper.parse().unwrap());
        assert!(lower < found && found < upper, "{printed}");
    }
    assert!(printed.contains("held: branch_sd\n"), "{printed}");

    // Nothing else has changed, and the file agrees with the table.
    let (mut expected, refined) = (read_sensor(&bench, "start.toml"), read_sensor(&bench, "refined.toml"));
    let ekf = expected.estimators.get_mut(&EstimatorKind::Ekf).unwrap();
    let found = refined.estimators[&EstimatorKind::Ekf];
    assert_ne!((ekf.noise, ekf.motion), (found.noise, found.motion));
    (ekf.noise, ekf.motion) = (found.noise, found.motion);
    expected.default_estimator = EstimatorKind::Ekf;
    assert_eq!(expected, refined);
    assert_eq!(row(printed, "reading_sd")[2], format!("{:.4e}", found.noise.reading_sd));

    // A search from the last result stays at that maximum.
    let repeat = ["refine", "drawn.csv", "--sensor", "refined.toml", "-o", "again.toml"];
    let run = bench.run(&repeat);
    let [start, end] = log_likelihoods(done(&run));
    assert!((start - after).abs() < 2e-3 && (end - after).abs() < 2e-3, "{start} {end} {after}");
    let moved = ekf_noise(&read_sensor(&bench, "again.toml")).reading_sd / found.noise.reading_sd;
    // Both searches end within 1e-8 standard errors.
    assert!((moved - 1.0).abs() < 1e-6, "{moved}");
}

/// Returns the law of the simulator's `ecoflex-00-30`, `matched.rs`.
fn matched_law() -> LawParams {
    LawParams {
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.02,
        range: StrainRange { lower: 0.0, upper: 0.6 },
        gauge: Gauge::DecayingExponential { slope: 4.0, decay_strain: 0.21 },
        branches: vec![branch(3.5, [0.75, -0.9], [-1.0, -0.3]), branch(45.0, [0.45, -0.35], [-0.9, -0.2])],
    }
}

#[test]
fn the_white_noise_of_the_bench_comes_nearer_though_the_bench_does_not_move_as_the_model_does() {
    const WHITE_SD: f64 = 4e-3;
    let bench = Bench::calibrated();
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        sample_rate_hz: 20.0,
        disturbances: Disturbances { white_sd: WHITE_SD, ..Disturbances::NONE },
        ..SimulationSettings::new(Material::Ecoflex0030, Protocol::Mixed { duration_s: 50.0 })
    };
    let mut text = Vec::new();
    simulate(&settings).unwrap().write(&mut text).unwrap();
    bench.write("drawn.csv", text);
    let noise = NoiseParams {
        reading_sd: 3.0 * WHITE_SD,
        reading_time_s: 0.0,
        branch_sd: 1e-3,
        baseline_sd: 3e-3,
        baseline_time_s: 8.0,
    };
    let motion = MotionParams { rate_time_s: 1.0, rate_sd_per_s: 0.1, strain_mean: 0.15, strain_sd: 0.1 };
    write_sensor(&bench, matched_law(), noise, motion);
    let run = bench.run(&REFINE);
    let printed = done(&run);
    assert_eq!(run.stderr, "ohmstrain: drawn.csv:8: the reference in `strain` is not used; calibrate would use it\n");
    let [before, after] = log_likelihoods(printed);
    assert!(after > before, "{printed}");
    // Ramps and holds are not the motion of the model, and a filter of one Gaussian is not exact for a law of two directions.
    // Standard errors assume both, and do not reach the truth; the result must be nearer to it than the start.
    let found: f64 = row(printed, "reading_sd")[2].parse().unwrap();
    assert!((found / WHITE_SD).ln().abs() < 3_f64.ln(), "{printed}");
}

#[test]
fn the_same_input_gives_the_same_output_and_only_readings_count() {
    let bench = Bench::calibrated();
    let refine = |trace: &str, output: &str| {
        let flags = ["--sensor", "sensor.toml", "--until", "60", "--estimator", "ekf", "-o", output];
        let run = bench.run(&[&["refine", trace][..], &flags[..]].concat());
        done(&run);
        (run.stdout, bench.read(output))
    };
    let first = refine("trace.csv", "first.toml");
    assert_eq!(first, refine("trace.csv", "second.toml"));
    // A missing reference changes nothing.
    bench.write("bare.csv", bench.read("trace.csv").replace(",strain", ",remark"));
    assert_eq!(first, refine("bare.csv", "third.toml"));
}

#[test]
fn many_rows_are_thinned_with_a_message() {
    let bench = Bench::calibrated();
    bench.write("drawn.csv", drawn(3001));
    write_sensor(&bench, linear_law(), TRUE_NOISE, TRUE_MOTION);
    let run = bench.run(&REFINE);
    assert!(done(&run).contains("log-likelihood of 1501 readings: "), "{}", run.stdout);
    let message = "ohmstrain: drawn.csv: column `resistance_ohm`: 1501 of 3001 rows are used, one in 2\n";
    assert_eq!(run.stderr, message);
}

#[test]
fn only_the_parameters_asked_for_move() {
    let bench = Bench::calibrated();
    let refine = ["refine", "trace.csv", "--sensor", "sensor.toml", "--until", "60", "-o", "refined.toml"];
    let run = bench.run(&[&refine[..], &["--parameters", "rate_time_s,rate_sd_per_s"]].concat());
    assert!(done(&run).contains("held: reading_sd, branch_sd, baseline_sd, baseline_time_s\n"), "{}", run.stdout);
    let (before, after) = (read_sensor(&bench, "sensor.toml"), read_sensor(&bench, "refined.toml"));
    assert_eq!(ekf_noise(&before), ekf_noise(&after));
    assert_ne!(before.estimators[&EstimatorKind::Ekf].motion, after.estimators[&EstimatorKind::Ekf].motion);
}

#[test]
fn what_cannot_be_refined_is_refused_and_nothing_is_written() {
    let bench = Bench::calibrated();
    let mut five = read_sensor(&bench, "sensor.toml");
    five.law.branches = vec![five.law.branches[0]; 5];
    bench.write("five.toml", toml::to_string(&five).unwrap());
    let mut silent = read_sensor(&bench, "sensor.toml");
    silent.estimators.get_mut(&EstimatorKind::Ekf).unwrap().noise.reading_sd = -1.0;
    let silent = toml::to_string(&silent).unwrap();
    let line = 1 + silent.lines().position(|line| line == "reading_sd = -1.0").unwrap();
    let negative = format!(
        "negative.toml:{line}: column 14: field `estimators.ekf.noise.reading_sd`: expected 0 to 1e6, found -1"
    );
    bench.write("negative.toml", silent);
    let trace = bench.read("trace.csv");
    bench.write("word.csv", "time_s,resistance_ohm\n0,1600\n0.1,high\n");
    bench.write("ratio.csv", trace.replace("resistance_ohm", "resistance_ratio"));
    let header = 1 + trace.lines().position(|line| line.starts_with("time_s")).unwrap();
    let unit = format!(
        "ratio.csv:{header}: column `resistance_ratio`: expected `resistance_ohm` as in the sensor's calibration, found \
         `resistance_ratio`"
    );
    let mut no_branch = read_sensor(&bench, "sensor.toml");
    no_branch.law.branches.clear();
    bench.write("branchless.toml", toml::to_string(&no_branch).unwrap());
    let cases: [(&[&str], i32, &str); 9] = [
        (
            &["trace.csv", "--sensor", "branchless.toml", "--parameters", "reading_sd,branch_sd"],
            2,
            "--parameters: branch_sd is without effect in branchless.toml and cannot be moved",
        ),
        (
            &["trace.csv", "--sensor", "sensor.toml", "--estimator", "ukf"],
            2,
            "--estimator: expected ekf, the only one to refine, found ukf",
        ),
        (
            &["trace.csv", "--sensor", "sensor.toml", "--until", "3"],
            4,
            "trace.csv: expected at least 60 readings, found 15",
        ),
        (
            &["trace.csv", "--sensor", "sensor.toml", "--from", "500"],
            4,
            "trace.csv: no row is left by --from 500; the recording goes from 0 to 400 s",
        ),
        (&["ratio.csv", "--sensor", "sensor.toml"], 4, &unit),
        (
            &["word.csv", "--sensor", "sensor.toml"],
            4,
            "word.csv:3: column `resistance_ohm`: expected a number, found `high`",
        ),
        (&["trace.csv", "--sensor", "five.toml"], 4, "five.toml: a law with 5 branches; at most 4 are supported"),
        (&["trace.csv", "--sensor", "negative.toml"], 4, &negative),
        (
            &["trace.csv", "--sensor", "word.csv"],
            4,
            "word.csv is a recording, not a sensor file: give --sensor what `ohmstrain calibrate` wrote, and the recording by \
             itself",
        ),
    ];
    let old = "format = 9\nmade_by = \"ohmstrain 0.0.1\"\n";
    bench.write("old.toml", old);
    let before = bench.files();
    for (flags, code, message) in cases {
        let run = bench.run(&[&["refine"], flags, &["-o", "old.toml"]].concat());
        run.fails(code, message);
        assert_eq!((run.stdout.as_str(), bench.files()), ("", before.clone()), "{message}");
        assert_eq!(bench.read("old.toml"), old);
    }
    let unknown = ["refine", "trace.csv", "--sensor", "sensor.toml", "--parameters", "colour", "-o", "old.toml"];
    let run = bench.run(&unknown);
    assert!(run.stderr.contains("'colour' for '--parameters") && run.code == Some(2), "{}", run.stderr);
    let run = bench.run(&["refine", "trace.csv", "--sensor", "sensor.toml", "--until", "20", "-o", "none/new.toml"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(1), ""), "{}", run.stderr);
    assert_eq!(bench.files(), before);
}
