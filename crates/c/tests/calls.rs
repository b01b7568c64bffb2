use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

use ohmstrain::{Flag, Sensor};
use ohmstrain_c::*;

use super::{SENSOR, rows};

fn message() -> String {
    // SAFETY: a text that ends with a zero.
    unsafe { CStr::from_ptr(ohmc_error()) }.to_str().unwrap().into()
}

fn text(text: &str) -> CString {
    CString::new(text).unwrap()
}

/// Compares an estimate with a row of the Rust library, number by number, to the bit.
fn same(found: &Estimate, row: &ohmstrain::Estimate) {
    let known = |value: Option<f64>| value.unwrap_or(f64::NAN);
    let numbers = [
        (found.time_s, row.time_s),
        (found.strain, row.strain),
        (found.strain_sd, row.strain_sd),
        (found.strain_rate, row.strain_rate),
        (found.strain_rate_sd, row.strain_rate_sd),
        (found.relaxation, row.relaxation),
        (found.relaxation_sd, row.relaxation_sd),
        (found.baseline, row.baseline),
        (found.settled_resistance, row.settled_resistance),
        (found.settled_resistance_sd, row.settled_resistance_sd),
        (found.p_extend, known(row.p_extend)),
        (found.p_hold, known(row.p_hold)),
        (found.p_retract, known(row.p_retract)),
        (found.p_beyond_border, row.p_beyond_border),
        (found.nis, known(row.nis)),
        (found.angle_deg, known(row.angle_deg)),
        (found.angle_sd, known(row.angle_sd)),
    ];
    for (place, (found, expected)) in numbers.into_iter().enumerate() {
        assert!(found == expected || found.is_nan() && expected.is_nan(), "number {place}: {found}, {expected}");
    }
    for (bit, flag) in Flag::ALL.into_iter().enumerate() {
        assert_eq!(found.flags >> bit & 1 == 1, row.flags.has(flag), "{}", flag.name());
    }
}

/// Filter, known strain, reading at rest and smoother give the numbers of the Rust library, to the bit, for a sensor on a joint.
#[test]
fn numbers_are_those_of_the_library() {
    const JOINT: &str = "\n[joint]\nprestrain = 0.05\nmoment_arm_mm = 4.4\ngauge_length_mm = 30.0\n";
    let toml = std::fs::read_to_string(SENSOR).unwrap() + JOINT;
    let expected = Sensor::from_toml(&toml).unwrap();
    let mut place = MaybeUninit::<Estimate>::uninit();
    // SAFETY: pointers are of this library or of this function; an estimate is read after a call has written it.
    unsafe {
        let sensor = ohmc_sensor_from_text(text(&toml).as_ptr());
        let filter = ohmc_filter_new(sensor, 1650.0, 0.0);
        let mut twin = expected.filter().rest_resistance(1650.0).initial_strain(0.0).build().unwrap();
        for (k, (time_s, reading)) in rows().into_iter().enumerate() {
            assert_eq!(ohmc_filter_step(filter, time_s, reading, place.as_mut_ptr()), 0, "{}", message());
            let row = twin.step(time_s, reading).unwrap();
            assert!(row.angle_deg.is_some() && row.p_hold.is_some());
            same(&place.assume_init(), &row);
            if k == 120 {
                assert_eq!(ohmc_filter_know(filter, 0.05, 0.002, place.as_mut_ptr()), 0);
                same(&place.assume_init(), &twin.know(0.05, 0.002).unwrap());
                assert_eq!(ohmc_filter_rest_resistance(filter, 1660.0), 0);
                twin.rest_resistance(1660.0).unwrap();
            }
        }
        let (times, readings): (Vec<f64>, Vec<f64>) = rows().into_iter().unzip();
        let mut smoothed = vec![place; times.len()];
        let out = smoothed.as_mut_ptr().cast();
        assert_eq!(ohmc_smooth(sensor, times.len(), times.as_ptr(), readings.as_ptr(), out), 0);
        for (found, row) in smoothed.iter().zip(expected.smooth(&times, &readings).unwrap()) {
            same(&found.assume_init(), &row);
        }
        ohmc_filter_free(filter);
        ohmc_sensor_free(sensor);
    }
}

/// Each failure says what was wrong, and leaves estimate and filter as they were.
#[test]
fn failures_have_messages() {
    let library = Sensor::from_toml(&std::fs::read_to_string(SENSOR).unwrap()).unwrap();
    let mut twin = library.filter().build().unwrap();
    // SAFETY: pointers are null, of this library or of this function.
    unsafe {
        assert!(ohmc_sensor_from_text(null()).is_null() && message() == "toml: expected a pointer, found NULL");
        let wrong = ohmc_sensor_from_text(text("format = 9").as_ptr());
        assert!(wrong.is_null() && message().contains("made_by"), "{}", message());
        assert!(ohmc_sensor_from_file(text("none.toml").as_ptr()).is_null() && message().starts_with("none.toml: "));
        assert!(ohmc_filter_new(null(), f64::NAN, f64::NAN).is_null() && message().starts_with("sensor: "));
        let sensor = ohmc_sensor_from_file(text(SENSOR).as_ptr());
        assert!(ohmc_filter_new(sensor, -1.0, f64::NAN).is_null() && message().contains("-1"), "{}", message());
        let filter = ohmc_filter_new(sensor, f64::NAN, f64::NAN);
        let mut estimate = Estimate::from(&ohmstrain::Estimate::default());
        assert_eq!(ohmc_filter_step(filter, 0.0, 1700.0, &mut estimate), 0);
        twin.step(0.0, 1700.0).unwrap();
        let before = estimate;
        assert_eq!(ohmc_filter_step(filter, -1.0, 1700.0, &mut estimate), 1);
        assert_eq!(
            (estimate.strain, estimate.nis, message().as_str()),
            (before.strain, before.nis, "the time step is negative")
        );
        assert_eq!(ohmc_filter_step(filter, 1.0, 1700.0, null_mut()), 1);
        assert_eq!(ohmc_filter_step(filter, 1.0, 1750.0, &mut estimate), 0);
        same(&estimate, &twin.step(1.0, 1750.0).unwrap());
        assert_eq!(ohmc_smooth(sensor, 1, null(), null(), &mut estimate), 1);
        assert_eq!(message(), "time_s: expected a pointer, found NULL");
        assert_eq!(ohmc_smooth(sensor, usize::MAX, [0.0].as_ptr(), [0.0].as_ptr(), &mut estimate), 1);
        assert_eq!(ohmc_smooth(sensor, 0, null(), null(), null_mut()), 0);
        ohmc_filter_free(filter);
        ohmc_sensor_free(sensor);
        ohmc_filter_free(null_mut());
        ohmc_sensor_free(null_mut());
    }
}

/// The header's flags are bits in the order of the library's.
#[test]
fn flags_of_the_header_are_those_of_the_library() {
    let header = include_str!("../include/ohmstrain_c.h");
    for (bit, flag) in Flag::ALL.iter().enumerate() {
        let line = format!("OHMC_{} = 1 << {bit}", flag.name().to_uppercase());
        assert!(header.contains(&line), "{line}");
    }
    assert_eq!(header.matches(" = 1 << ").count(), Flag::ALL.len());
}
