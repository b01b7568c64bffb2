//! Calibration on sensors whose law is written down in the test.

use std::cell::OnceCell;
use std::f64::consts::TAU;

use ohmstrain_calib::{
    Calibration, CalibrationError, GaugeFamily, LawFit, LawOptions, Samples, ScoredRow, Stage, calibrate, fit_law,
    identifiability,
};
use ohmstrain_ekf::Reading;
use ohmstrain_sensor::{
    EstimatorKind, LARGEST_SD_SCALE, Quantity, ReadingUnit, SensorError, SensorParams, Start, build_filter,
};

use super::bench::Bench;

/// Returns a small deterministic noise: the fractional parts of multiples of the golden ratio, roughly uniform in ±1.
fn jitter(k: usize) -> f64 {
    2.0 * (k as f64 * 0.618_033_988_749_895).fract() - 1.0
}

/// Simulates the switched law naively, one explicit Euler step of a millisecond at a time.
fn record(rest_ohm: f64, phase: f64, noise: f64) -> Bench {
    let strain_at = |t: f64| 0.15 + 0.08 * (TAU * t / 17.0 + phase).sin() + 0.06 * (TAU * t / 7.3).sin();
    let mut bench = Bench::default();
    let (mut fast, mut slow) = (0.0, 0.0);
    let inner = 1e-3;
    for step in 0..150_000_usize {
        let t = step as f64 * inner;
        let (strain, rate) = (strain_at(t), (strain_at(t + inner) - strain_at(t)) / inner);
        if step % 100 == 0 {
            let viscosity = if rate > 0.0 { 0.02 } else { -0.01 };
            let rho = 1.8 * strain - 1.1 * strain * strain + viscosity * rate + fast + slow;
            bench.time_s.push(t);
            bench.reading.push(rest_ohm * (1.0 + rho + noise * jitter(step / 100)));
            bench.strain.push(strain);
        }
        let (k_fast, k_slow) = if rate > 0.0 { (0.5 - 0.4 * strain, 0.3) } else { (-0.3, -0.2 + 0.3 * strain) };
        fast += inner * (-fast / 4.0 + k_fast * rate);
        slow += inner * (-slow / 30.0 + k_slow * rate);
    }
    bench
}

#[test]
fn the_law_explains_a_sensor_of_its_own_kind() {
    let bench = record(1500.0, 0.0, 1e-3);
    let fit = fit_law(&[bench.samples()], LawOptions::default()).unwrap();
    let rms = |rows: &[f64]| (rows.iter().map(|r| r * r).sum::<f64>() / rows.len() as f64).sqrt();
    // The readings span 0.5 R₀. The ridge costs a few per cent of that, slightly more on held-out blocks.
    assert!(rms(&fit.law.residuals[0]) < 0.015, "{}", rms(&fit.law.residuals[0]));
    assert!(fit.law.cross_validated_error < 0.02, "{}", fit.law.cross_validated_error);
    // Little was recorded at zero strain: the ridge moves R₀ and the gauge's slope together, and only their combination at the recorded
    // strains is determined.
    let taus: Vec<f64> = fit.law.law.branches.iter().map(|branch| branch.tau_s).collect();
    assert!(taus.len() == 2 && taus[0] < taus[1], "{taus:?}");
}

/// The contact fails in one row of fifty, where the reading doubles. That alone adds 3 % of R₀ to the mean of all readings, and a law
/// fitted by least squares moves by as much (0.033, with all weights set to one). With bounded influence it moves by at most a third of
/// that.
#[test]
fn rows_without_contact_do_not_bend_the_law() {
    let bench = record(1500.0, 0.0, 1e-3);
    let mut failing = bench.clone();
    failing.reading.iter_mut().skip(7).step_by(50).for_each(|reading| *reading *= 2.0);
    let fit = |bench: &Bench| fit_law(&[bench.samples()], LawOptions::default()).unwrap().law;
    let (clean, failed) = (fit(&bench), fit(&failing));
    let law = |fit: &LawFit, bench: &Bench, k: usize| bench.reading[k] / fit.rest_readings[0] - fit.residuals[0][k];
    let apart = |k: usize| {
        let (a, b) = (law(&clean, &bench, k), law(&failed, &failing, k));
        a * clean.rest_readings[0] / 1500.0 - b * failed.rest_readings[0] / 1500.0
    };
    let rows = bench.time_s.len();
    let rms = ((0..rows).map(|k| apart(k).powi(2)).sum::<f64>() / rows as f64).sqrt();
    assert!(rms < 0.011, "{rms}");
}

