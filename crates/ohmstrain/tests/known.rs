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
fn offset(said: &[Estimate]) -> [Known; 10] {
    ROWS.map(|row: usize| Known::new(said[row].time_s - 0.05, said[row].strain + 0.06))
}

#[test]
fn told_before_or_while_it_runs_is_the_same() {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let known = offset(&filtered(&[]));
    let mut filter = sensor.filter().build().unwrap();
    let told = time_s.iter().zip(ohm).enumerate().map(|(k, (time_s, ohm))| {
        let row = filter.step(*time_s, ohm).unwrap();
        let known = known.iter().zip(ROWS).find(|(_, row)| *row == k);
        known.map_or(row, |(known, _)| filter.know(known.strain, 0.005 * sensor.params().limits.span()).unwrap())
    });
    let strain = |row: Estimate| (row.strain, row.strain_sd);
    let told: Vec<_> = told.map(strain).collect();
    let before: Vec<_> = filtered(&known).into_iter().map(strain).collect();
    assert_eq!(told, before);
}

/// Rows before the first known strain are as they were; what is known at a row is what is said there, and an offset that shows ten
/// times is there at the end.
#[test]
fn an_offset_lasts() {
    let said = filtered(&[]);
    let known = offset(&said);
    let told = filtered(&known);
    assert_eq!(told[..200], said[..200]);
    let more = |row: usize| told[row].strain - said[row].strain;
    assert!((more(200) - 0.06).abs() < 0.003 && more(1199) > 0.03, "{} {}", more(200), more(1199));
    // No filter but the strain knows of it.
    assert_eq!(told[700].relaxation, said[700].relaxation);
}

#[test]
fn a_smoother_is_told_of_both_sides() {
    let said = smoothed(&[]);
    let known = offset(&said);
    let told = smoothed(&known);
    for row in [0, 350, 650, 1199] {
        assert!(told[row].strain - said[row].strain > 0.02, "{row}: {}", told[row].strain - said[row].strain);
    }
    assert!(known.iter().zip(ROWS).all(|(known, row)| (told[row].strain - known.strain).abs() < 0.002));
    // In any order; what comes after the last row is of no use.
    let mut others = known.to_vec();
    others.reverse();
    others.insert(3, Known::new(500.0, 0.0));
    assert_eq!(smoothed(&others), told);
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
fn rows_that_wait_are_told() {
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
    let said = lagged(&[]);
    let told = lagged(&[Known::new(60.0, said[600].strain + 0.02)]);
    assert_eq!(told[..580], said[..580]);
    let more = |row: usize| told[row].strain - said[row].strain;
    assert!(more(600) > 0.015 && more(590) > 0.003, "{} {}", more(600), more(590));
}
