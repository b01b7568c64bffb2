//! Rows are those of `estimates.csv`, whichever way they are asked for.

use ohmstrain::{Error, Estimate, EstimatorKind, Flag, JointParams, Reading, ReadingUnit, Sensor};

fn sensor() -> Sensor {
    Sensor::from_toml(include_str!("../examples/sensor.toml")).unwrap()
}

/// Twelve seconds of stretching and releasing; every seventh reading is missing.
fn recording() -> (Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..240).map(|k| 0.05 * f64::from(k)).collect();
    let ohm = |(k, t): (usize, &f64)| if k % 7 == 3 { f64::NAN } else { 2100.0 - 450.0 * (0.8 * t).cos() };
    let ohm = time_s.iter().enumerate().map(ohm).collect();
    (time_s, ohm)
}

fn filtered(sensor: &Sensor) -> Vec<Estimate> {
    let (time_s, ohm) = recording();
    let mut filter = sensor.filter().build().unwrap();
    time_s.iter().zip(&ohm).map(|(t, ohm)| filter.step(*t, *ohm).unwrap()).collect()
}

/// Header as README and DESIGN have it, written out here.
const HEADER: &str = "time_s,resistance_ohm,strain,strain_sd,strain_rate,strain_rate_sd,relaxation,relaxation_sd,baseline,\
                      settled_resistance_ohm,settled_resistance_sd_ohm,p_extend,p_hold,p_retract,p_beyond_border,nis,flags";

#[test]
fn serialised_rows_have_the_columns_of_estimates_csv() {
    let knee = JointParams { prestrain: 0.05, moment_arm_mm: 4.4, gauge_length_mm: 30.0 };
    let mut ratio = sensor().into_params();
    let rest = std::mem::replace(&mut ratio.rest_reading, 1.0);
    ratio.measured_rest = ratio.measured_rest.map(|measured| measured / rest);
    ratio.validity.reading_lower /= rest;
    ratio.validity.reading_upper /= rest;
    ratio.reading = ReadingUnit::Ratio;
    for (sensor, scale, header) in [
        (sensor(), 1.0, HEADER.to_string()),
        (sensor().on_joint(knee).unwrap(), 1.0, format!("{HEADER},angle_deg,angle_sd")),
        (Sensor::from_params(ratio).unwrap(), rest, HEADER.replace("_ohm", "_ratio")),
    ] {
        let mut filter = sensor.filter().build().unwrap();
        let mut csv = csv::Writer::from_writer(Vec::new());
        csv.serialize(filter.step(0.0, 1700.0 / scale).unwrap()).unwrap();
        csv.serialize(filter.step(0.1, None).unwrap()).unwrap();
        let text = String::from_utf8(csv.into_inner().unwrap()).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], header);
        let names: Vec<&str> = sensor.columns().iter().map(|column| column.name()).collect();
        assert_eq!(names.join(","), header);
        let missing: Vec<&str> = lines[2].split(',').collect();
        assert_eq!((missing[1], missing[15], missing[16]), ("", "", "missing|start_up"));
    }
}

/// Every number that serde writes is that of its column; an unknown one is null.
#[test]
fn columns_and_fields_agree() {
    let sensor = sensor();
    for row in filtered(&sensor) {
        let json = serde_json::to_value(row).unwrap();
        for column in sensor.columns().into_iter().filter(|column| !column.is_flags()) {
            let number = column.number(&row);
            assert_eq!(json[column.name()].as_f64(), Some(number).filter(|number| number.is_finite()));
        }
        let sum = row.p_extend.unwrap() + row.p_hold.unwrap() + row.p_retract.unwrap();
        // Three sums of at most eight weights, each rounded once.
        assert!((sum - 1.0).abs() < 24.0 * f64::EPSILON, "{sum}");
    }
}

/// The last row of a smoother knows what the filter knows, and so does that of a lag; the strain's deviation has another
/// calibrated factor.
#[test]
fn all_ways_agree_at_the_end() {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let filtered = filtered(&sensor);
    let smoothed = sensor.smooth(&time_s, &ohm).unwrap();
    let mut filter = sensor.filter().build_lagged(1.0).unwrap();
    let mut lagged = Vec::new();
    for (t, ohm) in time_s.iter().zip(&ohm) {
        lagged.extend_from_slice(filter.step(*t, *ohm).unwrap());
    }
    // Rows at most a second old wait: 20 steps of 0.05 s.
    assert!((time_s.len() - 21..=time_s.len() - 20).contains(&lagged.len()), "{}", lagged.len());
    lagged.extend_from_slice(filter.finish().unwrap());
    for rows in [&smoothed, &lagged] {
        assert!(rows.iter().map(|row| row.time_s).eq(time_s.iter().copied()));
        let (last, filter) = (rows.last().unwrap(), filtered.last().unwrap());
        assert_eq!((last.strain, last.strain_rate, last.nis), (filter.strain, filter.strain_rate, filter.nis));
    }
}

