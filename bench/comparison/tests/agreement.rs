//! A benchmark of a wrong filter is worthless. On the linear sensor, all filters must equal the Kalman filter, and all
//! smoothers the Rauch-Tung-Striebel smoother.

use nalgebra::SVector;
use ohmstrain_bench_comparison::{
    RecordingPass, adskalman_smoother, every_nonlinear_rival, every_rival, simulated_recording, typed_kalman_smoother,
};
use ohmstrain_bench_filters::{
    DT_S, Filter, GatedSparse, GatedUnscented, LinearModel, NonlinearReference, PackedReference, RANGE, STEPS, Visitor,
    ekf, every_filter, linear_sensor, linearised, readings, sensor, smoother, strain_at,
};
use ohmstrain_ekf::{Belief, Compact, Estimator, Reading, SparseEkf};

/// A filter forgets rounding errors within some hundred steps. A step contributes some 30 ε of quantities that are up to 10⁴
/// times larger than the difference P - K S Kᵀ. That gives 10² · 30 · 10⁴ ε = 7e-9, relative to a strain of 0.1.
const TOLERANCE: f64 = 1e-9;

/// Runs the textbook filter with loops over full matrices, covariance in Joseph's form; returns the strain after every reading.
fn textbook(model: &LinearModel, readings: &[f64]) -> Vec<f64> {
    type Matrix = [[f64; 3]; 3];
    let matrix = |entry: &dyn Fn(usize, usize) -> f64| -> Matrix {
        std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
    };
    let sandwich = |a: &Matrix, p: &Matrix| {
        matrix(&|i, j| (0..3).map(|k| (0..3).map(|l| a[i][k] * p[k][l] * a[j][l]).sum::<f64>()).sum())
    };
    let (f, h) = (&model.transition, &model.gradient);
    let mut x = [0.0; 3];
    let mut p = matrix(&|i, j| if i == j { model.start[i] } else { 0.0 });
    let mut strains = Vec::new();
    for reading in readings {
        x = std::array::from_fn(|i| (0..3).map(|j| f[i][j] * x[j]).sum());
        let carried = sandwich(f, &p);
        p = matrix(&|i, j| carried[i][j] + model.noise[i][j]);
        let spread: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| p[i][j] * h[j]).sum());
        let variance = (0..3).map(|i| h[i] * spread[i]).sum::<f64>() + model.variance;
        let gain = spread.map(|s| s / variance);
        let innovation = reading - (0..3).map(|i| h[i] * x[i]).sum::<f64>();
        x = std::array::from_fn(|i| x[i] + gain[i] * innovation);
        let left = matrix(&|i, j| if i == j { 1.0 } else { 0.0 } - gain[i] * h[j]);
        let kept = sandwich(&left, &p);
        p = matrix(&|i, j| kept[i][j] + gain[i] * model.variance * gain[j]);
        strains.push(x[0]);
    }
    strains
}

struct Compared {
    expected: Vec<f64>,
    seen: Vec<&'static str>,
}

impl Visitor for Compared {
    fn visit(&mut self, name: &'static str, readings: &[f64], mut filter: impl Filter) {
        self.seen.push(name);
        assert_eq!(readings.len(), self.expected.len());
        for (k, (reading, expected)) in readings.iter().zip(&self.expected).enumerate() {
            assert!(filter.step(*reading), "{name}: step {k} failed");
            let apart = (filter.strain() - expected).abs();
            assert!(apart < TOLERANCE, "{name}: {apart:e} apart at step {k}");
        }
    }
}

