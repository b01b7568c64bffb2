//! C library: `ohmstrain`'s sensors, filters and smoother behind the functions of `include/ohmstrain_c.h`.
//!
//! Pointers that a caller passes must come from this library and must not have been freed; text is UTF-8 that ends with a zero.
//! A null pointer is an error, not undefined behaviour. Estimates are written and never read, so their memory may be
//! uninitialised. Panics do not cross into C: they are errors, and a filter that panicked refuses further use.

#[cfg(panic = "abort")]
compile_error!("panics must unwind to the boundary of the library");

mod error;
mod estimate;
mod filter;

use std::ffi::{CStr, c_char, c_int};
use std::slice;

use ohmstrain::Sensor;

pub use error::ohmc_error;
use error::{Failure, free, not_null, returned, status};
pub use estimate::Estimate;
pub use filter::{
    Handle, ohmc_filter_free, ohmc_filter_know, ohmc_filter_new, ohmc_filter_rest_resistance, ohmc_filter_step,
};

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
        Ok(Sensor::from_toml(toml)?.without_temperature())
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
        let sensor = Sensor::from_toml(&toml).map_err(|error| Failure(error.in_file(path).to_string()))?;
        Ok(sensor.without_temperature())
    })
}

/// Frees a sensor; null is nothing to free.
///
/// # Safety
/// `sensor` is null or comes from this library, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_sensor_free(sensor: *mut Sensor) {
    // SAFETY: as this function's.
    unsafe { free(sensor) }
}

/// Estimates all rows of a recording from all of its readings. Returns 0, or 1 on failure. Without rows the pointers may be null.
///
/// # Safety
/// `sensor` is null or a sensor of this library. The other pointers are null or have `rows` elements; `estimates` may be
/// uninitialised and does not overlap the others.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_smooth(
    sensor: *const Sensor,
    rows: usize,
    time_s: *const f64,
    reading: *const f64,
    estimates: *mut Estimate,
) -> c_int {
    status(|| {
        // SAFETY: as this function's.
        let sensor = unsafe { sensor.as_ref() }.ok_or_else(|| Failure::null("sensor"))?;
        if rows == 0 {
            return Ok(());
        }
        if rows > isize::MAX as usize / size_of::<Estimate>() {
            return Err(Failure(format!("rows: expected a number that fits into memory, found {rows}")));
        }
        not_null(time_s, "time_s")?;
        not_null(reading, "reading")?;
        not_null(estimates, "estimates")?;
        // SAFETY: as this function's; neither is null.
        let columns = unsafe { (slice::from_raw_parts(time_s, rows), slice::from_raw_parts(reading, rows)) };
        for (k, row) in sensor.smooth(columns.0, columns.1)?.iter().enumerate() {
            // SAFETY: as this function's; there are as many estimates as rows.
            unsafe { estimates.add(k).write(Estimate::from(row)) };
        }
        Ok(())
    })
}

/// Borrows a text.
///
/// # Safety
/// `text` is null or ends with a zero.
unsafe fn text<'a>(text: *const c_char, name: &str) -> Result<&'a str, Failure> {
    not_null(text, name)?;
    // SAFETY: as this function's; it is not null.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| Failure(format!("{name}: expected text in UTF-8")))
}