#[test]
fn standard_errors_shrink_with_noise_and_form_a_covariance() {
    let law = fit_law(&[record(1500.0, 0.0, 1e-3).samples()], LawOptions::default()).unwrap().law.law;
    let errors = |noise: f64| identifiability(&[record(1500.0, 0.0, noise).samples()], &law).unwrap().parameters;
    let (quiet, noisy) = (errors(1e-3), errors(0.1));
    assert_eq!(quiet.names[0], "rest_reading");
    assert!(quiet.standard_errors[0] > 0.0 && quiet.standard_errors[0] < noisy.standard_errors[0]);
    for (i, row) in quiet.covariance.iter().enumerate() {
        assert!((row[i].sqrt() - quiet.standard_errors[i]).abs() <= 1e-12 * quiet.standard_errors[i]);
        for (j, value) in row.iter().enumerate() {
            let limit = quiet.standard_errors[i] * quiet.standard_errors[j];
            assert!(value.abs() <= limit * (1.0 + 1e-9), "correlation above one");
        }
    }
}

#[test]
fn recordings_keep_their_own_rest_resistance() {
    let (a, b) = (record(1500.0, 0.0, 1e-3), record(2100.0, 1.0, 1e-3));
    let fit = fit_law(&[a.samples(), b.samples()], LawOptions::default()).unwrap();
    let ratio = fit.law.rest_readings[1] / fit.law.rest_readings[0];
    assert!((ratio / 1.4 - 1.0).abs() < 0.01, "{ratio}");
}

#[test]
fn every_gauge_family_and_number_of_branches_can_be_fitted() {
    let bench = record(1500.0, 0.0, 1e-3);
    for gauge in [GaugeFamily::Polynomial, GaugeFamily::DecayingExponential, GaugeFamily::Tunnelling] {
        let fit = fit_law(&[bench.samples()], LawOptions { gauge, ..LawOptions::default() }).unwrap();
        assert!(fit.law.cross_validated_error < 0.05, "{gauge:?}: {}", fit.law.cross_validated_error);
    }
    for branches in 0..=4 {
        let fit = fit_law(&[bench.samples()], LawOptions { branches, ..LawOptions::default() }).unwrap();
        assert_eq!(fit.law.law.branches.len(), branches);
    }
}

/// Returns a calibration as the parameters of a sensor.
fn sensor(calibration: &Calibration) -> SensorParams {
    calibration.clone().into_sensor("test", Quantity::Strain, ReadingUnit::Ohm)
}

#[test]
fn calibration_makes_a_filter_that_beats_the_static_inverse_and_knows_how_far() {
    let bench = record(1500.0, 0.0, 2e-3);
    let half = bench.time_s.len() / 2;
    let training = bench.samples().head(half);
    let calibration = calibrate(&[training], &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| ()).unwrap();
    let params = sensor(&calibration);
    let mut filter = build_filter(&params, None, Start::Unknown).unwrap();
    let (mut filtered, mut cubic) = (Vec::new(), Vec::new());
    for k in 0..bench.time_s.len() {
        let reading = bench.reading[k] / params.rest_reading - 1.0;
        filter.step(bench.time_s[k], Some(Reading::from(reading))).unwrap();
        if k >= half {
            let strain = filter.strain();
            filtered.push(ScoredRow {
                time_s: bench.time_s[k],
                truth: bench.strain[k],
                strain: strain.mean,
                sd: Some(strain.sd()),
            });
            let strain = params.static_cubic.strain(bench.reading[k]);
            cubic.push(ScoredRow { time_s: bench.time_s[k], truth: bench.strain[k], strain, sd: None });
        }
    }
    let (filtered, cubic) = (ohmstrain_calib::score(&filtered).unwrap(), ohmstrain_calib::score(&cubic).unwrap());
    assert!(filtered.rmse < 0.5 * cubic.rmse, "{filtered:?} {cubic:?}");
    assert!(filtered.coverage_95.unwrap() > 0.85, "{filtered:?}");
    // The file format keeps everything, to the last bit.
    let text = toml::to_string(&params).unwrap();
    assert_eq!(toml::from_str::<SensorParams>(&text).unwrap(), params);
    // The first reading of a rested sensor determines its R₀: that of the calibration gives the law's R₀, twice that gives twice it.
    let measured = 0.9 * params.rest_reading;
    let params = SensorParams { measured_rest: Some(measured), ..params };
    assert_eq!(params.rest_reading_of(measured), params.rest_reading);
    assert_eq!(params.rest_reading_of(2.0 * measured), 2.0 * params.rest_reading);
    // An interval at its widest is reported.
    assert_eq!(params.widened_most(), [""; 0]);
    let mut wide = params.clone();
    wide.estimators.values_mut().for_each(|of| of.strain_sd_scale = LARGEST_SD_SCALE);
    assert_eq!(wide.widened_most(), ["filter"]);
    // Same samples, same parameters.
    let repeated = calibrate(&[training], &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| ()).unwrap();
    assert_eq!(sensor(&repeated), sensor(&calibration));
}