/// A smoother's correction has learned from rows with later readings. At the last reading there are none, and its strain is the
/// filter's.
#[test]
fn a_corrected_smoother_ends_where_the_filter_does() {
    let sensor = Sensor::from_toml(include_str!("../../../tests/fixtures/representative.toml")).unwrap();
    assert_eq!(sensor.params().default_estimator, EstimatorKind::Corrected);
    let time_s: Vec<f64> = (0..400).map(|k| 0.05 * f64::from(k)).collect();
    let rest = 3199.661;
    let ohm: Vec<f64> = time_s.iter().map(|time_s| rest * (1.6 - 0.6 * (0.4 * time_s).cos())).collect();
    // Without what a smoother does in another way, or not at all.
    let bare = || sensor.filter().rest_resistance(rest).without_second_look().without_doubts();
    let smoothed = bare().smooth(&time_s, &ohm).unwrap();
    let mut filter = bare().build().unwrap();
    let filtered: Vec<Estimate> = time_s.iter().zip(&ohm).map(|(t, ohm)| filter.step(*t, *ohm).unwrap()).collect();
    let (smoothed, filtered) = (smoothed.last().unwrap(), filtered.last().unwrap());
    assert_eq!((smoothed.strain, smoothed.strain_sd), (filtered.strain, filtered.strain_sd));
}

#[test]
fn an_error_leaves_the_filter_as_it_was() {
    let sensor = sensor();
    let (mut disturbed, mut undisturbed) = (sensor.filter().build().unwrap(), sensor.filter().build().unwrap());
    for (t, ohm) in [(0.0, 1700.0), (0.1, 1710.0)] {
        assert_eq!(disturbed.step(t, ohm).unwrap(), undisturbed.step(t, ohm).unwrap());
    }
    for t in [0.05, f64::NAN, f64::NEG_INFINITY] {
        assert!(matches!(disturbed.step(t, 1720.0), Err(Error::Step(_))), "{t}");
    }
    assert_eq!(disturbed.step(0.2, 1730.0).unwrap(), undisturbed.step(0.2, 1730.0).unwrap());
}

/// Values that no sensor can have are missing readings with a name.
#[test]
fn readings_that_are_none() {
    let sensor = sensor();
    for (reading, flag) in [
        (Reading::from(f64::INFINITY), Flag::Implausible),
        (Reading::from(-10.0), Flag::Implausible),
        (Reading::from(9.9e37), Flag::Implausible),
        (Reading::MISSING, Flag::Missing),
        (Reading { saturated: true, ..Reading::MISSING }, Flag::Saturated),
    ] {
        let mut filter = sensor.filter().build().unwrap();
        filter.step(0.0, 1700.0).unwrap();
        let row = filter.step(0.1, reading).unwrap();
        assert!(row.flags.has(flag) && row.nis.is_none(), "{reading:?}: {}", row.flags);
        assert!(row.strain.is_finite() && row.strain_sd > 0.0);
    }
}

/// Readings that all are a tenth higher are those of a sensor whose resistance at rest is a tenth higher.
#[test]
fn another_rest_resistance_scales_readings() {
    let (sensor, (time_s, ohm)) = (sensor(), recording());
    let rested = sensor.params().measured_rest.unwrap();
    let higher: Vec<f64> = ohm.iter().map(|ohm| 1.1 * ohm).collect();
    let expected = sensor.smooth(&time_s, &ohm).unwrap();
    let found = sensor.filter().rest_resistance(1.1 * rested).smooth(&time_s, &higher).unwrap();
    for (a, b) in found.iter().zip(&expected) {
        // Readings differ by rounding, 1e-16 relative; a gain of 240 rows and hypotheses leaves six digits more than enough.
        assert!((a.strain - b.strain).abs() < 1e-6 * b.strain_sd.max(1e-3), "{} {}", a.strain, b.strain);
        assert!((a.settled_resistance - 1.1 * b.settled_resistance).abs() < 1e-6 * b.settled_resistance);
    }
}

