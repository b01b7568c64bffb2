//! Channels of one strain, with errors and faults made up by the test.

use std::sync::Arc;

use ohmstrain_calib::{CalibrationError, FusionChannel, FusionFit, LeftOutRow, Samples, fit_fusion};
use ohmstrain_sensor::Quantity;
use ohmstrain_sensor::fusion::{ChannelState, Fused, Fusion, Member};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const CHANNELS: usize = 4;
const ROWS: usize = 1600;
const STEP_S: f64 = 0.1;
/// R₀ of each channel.
const REST: [f64; CHANNELS] = [1000.0, 1500.0, 900.0, 2000.0];
/// Standard deviations of the filters' errors; half of the variance of each is common to all.
const SD: [f64; CHANNELS] = [0.010, 0.012, 0.012, 0.015];

/// A motion, the readings of each channel, and estimates of each channel's filter.
struct Made {
    time_s: Vec<f64>,
    strain: Vec<f64>,
    reading: Vec<Vec<f64>>,
    own: Vec<Vec<f64>>,
}

/// Simulates readings by different curves, two of them with a dash-pot, so that no single one determines the strain.
fn made(seed: u64, speed: f64) -> Made {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
    let time_s: Vec<f64> = (0..ROWS).map(|k| STEP_S * k as f64).collect();
    let strain: Vec<f64> =
        time_s.iter().map(|t| 0.15 - 0.10 * (speed * t).cos() - 0.05 * (0.37 * speed * t + 1.0).cos()).collect();
    let mut errors = [0.0; CHANNELS + 1];
    let (mut reading, mut own) = (vec![Vec::new(); CHANNELS], vec![Vec::new(); CHANNELS]);
    for k in 0..ROWS {
        let rate = if k == 0 { 0.0 } else { (strain[k] - strain[k - 1]) / STEP_S };
        // Errors of a filter are correlated over two seconds.
        for error in &mut errors {
            *error = 0.95 * *error + (1.0_f64 - 0.95 * 0.95).sqrt() * normal();
        }
        for channel in 0..CHANNELS {
            let e = strain[k];
            let ln_r = match channel {
                0 => 2.0 * e + 0.30 * rate,
                1 => 3.0 * e - 2.0 * e * e,
                2 => 1.5 * e + 3.0 * e * e - 0.20 * rate,
                _ => 2.5 * e,
            };
            reading[channel].push(REST[channel] * (ln_r + 0.01 * normal()).exp());
            let error = SD[channel] * (errors[channel] + errors[CHANNELS]) / 2.0_f64.sqrt();
            own[channel].push(strain[k] + error);
        }
    }
    Made { time_s, strain, reading, own }
}

fn fit(made: &Made) -> Result<FusionFit, CalibrationError> {
    let samples: Vec<[Samples; 1]> =
        made.reading.iter().map(|reading| [Samples::new(&made.time_s, reading, &made.strain).unwrap()]).collect();
    let row = |channel: usize, row: usize| LeftOutRow {
        recording: 0,
        row,
        truth: made.strain[row],
        strain: made.own[channel][row],
        strain_sd: SD[channel],
        smoothed: smoothed(made, row, channel),
        static_cubic: 0.0,
    };
    let left_out: Vec<Vec<LeftOutRow>> = (0..CHANNELS).map(|c| (0..ROWS).map(|k| row(c, k)).collect()).collect();
    let channel = |c: usize| FusionChannel { recordings: &samples[c], rest_reading: REST[c], left_out: &left_out[c] };
    fit_fusion(&(0..CHANNELS).map(channel).collect::<Vec<_>>(), Quantity::Strain, "a test")
}

/// Runs a fusion of filters over a motion; `change` may modify the logarithms of a row.
fn run(fit: &FusionFit, made: &Made, change: impl Fn(usize, &mut Vec<f64>)) -> Vec<Fused> {
    let fusion = Fusion::new(Arc::new(fit.params.clone()));
    fused(fusion, made, |k, channel| Member { strain: made.own[channel][k], sd: SD[channel] }, change)
}

