//! Filters that are stored between two rows, and go on.

use ohmstrain::{Error, Estimate, EstimatorKind, Known, Reading, Sensor, Stored, StoredError};

fn sensor() -> Sensor {
    let text = include_str!("../examples/sensor.toml");
    Sensor::from_toml(&text.replace("[static_cubic]\n", "[static_cubic]\nerror_sd = 0.03\n")).unwrap()
}

/// A minute and a half at 10 Hz, with readings that are missing one by one and for 12 s, outliers, a jump, and a number that
/// comes again and again.
fn rows() -> Vec<(f64, Reading)> {
    let value = |k: u32| {
        let t = 0.1 * f64::from(k);
        let ohm = 1600.0 + 250.0 * (1.0 - (0.6 * t).cos()) + f64::from(k * 7919 % 13);
        match k {
            100..220 => None,
            _ if k % 17 == 3 => None,
            300 | 305 => Some(9000.0),
            400..410 => Some(ohm + 400.0),
            600..700 => Some(1700.0),
            _ => Some(ohm),
        }
    };
    (0..900).map(|k| (0.1 * f64::from(k), Reading::from(value(k)))).collect()
}

fn text_of(stored: &Stored) -> Stored {
    Stored::from_toml(&stored.to_toml().unwrap()).unwrap()
}

/// Formats rows as text, where every digit counts and unknown values are equal.
fn shown(rows: &[Estimate]) -> Vec<String> {
    rows.iter().map(|row| format!("{row:?}")).collect()
}

const KNOWN: [Known; 2] = [Known::new(3.0, 0.1), Known::new(50.0, 0.05)];

/// Rows at which to stop: at the start, before and after a known strain, in a pause, after outliers and a jump, in a row of one number.
const STOPS: [usize; 9] = [0, 1, 29, 31, 150, 301, 402, 650, 899];

#[test]
fn a_filter_goes_on_to_the_bit() {
    let (sensor, rows) = (sensor(), rows());
    let step = |filter: &mut ohmstrain::Filter, row: &(f64, Reading)| filter.step(row.0, row.1).unwrap();
    for kind in EstimatorKind::ALL {
        let begun = sensor.filter().estimator(kind).gate(30.0);
        let Ok(mut filter) = begun.known(&KNOWN).build() else { continue };
        let whole: Vec<_> = rows.iter().map(|row| step(&mut filter, row)).collect();
        for stop in STOPS {
            let mut filter = begun.known(&KNOWN).build().unwrap();
            let mut found: Vec<_> = rows[..stop].iter().map(|row| step(&mut filter, row)).collect();
            let mut filter = begun.resume(&text_of(&filter.store().unwrap())).unwrap();
            found.extend(rows[stop..].iter().map(|row| step(&mut filter, row)));
            assert_eq!(shown(&found), shown(&whole), "{} at {stop}", kind.name());
        }
    }
}

#[test]
fn a_lagged_filter_goes_on_to_the_bit() {
    let (sensor, rows) = (sensor(), rows());
    for kind in EstimatorKind::ALL {
        let begun = sensor.filter().estimator(kind);
        let Ok(mut filter) = begun.known(&KNOWN).build_lagged(1.5) else { continue };
        let mut whole = Vec::new();
        let looks_back =
            rows.iter().try_for_each(|row| filter.step(row.0, row.1).map(|due| whole.extend_from_slice(due)));
        if looks_back.is_err() {
            continue;
        }
        whole.extend_from_slice(filter.finish().unwrap());
        assert_eq!(whole.len(), rows.len());
        for stop in STOPS {
            let (mut filter, mut found) = (begun.known(&KNOWN).build_lagged(1.5).unwrap(), Vec::new());
            rows[..stop].iter().for_each(|row| found.extend_from_slice(filter.step(row.0, row.1).unwrap()));
            let mut filter = begun.resume_lagged(1.5, &text_of(&filter.store().unwrap())).unwrap();
            rows[stop..].iter().for_each(|row| found.extend_from_slice(filter.step(row.0, row.1).unwrap()));
            found.extend_from_slice(filter.finish().unwrap());
            assert_eq!(shown(&found), shown(&whole), "{} at {stop}", kind.name());
        }
    }
}

#[test]
fn what_is_known_later_is_kept() {
    let sensor = sensor();
    let mut filter = sensor.filter().build().unwrap();
    filter.rest_resistance(1650.0).unwrap();
    filter.step(0.0, 1700.0).unwrap();
    filter.know(0.03, 0.001).unwrap();
    let mut resumed = sensor.filter().resume(&text_of(&filter.store().unwrap())).unwrap();
    let know = |filter: &mut ohmstrain::Filter| filter.know(0.031, 0.001).unwrap();
    assert_eq!(shown(&[know(&mut resumed)]), shown(&[know(&mut filter)]));
    let next = |filter: &mut ohmstrain::Filter| filter.step(0.1, 1720.0).unwrap();
    assert_eq!(shown(&[next(&mut resumed)]), shown(&[next(&mut filter)]));
}

#[test]
fn a_state_of_something_else_is_refused() {
    let sensor = sensor();
    let stored = sensor.filter().build().unwrap().store().unwrap();
    let refused = |error: Error| match error {
        Error::Stored(error) => error,
        other => panic!("{other}"),
    };
    let mut params = sensor.params().clone();
    params.rest_reading *= 1.01;
    let other = Sensor::from_params(params).unwrap();
    assert!(matches!(refused(other.filter().resume(&stored).unwrap_err()), StoredError::Sensor));
    for (builder, name) in [
        (sensor.filter().estimator(EstimatorKind::Ekf), "estimator"),
        (sensor.filter().gate(10.8), "gate"),
        (sensor.filter().influence(ohmstrain::Influence::Full), "influence"),
        (sensor.filter().without_doubts(), "without"),
    ] {
        let error = refused(builder.resume(&stored).unwrap_err());
        assert!(matches!(error, StoredError::Options { name: found, .. } if found == name), "{error}");
    }
    let lagged = refused(sensor.filter().resume_lagged(0.5, &stored).unwrap_err());
    assert!(lagged.to_string().contains("lag none, this one has 0.5 s"), "{lagged}");
    let begun = refused(sensor.filter().initial_strain(0.0).resume(&stored).unwrap_err());
    assert!(matches!(begun, StoredError::Begun));
    let text = stored.to_toml().unwrap();
    for (wrong, expected) in [
        (text.replace("made_by = \"ohmstrain 0", "made_by = \"ohmstrain 9"), "found one of ohmstrain 9"),
        ("time_s,resistance_ohm\n".into(), "expected the state of a filter"),
    ] {
        let error = Stored::from_toml(&wrong).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    // The times of a pause that never ends.
    for (time, endless) in [("passed = 0.0", "passed = inf"), ("ahead_s = 0.0", "ahead_s = nan")] {
        assert!(text.contains(time));
        let damaged = Stored::from_toml(&text.replace(time, endless)).unwrap();
        assert!(matches!(refused(sensor.filter().resume(&damaged).unwrap_err()), StoredError::Content(_)), "{endless}");
    }
    // Of another estimator's numbers.
    let ekf = sensor.filter().estimator(EstimatorKind::Ekf).build().unwrap().store().unwrap().to_toml().unwrap();
    let swapped = Stored::from_toml(&ekf.replace("estimator = \"ekf\"", "estimator = \"sign-split\"")).unwrap();
    assert!(matches!(refused(sensor.filter().resume(&swapped).unwrap_err()), StoredError::Content(_)));
}
