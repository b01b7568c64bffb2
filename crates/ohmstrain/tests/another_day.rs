//! R₀ of another day.

use ohmstrain::{Estimate, Sensor, ValidityWatch};
use ohmstrain_ekf::live::{RestBounds, RestFollower};
use ohmstrain_sensor::Sessions;

/// The same in resistances: R₀ goes to where the reading is an end of the range, in a step that is implicit in time.
fn followed(bounds: (f64, f64), rows: impl Iterator<Item = (f64, f64)>) -> Vec<f64> {
    let (mut rest, mut last, mut since_s) = (1.0_f64, f64::NAN, 0.0);
    let one = |(dt_s, resistance): (f64, f64)| {
        let is_news = !last.is_nan() && resistance != last;
        since_s = if last.is_nan() { 0.0 } else { since_s + dt_s };
        last = resistance;
        let (least, most) = (bounds.0 * rest, bounds.1 * rest);
        let wanted = if resistance > most { resistance / bounds.1 } else { resistance / bounds.0 };
        if is_news && !(least..=most).contains(&resistance) && 0.5 < wanted && wanted < 2.0 {
            let dt_s = f64::min(since_s, 2.0);
            let time_s = if (wanted - 1.0).abs() > (rest - 1.0).abs() { 40.0 } else { 1.0 };
            rest = (rest + dt_s / time_s * wanted) / (1.0 + dt_s / time_s);
        }
        since_s = if is_news { 0.0 } else { since_s };
        rest - 1.0
    };
    rows.map(one).collect()
}

#[test]
fn r0_follows_as_a_play_with_a_lag() {
    let mut x = 1_u32;
    let mut random = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(x >> 8) / f64::from(1 << 24)
    };
    // Slow motion within 0.6 to 3 R₀, repetitions, spikes of ten times, pauses.
    let rows: Vec<(f64, f64)> = (0..20_000)
        .map(|k| {
            let slow = 1.8 + 1.2 * (0.003 * f64::from(k)).sin() * (0.0001 * f64::from(k)).cos();
            let resistance = if random() < 0.01 { 10.0 * slow } else { (50.0 * slow).round() / 50.0 };
            (if random() < 0.01 { 30.0 } else { 0.05 }, resistance)
        })
        .collect();
    let expected = followed((0.95, 2.2), rows.iter().copied());
    let mut follower =
        RestFollower::<f64>::new(RestBounds { low: Some(0.95 - 1.0), high: Some(2.2 - 1.0), start: None });
    let mut farthest = (0.0_f64, 0.0_f64);
    for ((dt_s, resistance), expected) in rows.into_iter().zip(expected) {
        follower.see(dt_s, resistance - 1.0);
        assert!((follower.off() - expected).abs() < 1e-9, "{} {expected}", follower.off());
        farthest = (farthest.0.min(expected), farthest.1.max(expected));
    }
    // It went both ways.
    assert!(farthest.0 < -0.1 && farthest.1 > 0.1, "{farthest:?}");
}

/// The example's sensor, as if it had been calibrated on several sessions.
fn of_sessions(rest_sd: f64, start_sd: f64) -> Sensor {
    let text = std::fs::read_to_string("examples/sensor.toml").unwrap();
    let mut params = Sensor::from_toml(&text).unwrap().params().clone();
    params.sessions = Some(Sessions { rest_sd, start_sd });
    Sensor::from_params(params).unwrap()
}

/// Readings of a session whose resistances are `times` those of the calibration: from rest up and down within its readings.
fn session(sensor: &Sensor, times: f64) -> Vec<(f64, f64)> {
    let (rested, highest) = (sensor.params().rested(), sensor.params().validity.reading_upper);
    let of = |k: i32| {
        let time_s = 0.05 * f64::from(k);
        (time_s, times * (rested + 0.9 * (highest - rested) * (0.3 * time_s).sin().powi(2)))
    };
    (0..400).map(of).collect()
}

fn filtered(sensor: &Sensor, rows: &[(f64, f64)]) -> Vec<Estimate> {
    let mut filter = sensor.filter().build().unwrap();
    rows.iter().map(|&(time_s, reading)| filter.step(time_s, reading).unwrap()).collect()
}

