//! References that are so late that the readings seem to have nothing to do with them.

use ohmstrain::{Calibration, LagDoubt, LagError, Recording};

/// Ramps of 2.7 s from one level to another that look like nothing in particular: five seconds later nothing is alike.
fn strain_at(time_s: f64) -> f64 {
    let level = |k: f64| 0.3 * ((k * 12.9898).sin() * 43758.5453).rem_euclid(1.0);
    let place = time_s / 2.7;
    level(place.floor()) + place.rem_euclid(1.0) * (level(place.floor() + 1.0) - level(place.floor()))
}

#[test]
fn a_reference_that_explains_nothing_is_looked_for_elsewhere() {
    let time_s: Vec<f64> = (0..1500).map(|k| 0.1 * f64::from(k)).collect();
    let ohm: Vec<f64> = time_s.iter().map(|t| 1500.0 * (1.0 + 1.8 * strain_at(*t) - strain_at(*t).powi(2))).collect();
    for lag_s in [-9.9, 4.9] {
        let late: Vec<f64> = time_s.iter().map(|t| strain_at(t - lag_s)).collect();
        let recording = Recording::new(&time_s, &ohm, &late).unwrap();
        let refused = Calibration::new().run(&[recording]).unwrap_err().to_string();
        assert!(refused.contains("nothing to do with the reference"), "{refused}");
        let found = recording.reference_lag().expect("a lag");
        // One row, 0.1 s, is what a recording can show.
        assert!(found.is_too_late() && (found.lag_s - lag_s).abs() < 0.1, "{found:?} for {lag_s}");
    }
}

/// Further away than lags are looked for, 12 s, but by less than a movement: the end of the search explains the readings best.
#[test]
fn a_lag_at_the_end_of_the_search_is_reported() {
    let time_s: Vec<f64> = (0..1500).map(|k| 0.1 * f64::from(k)).collect();
    let ohm: Vec<f64> = time_s.iter().map(|t| 1500.0 * (1.0 + 1.8 * strain_at(*t) - strain_at(*t).powi(2))).collect();
    for (lag_s, end_s) in [(12.4, 12.0), (-12.4, -12.0)] {
        let late: Vec<f64> = time_s.iter().map(|t| strain_at(t - lag_s)).collect();
        let recording = Recording::new(&time_s, &ohm, &late).unwrap();
        assert_eq!(recording.reference_lag(), Err(LagError::AtEnd(end_s)), "{lag_s}");
        assert_eq!(recording.lag_doubt(), Some(LagDoubt::OutOfReach { lag_s: end_s }));
    }
}
