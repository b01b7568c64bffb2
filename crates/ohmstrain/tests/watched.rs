//! A filter with remarks for a person who watches.

use ohmstrain::trace::WatchedFilter;
use ohmstrain::{Estimate, Known, Sensor};
use ohmstrain_bench_data::{Reading, Row};

fn sensor() -> Sensor {
    Sensor::from_toml(include_str!("../examples/sensor.toml")).unwrap()
}

fn row(time_s: f64, ohm: f64) -> Row {
    let reading = Reading { value: ohm, sd_ohm: None, code: None, saturated: false };
    Row { line: 1, time_s, reading, reference: f64::NAN, reference_sd: f64::NAN, temperature_c: f64::NAN }
}

/// Takes readings, five a second from `start_s` on, and returns the last estimate.
fn takes(filter: &mut WatchedFilter, start_s: f64, readings: impl IntoIterator<Item = f64>) -> Estimate {
    let mut last = None;
    for (k, ohm) in (0_u32..).zip(readings) {
        let estimate = filter.step(&row(start_s + 0.2 * f64::from(k), ohm)).unwrap();
        filter.remark(&estimate, "z").unwrap();
        last = Some(estimate);
    }
    last.unwrap()
}

/// Readings around that of the rested sensor, 1600 Ω.
fn rested(count: u32) -> impl Iterator<Item = f64> {
    (0..count).map(|k| 1600.0 + f64::from(k % 3))
}

/// After a zero, a strain known before it is not told again, and one that is to come is.
#[test]
fn a_zero_forgets_strains_known_before_it() {
    let sensor = sensor();
    let known = [Known::new(1.0, 0.2), Known::new(30.0, 0.1)];
    let wanted = sensor.filter().known(&known);
    let mut filter = WatchedFilter::new(wanted, 0).unwrap();
    takes(&mut filter, 0.0, rested(50));
    assert!(filter.zero(wanted, 1601.0).unwrap());
    let after = takes(&mut filter, 10.0, rested(1));
    assert!(after.strain.abs() < 0.01, "{}", after.strain);
    let told = takes(&mut filter, 30.0, rested(1));
    assert!((told.strain - 0.1).abs() < 0.01, "{}", told.strain);
}

/// The median of the first readings is R₀, also for a filter that begins anew; a zero among them has the last word.
#[test]
fn the_first_readings_give_r0_unless_a_person_does() {
    let sensor = sensor();
    let shifted = || rested(10).map(|ohm| 1.3 * ohm);
    let strain_of = |zeroed: bool| {
        let mut filter = WatchedFilter::new(sensor.filter(), 10).unwrap();
        takes(&mut filter, 0.0, shifted().take(5));
        if zeroed {
            filter.zero(sensor.filter(), 1600.0).unwrap();
        }
        takes(&mut filter, 1.0, shifted().skip(5));
        filter.begin(sensor.filter()).unwrap();
        takes(&mut filter, 0.0, shifted()).strain
    };
    let given = |rest: f64| {
        let mut filter = sensor.filter().rest_resistance(rest).build().unwrap();
        let rows = (0_u32..).zip(shifted());
        rows.map(|(k, ohm)| filter.step(0.2 * f64::from(k), ohm).unwrap().strain).last().unwrap()
    };
    // The sixth of ten readings in order of size is in the middle with the fifth: both are 1601 Ω, times 1.3.
    assert_eq!(strain_of(false), given(1.3 * 1601.0));
    assert_eq!(strain_of(true), given(1600.0));
}

/// Twenty readings in the wrong unit are remarked upon, once.
#[test]
fn the_unit_of_the_first_readings_is_doubted_once() {
    let sensor = sensor();
    let mut filter = WatchedFilter::new(sensor.filter(), 0).unwrap();
    let mut remarks = Vec::new();
    for (k, ohm) in (0_u32..).zip(rested(40)) {
        let estimate = filter.step(&row(0.2 * f64::from(k), 1e-3 * ohm)).unwrap();
        remarks.extend(filter.remark(&estimate, "z").unwrap().map(|remark| (k, remark)));
    }
    let of_unit: Vec<u32> = remarks
        .iter()
        .filter(|(_, remark)| remark.contains("kΩ") || remark.contains("kohm"))
        .map(|(k, _)| *k)
        .collect();
    assert_eq!(of_unit, [19], "{remarks:?}");
}