/// A resistance at rest in kΩ, in MΩ, or of a sensor of another size is refused wherever it is given; one that differs by a factor of 4 is not.
#[test]
fn a_rest_resistance_of_no_such_sensor_is_refused() {
    let sensor = sensor();
    let rested = sensor.params().rested();
    let mut running = sensor.filter().build().unwrap();
    running.step(0.0, rested).unwrap();
    let mut lagged = sensor.filter().build_lagged(0.2).unwrap();
    for factor in [1e-6, 1e-3, 0.24, 4.1, 9.0, 1e3] {
        let far = factor * rested;
        let refused = [
            sensor.check_rest_resistance(far).unwrap_err(),
            sensor.filter().rest_resistance(far).build().unwrap_err(),
            sensor.filter().rest_resistance(far).build_lagged(0.2).unwrap_err(),
            running.rest_resistance(far).unwrap_err(),
            lagged.rest_resistance(far).unwrap_err(),
        ];
        for refused in refused {
            assert!(matches!(refused, Error::FarRest { found, .. } if found == far), "{factor}: {refused}");
            let text = refused.to_string();
            assert!(text.starts_with("resistance at rest: expected ") && text.contains("found "), "{text}");
        }
    }
    // The filter stays as it was.
    let mut other = sensor.filter().build().unwrap();
    other.step(0.0, rested).unwrap();
    assert_eq!(running.step(0.1, 1.1 * rested).unwrap(), other.step(0.1, 1.1 * rested).unwrap());
    for factor in [0.25, 1.0, 4.0] {
        assert!(sensor.filter().rest_resistance(factor * rested).build().is_ok(), "{factor}");
    }
}

#[test]
fn options_that_make_no_sense_are_refused_by_name() {
    let sensor = sensor();
    let refused = |found: Result<ohmstrain::Filter, Error>| found.unwrap_err().to_string();
    assert!(refused(sensor.filter().gate(0.0).build()).contains("gate"));
    assert!(refused(sensor.filter().initial_strain(f64::NAN).build()).contains("initial strain"));
    assert!(refused(sensor.filter().rest_resistance(-1.0).build()).contains("resistance at rest"));
    assert!(refused(sensor.filter().estimator(EstimatorKind::Ukf).build()).contains("ukf"));
    assert!(sensor.filter().build_lagged(0.0).unwrap_err().to_string().contains("lag"));
    let (times, readings) = (&[0.0, 0.1][..], &[1700.0][..]);
    assert!(matches!(sensor.smooth(times, readings), Err(Error::Lengths { times: 2, readings: 1 })));
    assert!(matches!(sensor.smooth(times, &[1.7, 1.7]), Err(Error::Unit(_))));
    assert!(matches!(sensor.smooth(&[0.1, 0.0], &[1700.0; 2]), Err(Error::Row { row: 1, .. })));
}

/// Ten seconds at one reading, with noise, then one row of something else.
fn after_a_while(last: Reading) -> Estimate {
    let mut filter = sensor().filter().build().unwrap();
    for k in 0..200 {
        filter.step(0.05 * f64::from(k), 1700.0 + f64::from(k * 7 % 5)).unwrap();
    }
    filter.step(10.0, last).unwrap()
}

/// A reading in a hold settles no farther from itself than by all of the relaxation, whatever the filter's strain.
/// After the last reading the filter's expected reading takes its place, and is less and less certain.
#[test]
fn settling_starts_from_the_reading() {
    let mut filter = sensor().filter().build().unwrap();
    let read =
        (0..200).map(|k| filter.step(0.05 * f64::from(k), 1700.0 + f64::from(k * 7 % 5)).unwrap()).last().unwrap();
    let most = sensor().params().rest_reading * read.relaxation.abs() + 20.0;
    assert!((read.settled_resistance - 1700.0).abs() < most, "{read:?}");
    let missing: Vec<Estimate> = (200..300).map(|k| filter.step(0.05 * f64::from(k), None).unwrap()).collect();
    for row in &missing {
        let off = (row.settled_resistance - read.settled_resistance).abs();
        assert!(off < 1.96 * row.settled_resistance_sd, "{row:?}");
    }
    assert!(missing[99].settled_resistance_sd > 1.5 * read.settled_resistance_sd, "{read:?} {:?}", missing[99]);
}

/// A reading that nobody expected may be an outlier: one deviation reaches from it to what was expected.
#[test]
fn an_outlier_leaves_open_where_readings_settle() {
    let (read, outlier) = (after_a_while(1700.0.into()), after_a_while(2100.0.into()));
    assert!(outlier.flags.has(Flag::Downweighted), "{}", outlier.flags);
    assert!(outlier.settled_resistance_sd > 300.0, "{}", outlier.settled_resistance_sd);
    let off = (outlier.settled_resistance - read.settled_resistance).abs();
    assert!(off < 1.96 * outlier.settled_resistance_sd, "{off}");
}