#[test]
fn the_estimator_that_does_best_becomes_the_default() {
    let bench = record(1500.0, 0.0, 2e-3);
    let kinds = [EstimatorKind::Ekf, EstimatorKind::SignSplit];
    let (mut calls, mut announced) = (0, 0);
    let count = |stage| {
        if let Stage::Noise { done, expected } = stage {
            (calls, announced) = (done, expected);
        }
    };
    let calibration = calibrate(&[bench.samples().head(600)], &[LawOptions::default()], &kinds, None, count).unwrap();
    let params = sensor(&calibration);
    let best = params.estimators[&params.default_estimator].score;
    for kind in kinds {
        // A single Gaussian must be better by 0.1.
        let handicap = if kind == EstimatorKind::Ekf { 0.1 } else { 0.0 };
        assert!(params.estimators[&kind].score + handicap >= best, "{kind:?}");
    }
    // A step of Nelder-Mead evaluates one or two points, and after a shrinkage all corners of the simplex.
    assert!(calls > announced / 2 && calls < 2 * announced, "{calls} of {announced}");
    let nobody = calibrate(&[bench.samples()], &[LawOptions::default()], &[], None, |_| ());
    assert!(matches!(nobody.unwrap_err(), CalibrationError::Unsupported(_)));
}

/// The model is continuous in time: a recording with five times the rows, thinned for the search, gives the same result.
#[test]
fn a_finer_recording_gives_the_same_filter() {
    let coarse = record(1500.0, 0.0, 2e-3);
    let between = |values: &[f64]| -> Vec<f64> {
        let last = values.len() - 1;
        (0..5 * last).map(|k| values[k / 5] + (values[k / 5 + 1] - values[k / 5]) * (k % 5) as f64 / 5.0).collect()
    };
    let fine =
        Bench { time_s: between(&coarse.time_s), reading: between(&coarse.reading), strain: between(&coarse.strain) };
    let of = |bench: &Bench| {
        let kinds = [EstimatorKind::Ekf];
        let params = sensor(&calibrate(&[bench.samples()], &[LawOptions::default()], &kinds, None, |_| ()).unwrap());
        let ekf = params.estimators[&EstimatorKind::Ekf];
        (params.law, ekf)
    };
    let ((coarse_law, coarse), (fine_law, fine)) = (of(&coarse), of(&fine));
    for (a, b) in coarse_law.branches.iter().zip(&fine_law.branches) {
        // The polish of the time constants ends after a fixed number of steps.
        assert!((a.tau_s / b.tau_s).ln().abs() < 0.2, "{a:?} {b:?}");
    }
    // Readings in between add little: the log densities agree to a few per cent in the standard deviation of strain.
    assert!((coarse.score - fine.score).abs() < 0.2, "{coarse:?} {fine:?}");
}

/// A refused row leaves the filter unchanged, to the last bit.
#[test]
fn a_refused_row_changes_nothing() {
    let bench = record(1500.0, 0.0, 2e-3);
    let calibration =
        calibrate(&[bench.samples().head(700)], &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| ()).unwrap();
    let text = format!(
        "format = 9\nmade_by = 'test'\nquantity = 'strain'\nreading = 'ohm'\nrest_reading = {}\ndefault_estimator = 'ekf'\n",
        calibration.rest_readings[0]
    );
    assert!(toml::from_str::<SensorParams>(&text).is_err(), "a file without a law must be refused");
    let params = sensor(&calibration);
    let mut filter = build_filter(&params, None, Start::Strain(0.15)).unwrap();
    filter.step(0.0, Some(Reading::from(0.2))).unwrap();
    filter.step(0.1, Some(Reading::from(0.22))).unwrap();
    let before = filter.output();
    for (time_s, reading) in [(0.2, f64::NAN), (0.05, 0.2), (f64::NAN, 0.2), (0.2, f64::INFINITY)] {
        assert!(filter.step(time_s, Some(Reading::from(reading))).is_err());
        assert_eq!(filter.output(), before);
    }
    filter.step(0.2, Some(Reading::from(0.23))).unwrap();
    assert_ne!(filter.output(), before);
}

#[test]
fn what_cannot_be_calibrated_is_refused() {
    let bench = record(1500.0, 0.0, 1e-3);
    let refuse = |samples: Samples, options: LawOptions| fit_law(&[samples], options).unwrap_err();
    let constant = Bench { strain: vec![0.1; bench.strain.len()], ..bench.clone() };
    assert_eq!(refuse(constant.samples(), LawOptions::default()), CalibrationError::ConstantStrain);
    assert!(matches!(
        refuse(bench.samples().head(20), LawOptions::default()),
        CalibrationError::TooFewRows { recording: 0, complete: 20, .. }
    ));
    let unknown = Bench { strain: vec![f64::NAN; bench.strain.len()], ..bench.clone() };
    assert!(matches!(refuse(unknown.samples(), LawOptions::default()), CalibrationError::TooFewRows { .. }));
    let many = LawOptions { branches: 5, ..LawOptions::default() };
    assert!(matches!(refuse(bench.samples(), many), CalibrationError::Sensor(SensorError::Branches { found: 5 })));
    assert_eq!(fit_law(&[], LawOptions::default()).unwrap_err(), CalibrationError::NoRecording);
}

