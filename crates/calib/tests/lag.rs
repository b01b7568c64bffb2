//! The lag of a reference, on sensors whose reference was shifted.

use std::f64::consts::TAU;

use ohmstrain_calib::{Lag, LagError, Samples, aligned, reference_lag};

/// Returns the lag found for a polynomial gauge and two branches with different gains for stretching and releasing, no dash-pot, in
/// explicit Euler steps of a millisecond; ten rows a second for 150 s. The reference is `lag_s` late.
fn lag_found(lag_s: f64) -> Result<Lag, LagError> {
    let strain_at = |t: f64| 0.15 + 0.08 * (TAU * t / 17.0).sin() + 0.06 * (TAU * t / 7.3).sin();
    let (mut time_s, mut reading, mut strain) = (vec![], vec![], vec![]);
    let (mut fast, mut slow) = (0.0, 0.0);
    let inner = 1e-3;
    for step in 0..150_000_usize {
        let t = step as f64 * inner;
        let (x, rate) = (strain_at(t), (strain_at(t + inner) - strain_at(t)) / inner);
        if step % 100 == 0 {
            // Roughly uniform in ±1e-3: fractional parts of multiples of the golden ratio.
            let noise = 1e-3 * (2.0 * (step as f64 / 100.0 * 0.618_033_988_749_895).fract() - 1.0);
            time_s.push(t);
            reading.push(1500.0 * (1.0 + 1.8 * x - 1.1 * x * x + fast + slow + noise));
            strain.push(strain_at(t - lag_s));
        }
        let (k_fast, k_slow) = if rate > 0.0 { (0.5 - 0.4 * x, 0.3) } else { (-0.3, -0.2 + 0.3 * x) };
        fast += inner * (-fast / 4.0 + k_fast * rate);
        slow += inner * (-slow / 30.0 + k_slow * rate);
    }
    let samples = Samples::new(&time_s, &reading, &strain).unwrap();
    reference_lag(&samples)
}

/// Readings are a function of the strain, without noise, and so they are of the strain half a period later.
#[test]
fn what_is_explained_whole_has_no_lag() {
    let time_s: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k)).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| 0.15 * (1.0 - (TAU * t / 20.0).cos())).collect();
    let reading: Vec<f64> = strain.iter().map(|x| 1600.0 * (1.0 + 1.9 * x - 2.0 * x * x)).collect();
    let lag = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap());
    assert!(lag.is_ok_and(|lag| !lag.is_sure() && lag.lag_s.abs() < 0.5), "{lag:?}");
}

#[test]
fn a_moved_reference_is_found_out() {
    for lag_s in [-6.0, -0.4, 0.0, 0.15, 0.6, 2.0, 3.0] {
        // One row, 0.1 s, is the resolution of a recording.
        let found = lag_found(lag_s).unwrap();
        println!("{found:?} for {lag_s}");
        assert!((found.lag_s - lag_s).abs() < 0.1, "{found:?} for {lag_s}");
    }
}

/// A sine of 30 s of a sensor that relaxes over half a second to two minutes, and drifts. The fitted law has fewer time constants, and
/// mistakes a lag for relaxation there.
#[test]
fn a_law_does_not_absorb_the_lag_of_a_slow_sine() {
    for lag_s in [-6.0, -4.0, 0.0, 4.0, 6.0] {
        let (time_s, reading, strain) = of_relaxing(|t| 0.15 * (1.0 - (TAU * t / 30.0).cos()), 300, lag_s);
        let found = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap()).unwrap();
        println!("{found:?} for {lag_s}");
        assert_eq!(found.is_sure(), lag_s != 0.0, "{found:?} for {lag_s}");
        // Half a step of the search, and the sensor's possible own lag.
        assert!((found.lag_s - lag_s).abs() < 0.25 + found.own_s, "{found:?} for {lag_s}");
    }
}

/// Six movements of 5 s between holds of 45 s, where a gauge alone mistakes relaxation for a lag.
#[test]
fn a_gauge_has_no_say_where_a_body_rests() {
    let ramps = |t: f64| 0.3 * ((t % 100.0) / 5.0).min(1.0).min((55.0 - t % 100.0) / 5.0).max(0.0);
    let (time_s, reading, strain) = of_relaxing(ramps, 300, 0.0);
    let found = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap());
    assert!(found.as_ref().map_or(true, |lag| !lag.is_sure() && lag.own_s == 0.0), "{found:?}");
}

