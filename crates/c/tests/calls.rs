use std::ffi::{CStr, CString};
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

/// Filter, known strain, reading at rest and smoother give the numbers of the Rust library, to the bit.
#[test]
fn numbers_are_those_of_the_library() {
    let toml = std::fs::read_to_string(SENSOR).unwrap();
    let expected = Sensor::from_toml(&toml).unwrap();
    let same = |found: &Estimate, row: &ohmstrain::Estimate| {
        // NaN is equal to none, its text to itself.
        assert_eq!(format!("{found:?}"), format!("{:?}", Estimate::from(row)));
    };
    let mut found = Estimate::from(&ohmstrain::Estimate::default());
    // SAFETY: pointers are of this library or of this function.
    unsafe {
        let sensor = ohmc_sensor_from_text(text(&toml).as_ptr());
        let filter = ohmc_filter_new(sensor, 1650.0, 0.0);
        let mut twin = expected.filter().rest_resistance(1650.0).initial_strain(0.0).build().unwrap();
        for (k, (time_s, reading)) in rows().into_iter().enumerate() {
            assert_eq!(ohmc_filter_step(filter, time_s, reading, &mut found), 0, "{}", message());
            same(&found, &twin.step(time_s, reading).unwrap());
            if k == 120 {
                assert_eq!(ohmc_filter_know(filter, 0.05, 0.002, &mut found), 0);
                same(&found, &twin.know(0.05, 0.002).unwrap());
                assert_eq!(ohmc_filter_rest_resistance(filter, 1660.0), 0);
                twin.rest_resistance(1660.0).unwrap();
            }
        }
        let (times, readings): (Vec<f64>, Vec<f64>) = rows().into_iter().unzip();
        let mut smoothed = vec![found; times.len()];
        assert_eq!(ohmc_smooth(sensor, times.len(), times.as_ptr(), readings.as_ptr(), smoothed.as_mut_ptr()), 0);
        for (found, row) in smoothed.iter().zip(expected.smooth(&times, &readings).unwrap()) {
            same(found, &row);
        }
        ohmc_filter_free(filter);
        ohmc_sensor_free(sensor);
    }
}

/// Each failure says what was wrong, and leaves estimate and filter as they were.
#[test]
fn failures_have_messages() {
    // SAFETY: pointers are null, of this library or of this function.
    unsafe {
        assert!(ohmc_sensor_from_text(null()).is_null() && message() == "toml: expected a pointer, found NULL");
        assert!(
            ohmc_sensor_from_text(text("format = 9").as_ptr()).is_null() && message().contains("made_by"),
            "{}",
            message()
        );
        assert!(ohmc_sensor_from_file(text("none.toml").as_ptr()).is_null() && message().starts_with("none.toml: "));
        assert!(ohmc_filter_new(null(), f64::NAN, f64::NAN).is_null() && message().starts_with("sensor: "));
        let sensor = ohmc_sensor_from_file(text(SENSOR).as_ptr());
        assert!(ohmc_filter_new(sensor, -1.0, f64::NAN).is_null() && message().contains("-1"), "{}", message());
        let filter = ohmc_filter_new(sensor, f64::NAN, f64::NAN);
        let mut first = Estimate::from(&ohmstrain::Estimate::default());
        assert_eq!(ohmc_filter_step(filter, 0.0, 1700.0, &mut first), 0);
        let mut again = first;
        assert_eq!(ohmc_filter_step(filter, -1.0, 1700.0, &mut again), 1);
        assert!(again.strain == first.strain && message() == "the time step is negative", "{}", message());
        assert_eq!(ohmc_filter_step(filter, 1.0, 1700.0, null_mut()), 1);
        assert_eq!(ohmc_smooth(sensor, 1, null(), null(), &mut again), 1);
        assert_eq!(message(), "time_s: expected a pointer, found NULL");
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