#[test]
fn all_filters_agree_on_the_linear_sensor() {
    let (model, y) = (linearised(), readings::<1>(STEPS));
    let mut compared = Compared { expected: textbook(&model, &y), seen: Vec::new() };
    every_rival(&model, &mut compared);
    let sensor = linear_sensor();
    compared.visit("hand-written", &y, PackedReference::new(&model));
    compared.visit("ours, sparse", &y, GatedSparse::<1, 3, 6, Compact>::new(sensor));
    compared.visit("ours, sigma points", &y, GatedUnscented::<1, 3, 6>::new(sensor));
    compared.visit("ours, generic", &y, ekf::<1, 3, 6>(sensor));
    assert_eq!(compared.seen.len(), 11);
    // The strain moves, so that agreement is significant.
    let (least, most) = compared.expected.iter().fold((1.0_f64, -1.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
    assert!(most - least > 0.05, "{least} to {most}");
}

/// Tests that our F, Q and H, which are never formed as matrices, equal those given to the others. The moments of an uncertain
/// direction are smooth functions, so that rounding errors stay small.
#[test]
fn all_filters_agree_on_the_sensor_that_is_not_linear() {
    let readings = readings::<1>(STEPS);
    let mut ours = GatedSparse::<1, 3, 6, Compact>::new(sensor());
    let take = |reading: &f64| {
        assert!(ours.step(*reading));
        ours.strain()
    };
    let mut compared = Compared { expected: readings.iter().map(take).collect(), seen: Vec::new() };
    every_nonlinear_rival(&mut compared);
    compared.visit("hand-written", &readings, NonlinearReference::new());
    assert_eq!(compared.seen.len(), 5);
}

#[test]
fn all_smoothers_agree_on_the_linear_sensor() {
    let (model, readings) = (linearised(), readings::<1>(STEPS));
    let vectors: Vec<SVector<f64, 1>> = readings.iter().map(|y| SVector::from([*y])).collect();
    let ours = smoother(linear_sensor());
    let expected: Vec<_> = adskalman_smoother(&model)(&vectors).unwrap().iter().map(|s| s.state()[0]).collect();
    let filtered = textbook(&model, &readings);
    // The last row is the filter's, the others are not: a smoother without effect would not pass.
    assert!((expected[STEPS - 1] - filtered[STEPS - 1]).abs() < TOLERANCE);
    assert!(expected.iter().zip(&filtered).any(|(a, b)| (a - b).abs() > 1e-3));
    let sparse = SparseEkf::<_, Compact, 1, 3>::new(linear_sensor(), DT_S).unwrap();
    let mut smoothed = vec![Belief::<f64, 3, 6>::initial(&linear_sensor())];
    for reading in &readings {
        let mut belief = smoothed[smoothed.len() - 1];
        sparse.step(&mut belief, Some(Reading::from(*reading))).unwrap();
        smoothed.push(belief);
    }
    for k in (1..STEPS).rev() {
        let reading = Some(Reading::from(readings[k]));
        smoothed[k] = sparse.smooth_back(&smoothed[k], &sparse, reading, &smoothed[k + 1]).unwrap();
    }
    for (name, strains) in [
        ("sparse", smoothed[1..].iter().map(|belief| belief.mean[0]).collect::<Vec<_>>()),
        ("in place", ours.in_place(&readings).iter().map(|belief| belief.mean[0]).collect()),
        ("typed-kalman", typed_kalman_smoother(&model)(&readings).unwrap().iter().map(|s| s.x[0]).collect()),
    ] {
        let apart = strains.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < TOLERANCE, "{name}: {apart:e}");
    }
}

/// Tests that every timed filter of the nonlinear sensor takes every reading, and that its strain stays within the range of the
/// law.
#[test]
fn every_filter_takes_every_reading() {
    struct Runs;
    impl Visitor for Runs {
        fn visit(&mut self, name: &'static str, readings: &[f64], mut filter: impl Filter) {
            for reading in readings.iter().cycle().take(5 * STEPS) {
                assert!(filter.step(*reading), "{name}");
                assert!(RANGE.contains(filter.strain()), "{name}: {}", filter.strain());
            }
        }
    }
    every_filter(&mut Runs);
}

/// Tests that the filter of the sensor's own model follows the strain, whose deviation is 0.076. Once the start is forgotten,
/// its own deviation is 0.004; twice that as an error would mean another sensor.
#[test]
fn the_readings_are_those_of_the_sensor() {
    let mut filter = GatedSparse::<1, 3, 6, Compact>::new(sensor());
    let (mut squares, mut counted) = (0.0, 0.0);
    for (k, reading) in readings::<1>(5 * STEPS).into_iter().enumerate() {
        assert!(filter.step(reading));
        if k >= STEPS {
            squares += (filter.strain() - strain_at(k)).powi(2);
            counted += 1.0;
        }
    }
    let error = f64::sqrt(squares / counted);
    let sd = filter.belief().covariance[(0, 0)].sqrt();
    assert!(error < 2.0 * sd, "error {error}, deviation {sd}");
}

#[test]
fn recordings_are_taken_to_their_end() {
    let (recording, pass) = (simulated_recording(), RecordingPass::new());
    // The two paths split an uncertain rate by different densities, so that their strains are close but not equal.
    let apart = (pass.generic(&recording) - pass.sparse(&recording)).abs();
    assert!(apart < 0.02, "{apart}");
}
