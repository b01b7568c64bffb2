//! Files of older formats are read for good.

#![cfg(feature = "calibrate")]

use ohmstrain::{Error, Sensor, TextCause};

/// Written by ohmstrain 0.1.0, whose files had no weights of the correction.
const FORMAT_8: &str = include_str!("../../../tests/fixtures/format_8.toml");

/// Estimates of that version for a hundred readings, 10 a second, `3400 + 2200 (1 - cos 0.5 t)` Ω rounded to tenths: strain and its standard
/// deviation at rows 20, 50 and 99 (`filter` and `smooth`, columns `time_s,strain,strain_sd`).
const FILTERED: [(usize, f64, f64); 3] = [
    (20, 0.060723955480956715, 0.03265030925244289),
    (50, 0.32980676260331043, 0.028459286952057426),
    (99, 0.07727281592184419, 0.023032784831102153),
];
const SMOOTHED: [(usize, f64, f64); 3] = [
    (20, 0.06175970044913614, 0.0077648892788017825),
    (50, 0.33323555111111053, 0.008797998052013367),
    (99, 0.06590981909515749, 0.009061949247161617),
];
/// Weights are kept with nine digits; those of 200 rows, some of which are alike, are a thousand times as large as what they say.
const TOLERANCE: f64 = 1e-6;

#[test]
fn a_sensor_of_format_8_says_what_it_said() {
    let sensor = Sensor::from_toml(FORMAT_8).unwrap();
    let time_s: Vec<f64> = (0..100).map(|k| f64::from(k) / 10.0).collect();
    let readings: Vec<f64> =
        time_s.iter().map(|t| ((3400.0 + 2200.0 * (1.0 - (0.5 * t).cos())) * 10.0).round() / 10.0).collect();
    let mut filter = sensor.filter().build().unwrap();
    let filtered: Vec<_> = time_s.iter().zip(&readings).map(|(t, r)| filter.step(*t, *r).unwrap()).collect();
    let smoothed = sensor.smooth(&time_s, &readings).unwrap();
    for (said, expected) in [(&filtered, FILTERED), (&smoothed, SMOOTHED)] {
        for (row, strain, sd) in expected {
            let (apart, wider) = (said[row].strain - strain, said[row].strain_sd - sd);
            assert!(apart.abs() < TOLERANCE && wider.abs() < TOLERANCE, "{row}: {apart} {wider}");
        }
    }
    let written = sensor.to_toml().unwrap();
    assert!(written.starts_with("format = 9\n"));
    assert_eq!(Sensor::from_toml(&written).unwrap(), sensor);
}

/// Errors in an old file are reported like those in a new one, and a version older still is refused.
#[test]
fn what_is_wrong_with_an_old_file_is_named() {
    let named = |text: &str| Sensor::from_toml(text).unwrap_err().in_file("s.toml");
    let negative = FORMAT_8.replacen("\nrest_reading = ", "\nrest_reading = -", 1);
    assert!(named(&negative).starts_with("s.toml:5: column 16: field `rest_reading`: expected 1e-12 to 1e12"));
    assert!(named("format = 8\n").contains("missing field `made_by`"));
    let Err(Error::Text(error)) = Sensor::from_toml("format = 7\n") else { panic!("format 7 is refused") };
    assert!(matches!(error.cause, TextCause::Format { expected: 9, found: 7 }));
}
