//! Strains that somebody knows.

use ohmstrain::{Error, Estimate, Known, Sensor};

fn sensor() -> Sensor {
    Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml").unwrap()).unwrap()
}

/// Two minutes of a slow motion, ten rows a second.
fn recording() -> (Vec<f64>, Vec<f64>) {
    let row = |k: u32| {
        let time_s = 0.1 * f64::from(k);
        (time_s, 2200.0 - 500.0 * (0.3 * time_s).cos() + f64::from(k % 3))
    };
    (0..1200).map(row).unzip()
}

fn filtered(known: &[Known]) -> Vec<Estimate> {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let mut filter = sensor.filter().known(known).build().unwrap();
    time_s.iter().zip(ohm).map(|(time_s, ohm)| filter.step(*time_s, ohm).unwrap()).collect()
}

fn smoothed(known: &[Known]) -> Vec<Estimate> {
    let (time_s, ohm) = recording();
    sensor().filter().known(known).smooth(&time_s, &ohm).unwrap()
}

/// Rows whose strain is known, ten seconds apart.
const ROWS: [usize; 10] = [200, 300, 400, 500, 600, 700, 800, 900, 1000, 1100];

/// Strains that are 0.06 more than what is said.
fn offset(estimates: &[Estimate]) -> [Known; 10] {
    ROWS.map(|row: usize| Known::new(estimates[row].time_s - 0.05, estimates[row].strain + 0.06))
}

#[test]
fn strains_given_before_or_during_a_run_have_the_same_effect() {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let known = offset(&filtered(&[]));
    let mut filter = sensor.filter().build().unwrap();
    let while_running = time_s.iter().zip(ohm).enumerate().map(|(k, (time_s, ohm))| {
        let row = filter.step(*time_s, ohm).unwrap();
        let known = known.iter().zip(ROWS).find(|(_, row)| *row == k);
        known.map_or(row, |(known, _)| filter.know(known.strain, 0.005 * sensor.params().limits.span()).unwrap())
    });
    let strain = |row: Estimate| (row.strain, row.strain_sd);
    let while_running: Vec<_> = while_running.map(strain).collect();
    let before: Vec<_> = filtered(&known).into_iter().map(strain).collect();
    assert_eq!(while_running, before);
}

/// Rows before the first known strain are as they were; what is known at a row is what is said there, and an offset that shows ten
/// times is there at the end.
#[test]
fn an_offset_lasts() {
    let without_known = filtered(&[]);
    let known = offset(&without_known);
    let with_known = filtered(&known);
    assert_eq!(with_known[..200], without_known[..200]);
    let more = |row: usize| with_known[row].strain - without_known[row].strain;
    assert!((more(200) - 0.06).abs() < 0.003 && more(1199) > 0.03, "{} {}", more(200), more(1199));
    // No filter but the strain knows of it.
    assert_eq!(with_known[700].relaxation, without_known[700].relaxation);
}

#[test]
fn a_known_strain_changes_both_sides_of_a_smoother() {
    let without_known = smoothed(&[]);
    let known = offset(&without_known);
    let with_known = smoothed(&known);
    for row in [0, 350, 650, 1199] {
        assert!(
            with_known[row].strain - without_known[row].strain > 0.02,
            "{row}: {}",
            with_known[row].strain - without_known[row].strain
        );
    }
    assert!(known.iter().zip(ROWS).all(|(known, row)| (with_known[row].strain - known.strain).abs() < 0.002));
    // In any order; what comes after the last row is of no use.
    let mut others = known.to_vec();
    others.reverse();
    others.insert(3, Known::new(500.0, 0.0));
    assert_eq!(smoothed(&others), with_known);
    // One row is told before any other: it is the first one.
    let first = smoothed(&[Known::new(-7.0, 0.1)]);
    assert!((first[0].strain - 0.1).abs() < 0.005, "{}", first[0].strain);
}

#[test]
fn what_cannot_be_known_is_refused() {
    let sensor = sensor();
    for known in [Known::new(0.0, 2.0), Known { sd: Some(0.0), ..Known::new(0.0, 0.1) }] {
        assert!(sensor.filter().known(&[known]).build().is_err());
        assert!(sensor.filter().known(&[known]).build_lagged(1.0).is_err());
        let refused = sensor.filter().known(&[known]).smooth(&[0.0], &[1600.0]);
        assert!(matches!(refused, Err(Error::KnownStrain { .. } | Error::NotPositive { .. })));
    }
}

/// A known strain also changes the rows that wait for a lag.
#[test]
fn a_known_strain_changes_rows_that_wait() {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let lagged = |known: &[Known]| {
        let mut filter = sensor.filter().known(known).build_lagged(2.0).unwrap();
        let mut rows = Vec::new();
        for (time_s, ohm) in time_s.iter().zip(&ohm) {
            rows.extend_from_slice(filter.step(*time_s, *ohm).unwrap());
        }
        rows.extend_from_slice(filter.finish().unwrap());
        rows
    };
    let without_known = lagged(&[]);
    let with_known = lagged(&[Known::new(60.0, without_known[600].strain + 0.02)]);
    assert_eq!(with_known[..580], without_known[..580]);
    let more = |row: usize| with_known[row].strain - without_known[row].strain;
    assert!(more(600) > 0.015 && more(590) > 0.003, "{} {}", more(600), more(590));
}
