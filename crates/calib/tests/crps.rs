//! The continuous ranked probability score against its definition.

use ohmstrain_calib::ScoredRow;

/// Returns the normal distribution function by Simpson's rule over the density, from the mean on.
fn distribution(z: f64) -> f64 {
    let steps = 2000;
    let h = z / f64::from(steps);
    let density = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
    let inner: f64 = (1..steps).map(|k| f64::from(2 + 2 * (k % 2)) * density(f64::from(k) * h)).sum();
    0.5 + h / 3.0 * (density(0.0) + inner + density(z))
}

/// Returns ∫ (F(x) - 1{x ≥ truth})² dx, by the midpoint rule over 12 standard deviations to each side of mean and
/// truth, split at the jump.
fn by_definition(mean: f64, sd: f64, truth: f64) -> f64 {
    let (low, high) = (mean.min(truth) - 12.0 * sd, mean.max(truth) + 12.0 * sd);
    let integral = |from: f64, to: f64, step: f64| {
        let cells = 4000;
        let width = (to - from) / f64::from(cells);
        let at = |k: i32| distribution((from + (f64::from(k) + 0.5) * width - mean) / sd) - step;
        (0..cells).map(|k| at(k).powi(2) * width).sum::<f64>()
    };
    integral(low, truth, 0.0) + integral(truth, high, 1.0)
}

#[test]
fn the_ranked_probability_score_is_its_integral() {
    for (mean, sd, truth) in [(0.1, 0.02, 0.1), (0.1, 0.02, 0.13), (0.2, 0.05, -0.1), (3.0, 1.5, 2.0)] {
        let rows = [ScoredRow { time_s: 0.0, truth, strain: mean, sd: Some(sd) }];
        let scores = ohmstrain_calib::score(&rows).unwrap();
        let expected = by_definition(mean, sd, truth);
        // The midpoint rule's error is width² / 24 · |f'| at the ends of each part, at most (0.012 sd)² / 24 · 0.4/sd.
        assert!((scores.crps - expected).abs() < 3e-6 * sd, "{} is not {expected}", scores.crps);
        assert!((scores.width_95.unwrap() - 2.0 * 1.959_963_984_540_054 * sd).abs() < 1e-12 * sd);
    }
}

#[test]
fn without_a_deviation_it_is_the_absolute_error() {
    let row = |truth: f64, strain: f64| ScoredRow { time_s: 0.0, truth, strain, sd: None };
    let scores = ohmstrain_calib::score(&[row(0.0, 0.1), row(2.0, 1.7)]).unwrap();
    assert!((scores.crps - 0.2).abs() < 1e-12 && (scores.crps_percent_fs - 10.0).abs() < 1e-10);
    assert_eq!((scores.width_95, scores.width_95_percent_fs), (None, None));
}

/// Errors that are too large and intervals that are too wide both cost: the best standard deviation is that of the
/// error.
#[test]
fn neither_wide_nor_narrow_pays() {
    // Errors of alternating sign, ±0.1.
    let score = |sd: f64| {
        let row = |k: u32| ScoredRow {
            time_s: f64::from(k),
            truth: f64::from(k),
            strain: f64::from(k) + if k.is_multiple_of(2) { 0.1 } else { -0.1 },
            sd: Some(sd),
        };
        ohmstrain_calib::score(&(0..10).map(row).collect::<Vec<_>>()).unwrap().crps
    };
    assert!(score(0.1) < score(0.01) && score(0.1) < score(1.0));
}
