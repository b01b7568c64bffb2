//! R₀ of another day, given or not.

use ohmstrain::{Estimate, FilterBuilder, Sensor};
use ohmstrain_tests::sweep::{SENSOR, recordings};

/// Returns the errors, %FS, of the filter's last half and of all the smoother's rows, on another recording of the
/// sensor with all readings times a factor.
fn errors(sensor: &Sensor, factor: f64, with: impl Fn(FilterBuilder) -> FilterBuilder) -> [f64; 2] {
    let [_, trace] = recordings().unwrap();
    let strain = &trace.reference.as_ref().unwrap().values;
    let ohm: Vec<f64> = trace.readings.values.iter().map(|ohm| factor * ohm).collect();
    let mut filter = with(sensor.filter()).build().unwrap();
    let row = |(time_s, ohm): (&f64, &f64)| filter.step(*time_s, *ohm).unwrap();
    let filtered: Vec<Estimate> = trace.time_s.iter().zip(&ohm).map(row).collect();
    let smoothed = with(sensor.filter()).smooth(&trace.time_s, &ohm).unwrap();
    let rms = |estimates: &[Estimate], strain: &[f64]| {
        let squares: f64 = estimates.iter().zip(strain).map(|(row, strain)| (row.strain - strain).powi(2)).sum();
        100.0 * (squares / strain.len() as f64).sqrt() / sensor.params().limits.span()
    };
    let half = strain.len() / 2;
    [rms(&filtered[half..], &strain[half..]), rms(&smoothed, strain)]
}

/// All readings are higher by half, and R₀ is not given. R₀ moves only as far as the readings require, so part of the
/// error remains. With a given R₀, the relative readings are the same as before.
#[test]
fn another_day_is_found_where_the_sensor_moves_as_in_calibration() {
    let sensor = Sensor::from_toml(SENSOR).unwrap();
    let rested = sensor.params().rested();
    let [same_day, given, held] = [(1.0, 1.0), (1.5, 1.5), (1.5, 1.0)]
        .map(|(factor, rest_factor)| errors(&sensor, factor, |filter| filter.rest_resistance(rest_factor * rested)));
    let followed = errors(&sensor, 1.5, |filter| filter);
    println!("same day {same_day:.2?}, told {given:.2?}, held {held:.2?}, followed {followed:.2?}");
    for (same_day, given) in same_day.into_iter().zip(given) {
        assert!((given - same_day).abs() < 1e-3 * same_day);
    }
    for (held, followed) in held.into_iter().zip(followed) {
        assert!(followed < 0.7 * held);
    }
}

/// R₀ does not move on the day of the calibration, whose readings stay in the calibrated range.
#[test]
fn nothing_is_followed_on_the_day_of_the_calibration() {
    let sensor = Sensor::from_toml(SENSOR).unwrap();
    let rested = sensor.params().rested();
    let held = errors(&sensor, 1.0, |filter| filter.rest_resistance(rested));
    for (held, followed) in held.into_iter().zip(errors(&sensor, 1.0, |filter| filter)) {
        // A given R₀ equals the tracked one to a rounding of 1e-16.
        assert!((followed - held).abs() < 1e-6 * held, "{held} {followed}");
    }
}