/// Three recordings in both orders: one sensor to the last bit, and every index is the caller's.
#[test]
fn the_order_of_the_recordings_changes_nothing() {
    let [a, b, mut c] = [(1500.0, 0.0), (2100.0, 1.0), (1800.0, 2.0)].map(|(rest, phase)| record(rest, phase, 1e-3));
    c.reading[300] *= 2.0;
    let given = [a.samples().head(400), b.samples().head(500), c.samples().head(400)];
    let first = OnceCell::new();
    for order in [[0, 1, 2], [2, 1, 0]] {
        let recordings = order.map(|index| given[index]);
        let made = calibrate(&recordings, &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| ()).unwrap();
        let first = first.get_or_init(|| made.clone());
        assert_eq!(sensor(&made), sensor(first));
        assert_eq!(made.rest_readings, order.map(|index| first.rest_readings[index]));
        let damaged = order.iter().position(|index| *index == 2).unwrap();
        assert!(made.distrusted.iter().any(|row| (row.recording, row.row) == (damaged, 300)), "{:?}", made.distrusted);
        assert!(made.left_out.iter().all(|row| row.truth == recordings[row.recording].strain()[row.row]));
        assert!(made.left_out.is_sorted_by_key(|row| row.recording));
    }
    let short =
        calibrate(&[given[1], given[0].head(20)], &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| ());
    assert!(matches!(short, Err(CalibrationError::TooFewRows { recording: 1, complete: 20, .. })), "{short:?}");
}

/// Missing readings and gaps in the reference are left out, not filled with zeros.
#[test]
fn gaps_do_not_bend_the_law() {
    let whole = record(1500.0, 0.0, 1e-3);
    let mut gappy = whole.clone();
    for k in (0..gappy.reading.len()).step_by(7) {
        gappy.reading[k] = f64::NAN;
    }
    for k in (3..gappy.strain.len()).step_by(11) {
        gappy.strain[k] = f64::NAN;
    }
    let fit = |bench: &Bench| fit_law(&[bench.samples()], LawOptions::default()).unwrap();
    let (a, b) = (fit(&whole), fit(&gappy));
    assert!((a.law.rest_readings[0] / b.law.rest_readings[0] - 1.0).abs() < 0.01);
    assert!((a.law.cross_validated_error - b.law.cross_validated_error).abs() < 0.003);
    assert!(b.law.residuals[0][7].is_nan() && b.law.residuals[0][8].is_finite());
}

#[test]
fn scores_are_what_their_names_say() {
    let row = |truth: f64, strain: f64| ScoredRow { time_s: 0.0, truth, strain, sd: Some(0.1) };
    // Errors of 0, 0.1, -0.15 and 0.3 with a standard deviation of 0.1: 50 % intervals reach 0.067, 90 % 0.164, 95 % 0.196.
    let rows = [row(0.0, 0.0), row(1.0, 1.1), row(2.0, 1.85), row(2.0, 2.3), row(f64::NAN, 5.0)];
    let scores = ohmstrain_calib::score(&rows).unwrap();
    assert_eq!(scores.n, 4);
    assert!((scores.rmse - ((0.01 + 0.0225 + 0.09) / 4.0_f64).sqrt()).abs() < 1e-12);
    assert!((scores.rmse_percent_fs - 50.0 * scores.rmse).abs() < 1e-12);
    assert!((scores.bias - 0.0625).abs() < 1e-12);
    assert_eq!((scores.coverage_50, scores.coverage_90, scores.coverage_95), (Some(0.25), Some(0.75), Some(0.75)));
    // Full scale is 2, so the variance is 0.05² + 0.005² in units of it.
    let variance = 0.0025 + 0.000_025;
    let squares = (0.0 + 0.05_f64.powi(2) + 0.075_f64.powi(2) + 0.15_f64.powi(2)) / 4.0;
    let expected = -0.5 * (squares / variance + (TAU * variance).ln());
    assert!((scores.log_score.unwrap() - expected).abs() < 1e-12);
    assert!(ohmstrain_calib::score(&[]).is_none());
    assert!(
        ohmstrain_calib::score(&[ScoredRow { time_s: 0.0, truth: 1.0, strain: 1.0, sd: None }])
            .unwrap()
            .coverage_95
            .is_none()
    );
}