/// Twelve quick movements of irregular height within five seconds, of a sensor without a lag. The law, which searches no further than a
/// tenth of a recording, confused movements there. The reference is shifted by several movements.
#[test]
fn a_short_recording_tells_a_lag_of_several_movements() {
    for lag_s in [-2.0, -0.9, 0.0, 0.7, 1.6] {
        let angle = |t: f64| {
            let k = (t / 0.42).floor();
            let height = 12.0 + 30.0 * ((k * 12.9898).sin() * 43_758.545_3).rem_euclid(1.0);
            height * (std::f64::consts::PI * (t / 0.42 - k)).sin().powi(2)
        };
        let time_s: Vec<f64> = (0..250).map(|k| 0.02 * f64::from(k)).collect();
        let reading: Vec<f64> = time_s.iter().map(|t| 400.0 + 1.6 * angle(*t) - 0.006 * angle(*t).powi(2)).collect();
        let strain: Vec<f64> = time_s.iter().map(|t| angle(t - lag_s)).collect();
        let found = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap()).unwrap();
        println!("{found:?} for {lag_s}");
        assert_eq!(found.is_certain(), lag_s != 0.0, "{found:?} for {lag_s}");
        // One row.
        assert!((found.lag_s - lag_s).abs() < 0.02, "{found:?} for {lag_s}");
    }
}

/// One stroke of 10 s and a hold, or two strokes, of a sensor that relaxes: any lag would explain equally much.
#[test]
fn a_stroke_or_two_tell_no_lag() {
    let (stroke, hold) = (|t: f64| 0.3 * (t / 10.0).min(1.0), |t: f64| 0.3 * (t / 10.0).min(2.0 - t / 10.0).max(0.0));
    for (time_s, reading, strain) in [of_relaxing(stroke, 60, 0.0), of_relaxing(hold, 20, 0.0)] {
        let found = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap());
        assert_eq!(found, Err(LagError::Short));
    }
}

/// A reference in every other row, which fails for 3 s; its usual step is 0.2 s, ten of them are 2 s.
#[test]
fn a_moved_reference_keeps_its_gaps() {
    let time_s: Vec<f64> = (0..200).map(|k| 0.1 * f64::from(k)).collect();
    let known = |(k, t): (usize, &f64)| if k % 2 == 0 && !(8.1..11.0).contains(t) { 0.01 * t } else { f64::NAN };
    let strain: Vec<f64> = time_s.iter().enumerate().map(known).collect();
    let moved = aligned(&Samples::new(&time_s, &vec![1000.0; 200], &strain).unwrap(), 0.55);
    for (t, moved) in time_s.iter().zip(moved) {
        let then_s = t + 0.55;
        match then_s {
            ..8.0 | 11.0..19.8 => assert!((moved - 0.01 * then_s).abs() < 1e-12, "{moved} at {t}"),
            _ => assert!(moved.is_nan(), "{moved} at {t}"),
        }
    }
}

fn of_relaxing(strain_at: impl Fn(f64) -> f64, seconds: u32, lag_s: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    const TAU_S: [f64; 4] = [0.5, 3.0, 20.0, 120.0];
    const GAINS: [[f64; 2]; 4] = [[0.5, -0.2], [0.35, -0.3], [0.3, -0.15], [0.3, 0.1]];
    let (mut time_s, mut reading, mut strain, mut branches) = (vec![], vec![], vec![], [0.0; 4]);
    let inner = 1e-2;
    for step in 0..100 * seconds {
        let t = f64::from(step) * inner;
        let (x, rate) = (strain_at(t), (strain_at(t + inner) - strain_at(t)) / inner);
        if step % 10 == 0 {
            let noise = 1e-3 * (2.0 * (f64::from(step) / 10.0 * 0.618_033_988_749_895).fract() - 1.0);
            let drift = 0.01 * (TAU * t / 173.0).sin();
            time_s.push(t);
            reading.push(1500.0 * (1.0 + 1.8 * x - 1.1 * x * x + branches.iter().sum::<f64>() + drift + noise));
            strain.push(strain_at(t - lag_s));
        }
        for ((branch, tau_s), gains) in branches.iter_mut().zip(TAU_S).zip(GAINS) {
            *branch += inner * (-*branch / tau_s + gains[usize::from(rate < 0.0)] * rate);
        }
    }
    (time_s, reading, strain)
}