/// Returns what a smoother knows of a row: half the error of the filter.
fn smoothed(made: &Made, k: usize, channel: usize) -> Member {
    Member { strain: 0.5 * (made.strain[k] + made.own[channel][k]), sd: 0.5 * SD[channel] }
}

/// Runs a fusion over a motion, with the estimate of each channel.
fn fused(
    mut fusion: Fusion,
    made: &Made,
    own: impl Fn(usize, usize) -> Member,
    change: impl Fn(usize, &mut Vec<f64>),
) -> Vec<Fused> {
    let step = |k: usize| {
        let mut ln_r: Vec<f64> = (0..CHANNELS).map(|c| (made.reading[c][k] / REST[c]).ln()).collect();
        change(k, &mut ln_r);
        let state = |(c, ln_r): (usize, f64)| ChannelState { ln_r, own: own(k, c) };
        fusion.step(made.time_s[k], &ln_r.into_iter().enumerate().map(state).collect::<Vec<_>>())
    };
    (0..ROWS).map(step).collect()
}

fn rmse(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), error| (sum + error * error, count + 1.0));
    (sum / count).sqrt()
}

fn error(rows: &[Fused], made: &Made) -> f64 {
    rmse(rows.iter().zip(&made.strain).map(|(row, truth)| row.strain - truth))
}

fn covered(rows: &[Fused], made: &Made) -> f64 {
    let holds = |(row, truth): &(&Fused, &f64)| (row.strain - **truth).abs() < 1.96 * row.sd;
    rows.iter().zip(&made.strain).filter(holds).count() as f64 / rows.len() as f64
}

/// Tests another motion of the same speeds. The average of the four, all equally good, would leave half of the variance and an eighth of
/// the other half, 0.79 of the best channel's error. All readings together contain more information: the strain to 0.01/3, and that of the
/// rates.
#[test]
fn fused_channels_err_less_than_the_best_and_cover() {
    let (seen, new) = (made(1, 0.9), made(2, 0.8));
    let fit = fit(&seen).unwrap();
    let rows = run(&fit, &new, |_, _| {});
    let best = (0..CHANNELS)
        .map(|c| rmse(new.own[c].iter().zip(&new.strain).map(|(own, truth)| own - truth)))
        .fold(f64::INFINITY, f64::min);
    assert!(error(&rows, &new) < 0.79 * best, "{} {best}", error(&rows, &new));
    assert!(covered(&rows, &new) > 0.9, "{}", covered(&rows, &new));
    let promised = fit.fused.unwrap();
    assert!(promised.rmse < 0.79 * fit.channels[0].unwrap().rmse, "{promised:?}");
    // No channel is faulty: one in a hundred rows of other blocks was as far, and the limit is half as far again.
    assert!(rows.iter().filter(|row| row.faulty.is_some() || row.is_unlike).count() < ROWS / 100);
    // The channels' errors have a correlation of a half, of which the shrinkage keeps half. With two seconds each, 160 s are 80 errors: the
    // correlation is known to (1 - 0.25) / 80^½, 0.08, and half of it to 0.04.
    let covariance = &fit.params.errors.covariance;
    let correlation = covariance[0][1] / (covariance[0][0] * covariance[1][1]).sqrt();
    assert!((correlation - 0.25).abs() < 0.12, "{correlation}");
}

/// Smoothers with half the filters' errors are weighted by errors of their own: the fused estimate is better than theirs, than the fused
/// filters', and covers.
#[test]
fn fused_smoothers_err_less_than_fused_filters_and_cover() {
    let (seen, new) = (made(1, 0.9), made(2, 0.8));
    let fit = fit(&seen).unwrap();
    let fusion = Fusion::of_smoothers(Arc::new(fit.params.clone())).unwrap();
    let rows = fused(fusion, &new, |k, channel| smoothed(&new, k, channel), |_, _| {});
    let best = (0..CHANNELS)
        .map(|c| rmse((0..ROWS).map(|k| smoothed(&new, k, c).strain - new.strain[k])))
        .fold(f64::INFINITY, f64::min);
    assert!(error(&rows, &new) < 0.79 * best, "{} {best}", error(&rows, &new));
    assert!(error(&rows, &new) < error(&run(&fit, &new, |_, _| {}), &new), "{}", error(&rows, &new));
    assert!(covered(&rows, &new) > 0.9, "{}", covered(&rows, &new));
    let scores = (fit.smoothed.unwrap().rmse, fit.fused.unwrap().rmse);
    assert!(scores.0 < scores.1, "{scores:?}");
}

