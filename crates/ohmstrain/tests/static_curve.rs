//! A sensor without memory: calibration finds that a static curve is best, and uses it.

use ohmstrain::{Calibration, EstimatorKind, Recording, Sensor};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const REST_OHM: f64 = 1000.0;
/// Standard deviation of the noise.
const NOISE_OHM: f64 = 1.0;
const UPPER: f64 = 0.3;

/// Times, s, readings, Ω, and strains.
type Rows = (Vec<f64>, Vec<f64>, Vec<f64>);

/// A hundred seconds of a sum of sines, over the whole range, with the readings of a cubic gauge.
fn rows(seed: u64, reversed: bool) -> Rows {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let time_s: Vec<f64> = (0..1000).map(|k| 0.1 * f64::from(k)).collect();
    let sum = |t: f64| [0.31, 0.57, 0.83, 1.21].iter().map(|rate| (rate * t).sin()).sum::<f64>();
    let motion: Vec<f64> = time_s.iter().map(|t| sum(if reversed { 99.9 - t } else { *t })).collect();
    let (low, high) = motion.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    let strain: Vec<f64> = motion.iter().map(|x| UPPER * (x - low) / (high - low)).collect();
    let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
    let reading =
        strain.iter().map(|s| REST_OHM * (1.0 + 2.0 * s - 1.5 * s.powi(2) + 3.0 * s.powi(3)) + NOISE_OHM * noise());
    let reading = reading.collect();
    (time_s, reading, strain)
}

fn calibrated() -> Sensor {
    let (time_s, reading, strain) = rows(1, false);
    let calibrated = Calibration::new().run(&[Recording::new(&time_s, &reading, &strain).unwrap()]).unwrap();
    let findings = calibrated.findings.unwrap();
    let errors = [findings.filter.rmse, findings.static_cubic.rmse];
    // The same cubic, but for readings that surprise the filter beside it.
    assert!(errors[0] < 1.05 * errors[1], "{errors:?}");
    calibrated.sensor
}

#[test]
fn the_default_is_what_is_best_on_held_out_quarters() {
    let sensor = calibrated();
    assert_eq!(sensor.params().default_estimator, EstimatorKind::StaticCubic);
    let (time_s, reading, strain) = rows(2, true);
    let mut filter = sensor.filter().build().unwrap();
    let cubic = sensor.params().static_cubic;
    let (mut squares, mut covered, mut on_curve) = (0.0, 0, 0);
    for ((t, r), truth) in time_s.iter().zip(&reading).zip(&strain) {
        let row = filter.step(*t, *r).unwrap();
        squares += (row.strain - truth).powi(2) / time_s.len() as f64;
        covered += usize::from((row.strain - truth).abs() < 1.96 * row.strain_sd);
        // The polynomial by its powers.
        let z = (r - cubic.reading_centre) / cubic.reading_scale;
        let powers: f64 =
            cubic.coefficients.iter().zip(0..).map(|(coefficient, power)| coefficient * z.powi(power)).sum();
        on_curve += usize::from((row.strain - powers.clamp(0.0, UPPER)).abs() < 1e-9);
    }
    // The gauge's slope is least where it is 2 - 3 s + 9 s² = 1.75, at a sixth. The inverse of a cubic is no cubic: within half of that.
    let of_noise = NOISE_OHM / (1.75 * REST_OHM);
    assert!(squares.sqrt() < 1.5 * of_noise, "{} where noise alone gives {of_noise}", squares.sqrt());
    // 950 rows with a standard deviation of 7, if their errors are independent; those of the curve are not, and widen the interval.
    assert!(covered > 929, "{covered} of 1000");
    assert!(on_curve > 950, "{on_curve} of 1000");
}

#[test]
fn rows_without_a_reading_are_the_filters_and_the_smoother_is_no_worse() {
    let sensor = calibrated();
    let (time_s, mut reading, strain) = rows(3, true);
    reading[400..430].fill(f64::NAN);
    let mut filter = sensor.filter().build().unwrap();
    let rows: Vec<_> = time_s.iter().zip(&reading).map(|(t, r)| filter.step(*t, *r).unwrap()).collect();
    // Doubts of a pause fade with a time constant of ten seconds.
    let widths: Vec<f64> = [399, 400, 429, 600].map(|k: usize| rows[k].strain_sd).to_vec();
    assert!(widths[0] < widths[1] && widths[1] < widths[2] && widths[3] < 2.0 * widths[0], "{widths:?}");
    assert!((rows[429].strain - strain[429]).abs() < 3.0 * rows[429].strain_sd);
    let smoothed = sensor.filter().smooth(&time_s, &reading).unwrap();
    let error = |rows: &[ohmstrain::Estimate]| -> f64 {
        let known = (0..rows.len()).filter(|k| !(400..430).contains(k));
        known.map(|k| (rows[k].strain - strain[k]).powi(2)).sum::<f64>().sqrt()
    };
    assert!(error(&smoothed) < 1.05 * error(&rows), "{} {}", error(&smoothed), error(&rows));
}

/// A sensor whose default is the curve has a correction only if that smooths better. A caller's choice is the caller's.
#[test]
fn the_corrected_filter_smooths_for_the_curve_only_as_its_default() {
    let text = include_str!("../../../tests/fixtures/representative.toml");
    let with_default = |name: &str| {
        let changed = text.replace("default_estimator = \"corrected\"", &format!("default_estimator = \"{name}\""));
        Sensor::from_toml(&changed).unwrap()
    };
    let (time_s, reading, _) = rows(4, false);
    // Within the readings of that sensor.
    let reading: Vec<f64> = reading.iter().map(|ohm| 3.4 * ohm).collect();
    let smoothed = |sensor: &Sensor, kind: Option<EstimatorKind>, is_corrected: bool| -> Vec<f64> {
        let builder = kind.map_or_else(|| sensor.filter(), |kind| sensor.filter().estimator(kind));
        let builder = if is_corrected { builder } else { builder.without_correction() };
        builder.smooth(&time_s, &reading).unwrap().iter().map(|row| row.strain).collect()
    };
    let (usual, of_curve) = (with_default("corrected"), with_default("static-cubic"));
    let corrected = smoothed(&usual, None, true);
    let curve = smoothed(&usual, Some(EstimatorKind::StaticCubic), true);
    assert_ne!(curve, corrected);
    assert_eq!(smoothed(&of_curve, None, true), corrected);
    assert_eq!(smoothed(&of_curve, None, false), curve);
}

#[test]
fn it_can_be_asked_for() {
    let sensor = calibrated();
    let (time_s, reading, strain) = rows(1, false);
    let recording = Recording::new(&time_s, &reading, &strain).unwrap();
    let asked = Calibration::new().estimator(EstimatorKind::StaticCubic).run(&[recording]).unwrap().sensor;
    assert_eq!(asked.params().default_estimator, EstimatorKind::StaticCubic);
    assert_eq!(asked.params().static_cubic, sensor.params().static_cubic);
    assert!(asked.params().correction.is_none());
    // Another estimator is the caller's choice, whatever is best.
    let other = Calibration::new().estimator(EstimatorKind::Ekf).run(&[recording]).unwrap().sensor;
    assert_eq!(other.params().default_estimator, EstimatorKind::Ekf);
}