/// The first reading determines R₀ if starts differ by nothing: all is as in the calibration's own session, from the first row.
#[test]
fn where_sessions_begin_at_rest_the_first_reading_tells_r0() {
    let sensor = of_sessions(0.2, 1e-9);
    let own = session(&sensor, 1.0);
    let smoothed = |rows: &[(f64, f64)]| {
        let (time_s, readings): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
        sensor.filter().smooth(&time_s, &readings).unwrap()
    };
    for times in [0.8, 1.3] {
        let other = session(&sensor, times);
        let pairs = filtered(&sensor, &own).into_iter().zip(filtered(&sensor, &other));
        for (own, other) in pairs.chain(smoothed(&own).into_iter().zip(smoothed(&other))) {
            // Readings that are equal but for rounding, 1e-16 of them, and a filter that amplifies it over 400 rows.
            assert!((own.strain - other.strain).abs() < 1e-6 * own.strain_sd, "{times}: {own:?} {other:?}");
            assert!((own.strain_sd / other.strain_sd - 1.0).abs() < 1e-6, "{times}: {own:?} {other:?}");
            assert_eq!(own.flags, other.flags);
        }
    }
}

/// Half of the way where both differ alike; none without sessions. The interval knows what is left open.
#[test]
fn the_first_reading_counts_by_how_starts_differ() {
    let sensor = of_sessions(0.15, 0.15);
    let (own, other) = (session(&sensor, 1.0), session(&sensor, 1.2));
    let mut params = sensor.params().clone();
    params.sessions = None;
    let alone = Sensor::from_params(params).unwrap();
    let (with, without) = (filtered(&sensor, &other), filtered(&alone, &other));
    let of_own = filtered(&alone, &own);
    let error = |estimates: &[Estimate]| -> f64 {
        estimates.iter().zip(&of_own).map(|(estimate, own)| (estimate.strain - own.strain).powi(2)).sum()
    };
    assert!(error(&with) < error(&without), "{} {}", error(&with), error(&without));
    let wider = filtered(&sensor, &own);
    assert!(wider.iter().zip(&of_own).all(|(wider, own)| wider.strain_sd > own.strain_sd));
}

/// A strain that is known at the start and is not zero: the first reading is of that strain, and R₀ stays calibration's.
#[test]
fn a_session_that_begins_stretched_tells_nothing_of_r0() {
    let sensor = of_sessions(0.2, 1e-9);
    let mut params = sensor.params().clone();
    params.sessions = None;
    let alone = Sensor::from_params(params).unwrap();
    // Readings within calibration's throughout: nothing draws R₀.
    let rows = &session(&sensor, 1.0)[100..];
    let (time_s, readings): (Vec<f64>, Vec<f64>) = rows.iter().copied().unzip();
    let strain = 0.5 * sensor.params().limits.upper;
    let estimates = |sensor: &Sensor| {
        let mut filter = sensor.filter().initial_strain(strain).build().unwrap();
        let mut means: Vec<f64> = rows.iter().map(|&(time_s, r)| filter.step(time_s, r).unwrap().strain).collect();
        let smoothed = sensor.filter().initial_strain(strain).smooth(&time_s, &readings).unwrap();
        means.extend(smoothed.iter().map(|estimate| estimate.strain));
        means
    };
    assert_eq!(estimates(&sensor), estimates(&alone));
    // Without that knowledge it is taken for a session at rest.
    assert_ne!(filtered(&sensor, rows)[0].strain, filtered(&alone, rows)[0].strain);
}

/// Readings of another session are outside of calibration's as far as they are relative to its own R₀.
#[test]
fn another_session_is_no_extrapolation() {
    let sensor = of_sessions(0.2, 1e-9);
    let mut params = sensor.params().clone();
    params.sessions = None;
    let alone = Sensor::from_params(params).unwrap();
    let warnings = |sensor: &Sensor| {
        let mut watch = ValidityWatch::new(sensor, None);
        let rows = session(sensor, 1.3);
        rows.into_iter().flat_map(|(time_s, reading)| watch.see(time_s, reading, 0.0, f64::NAN)).count()
    };
    assert_eq!((warnings(&sensor), warnings(&alone)), (0, 1));
}
