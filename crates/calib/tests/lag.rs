//! The lag of a reference, on sensors whose reference was moved.

use std::f64::consts::TAU;

use ohmstrain_calib::{Samples, reference_lag};

/// A polynomial gauge and two branches with gains of their own for stretching and releasing, no dash-pot, in explicit
/// Euler steps of a millisecond; ten rows a second for 150 s. The reference comes `lag_s` late.
fn lag_found(lag_s: f64) -> Option<f64> {
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
    reference_lag(&samples).map(|lag| lag.lag_s)
}

/// Readings that are a function of the strain, without noise: half a period later they are one again.
#[test]
fn what_is_explained_whole_has_no_lag() {
    let time_s: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k)).collect();
    let strain: Vec<f64> = time_s.iter().map(|t| 0.15 * (1.0 - (TAU * t / 20.0).cos())).collect();
    let reading: Vec<f64> = strain.iter().map(|x| 1600.0 * (1.0 + 1.9 * x - 2.0 * x * x)).collect();
    let lag = reference_lag(&Samples::new(&time_s, &reading, &strain).unwrap());
    assert!(lag.is_none_or(|lag| !lag.is_sure() && lag.lag_s.abs() < 0.5), "{lag:?}");
}

#[test]
fn a_moved_reference_is_found_out() {
    for lag_s in [-6.0, -0.4, 0.0, 0.15, 0.6, 2.0, 3.0] {
        // One row, 0.1 s, is what a recording can show.
        let found = lag_found(lag_s).unwrap();
        println!("{found} for {lag_s}");
        assert!((found - lag_s).abs() < 0.1, "{found} for {lag_s}");
    }
}