/// One channel is shorted, open, dead or has another gain. It is found, the estimate is nearly as good as without it, and it is used again
/// afterwards.
#[test]
fn a_faulty_channel_is_left_out_and_comes_back() {
    let (seen, new) = (made(1, 0.9), made(2, 0.8));
    let fit = fit(&seen).unwrap();
    let clean = error(&run(&fit, &new, |_, _| {}), &new);
    for channel in 0..CHANNELS {
        for (fault, ln_r) in [("open", f64::NAN), ("shorted", -6.0), ("gain", 0.5)] {
            let rows = run(&fit, &new, |k, row| {
                if (400..1200).contains(&k) {
                    row[channel] = if fault == "gain" { row[channel] + ln_r } else { ln_r };
                }
            });
            // Three channels instead of four, equally good, leave at most 4/3 of the variance.
            assert!(error(&rows, &new) < 1.25 * clean, "{channel} {fault}: {} {clean}", error(&rows, &new));
            let found = rows[400..1200].iter().filter(|row| row.faulty == Some(channel)).count();
            let wrong = rows.iter().filter(|row| row.faulty.is_some_and(|found| found != channel)).count();
            assert!((fault == "open" || found > 780) && wrong < 8, "{channel} {fault}: {found} {wrong}");
            // A second after its end only the low-passes still contain the fault.
            assert!(rows[1210..].iter().filter(|row| row.faulty.is_some()).count() < 8, "{channel} {fault}");
        }
    }
}

/// Cables exchanged at one end of the body, and curves changed by another posture: no single channel is at fault. The interval then covers
/// the truth.
#[test]
fn readings_that_calibration_has_not_seen_are_doubted() {
    let (seen, new) = (made(1, 0.9), made(2, 0.8));
    let fit = fit(&seen).unwrap();
    let rows = run(&fit, &new, |_, row| {
        row[0] *= 0.4;
        row[1] += 0.4;
        row[3] *= 0.3;
    });
    let unlike = rows.iter().filter(|row| row.is_unlike).count() as f64 / ROWS as f64;
    assert!(unlike > 0.9 && covered(&rows, &new) > 0.9, "{unlike} {}", covered(&rows, &new));
}

/// The regressions on the remaining channels err more than those on all, whose noise they were fitted with.
#[test]
fn what_is_left_of_the_channels_covers() {
    let (seen, new) = (made(1, 0.9), made(2, 0.8));
    let fit = fit(&seen).unwrap();
    for only in 0..CHANNELS {
        let fusion = Fusion::new(Arc::new(fit.params.clone()));
        let rows = fused(
            fusion,
            &new,
            |_, _| Member::UNKNOWN,
            |_, row| (0..CHANNELS).filter(|c| *c != only).for_each(|c| row[c] = f64::NAN),
        );
        assert!(covered(&rows, &new) > 0.9, "{only}: {}", covered(&rows, &new));
    }
}

#[test]
fn channels_of_other_times_are_refused() {
    let made = made(1, 0.9);
    let later: Vec<f64> = made.time_s.iter().map(|time_s| time_s + 0.01).collect();
    let first = [Samples::new(&made.time_s, &made.reading[0], &made.strain).unwrap()];
    let second = [Samples::new(&later, &made.reading[1], &made.strain).unwrap()];
    let channel = |samples| FusionChannel { recordings: samples, rest_reading: 1000.0, left_out: &[] };
    for channels in [vec![channel(&first[..])], vec![channel(&first[..]), channel(&second[..])]] {
        let refused = fit_fusion(&channels, Quantity::Strain, "a test").unwrap_err();
        assert!(matches!(refused, CalibrationError::NoCommonRows), "{refused}");
    }
}
