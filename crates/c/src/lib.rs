//! C library: `ohmstrain`'s sensors, filters and smoother behind the functions of `include/ohmstrain_c.h`.
//!
//! Pointers that a caller passes must come from this library and must not be freed before; text is UTF-8 that ends with a
//! zero. A null pointer is an error, not undefined behaviour. Panics do not cross into C: they are errors.

mod error;
mod estimate;

use std::ffi::{CStr, c_char, c_int};
use std::slice;

use ohmstrain::{Filter, Sensor};

pub use error::ohmc_error;
use error::{Failure, returned, status};
pub use estimate::Estimate;

/// Returns the version of the library, a text that ends with a zero.
#[unsafe(no_mangle)]
pub extern "C" fn ohmc_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}

/// Reads a sensor from the text of a `sensor.toml`; null if it is wrong.
///
/// # Safety
/// `toml` is null or text that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_sensor_from_text(toml: *const c_char) -> *mut Sensor {
    returned(|| {
        // SAFETY: as this function's.
        let toml = unsafe { text(toml, "toml") }?;
        Ok(Sensor::from_toml(toml)?)
    })
}

/// Reads a sensor from a `sensor.toml`; null if it is wrong.
///
/// # Safety
/// `path` is null or text that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_sensor_from_file(path: *const c_char) -> *mut Sensor {
    returned(|| {
        // SAFETY: as this function's.
        let path = unsafe { text(path, "path") }?;
        let toml = std::fs::read_to_string(path).map_err(|error| Failure(format!("{path}: {error}")))?;
        Sensor::from_toml(&toml).map_err(|error| Failure(error.in_file(path).to_string()))
    })
}

/// Frees a sensor; null is nothing to free.
///
/// # Safety
/// `sensor` is null or comes from this library, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_sensor_free(sensor: *mut Sensor) {
    if !sensor.is_null() {
        // SAFETY: it was made by `Box::into_raw`, and belongs to the caller.
        drop(unsafe { Box::from_raw(sensor) });
    }
}

/// Makes a filter; NaN for a reading at rest or a strain at the start that is not known.
///
/// # Safety
/// `sensor` is null or a sensor of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_new(
    sensor: *const Sensor,
    rest_resistance: f64,
    initial_strain: f64,
) -> *mut Filter {
    returned(|| {
        // SAFETY: as this function's.
        let mut builder = unsafe { sensor.as_ref() }.ok_or(Failure::null("sensor"))?.filter();
        if !rest_resistance.is_nan() {
            builder = builder.rest_resistance(rest_resistance);
        }
        if !initial_strain.is_nan() {
            builder = builder.initial_strain(initial_strain);
        }
        Ok(builder.build()?)
    })
}

/// Frees a filter; null is nothing to free.
///
/// # Safety
/// `filter` is null or comes from this library, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_free(filter: *mut Filter) {
    if !filter.is_null() {
        // SAFETY: it was made by `Box::into_raw`, and belongs to the caller.
        drop(unsafe { Box::from_raw(filter) });
    }
}

/// Takes a reading, NaN for a missing one, at a time, s, after the last one. Returns 0, or 1 on failure.
///
/// # Safety
/// `filter` is null or a filter of this library that no other thread uses; `estimate` is null or has room for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_step(
    filter: *mut Filter,
    time_s: f64,
    reading: f64,
    estimate: *mut Estimate,
) -> c_int {
    status(|| {
        // SAFETY: as this function's.
        let (filter, estimate) = unsafe { (filter.as_mut(), estimate.as_mut()) };
        let (filter, estimate) = (filter.ok_or(Failure::null("filter"))?, estimate.ok_or(Failure::null("estimate"))?);
        *estimate = Estimate::from(&filter.step(time_s, reading)?);
        Ok(())
    })
}

/// Gives the strain at the last row, with a standard deviation. Returns 0, or 1 on failure.
///
/// # Safety
/// As for [`ohmc_filter_step`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_know(filter: *mut Filter, strain: f64, sd: f64, estimate: *mut Estimate) -> c_int {
    status(|| {
        // SAFETY: as this function's.
        let (filter, estimate) = unsafe { (filter.as_mut(), estimate.as_mut()) };
        let (filter, estimate) = (filter.ok_or(Failure::null("filter"))?, estimate.ok_or(Failure::null("estimate"))?);
        *estimate = Estimate::from(&filter.know(strain, sd)?);
        Ok(())
    })
}

/// Sets the reading of the rested sensor from now on. Returns 0, or 1 on failure.
///
/// # Safety
/// `filter` is null or a filter of this library that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_rest_resistance(filter: *mut Filter, measured: f64) -> c_int {
    status(|| {
        // SAFETY: as this function's.
        let filter = unsafe { filter.as_mut() }.ok_or(Failure::null("filter"))?;
        Ok(filter.rest_resistance(measured)?)
    })
}

/// Estimates all rows of a recording from all of its readings. Returns 0, or 1 on failure.
///
/// # Safety
/// `sensor` is null or a sensor of this library; the other pointers are null or have `rows` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_smooth(
    sensor: *const Sensor,
    rows: usize,
    time_s: *const f64,
    reading: *const f64,
    estimates: *mut Estimate,
) -> c_int {
    status(|| {
        for (name, is_null) in
            [("time_s", time_s.is_null()), ("reading", reading.is_null()), ("estimates", estimates.is_null())]
        {
            if is_null {
                return Err(Failure::null(name));
            }
        }
        // SAFETY: as this function's; none is null.
        let (sensor, time_s, reading, estimates) = unsafe {
            let columns = (slice::from_raw_parts(time_s, rows), slice::from_raw_parts(reading, rows));
            (sensor.as_ref(), columns.0, columns.1, slice::from_raw_parts_mut(estimates, rows))
        };
        let smoothed = sensor.ok_or(Failure::null("sensor"))?.smooth(time_s, reading)?;
        for (estimate, row) in estimates.iter_mut().zip(&smoothed) {
            *estimate = Estimate::from(row);
        }
        Ok(())
    })
}

/// Borrows a text.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::null(name));
    }
    // SAFETY: as this function's; it is not null.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| Failure(format!("{name}: expected text in UTF-8")))
}
