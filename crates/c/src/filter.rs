use std::ffi::c_int;

use ohmstrain::{Filter, Sensor};

use crate::Estimate;
use crate::error::{Failure, free, not_null, returned, status};

/// A filter as C holds it, `ohmc_filter`.
pub struct Handle {
    filter: Filter,
    /// True within a call, and for good after one that panicked: the state may be half of two.
    is_busy: bool,
}

impl Handle {
    fn call<T>(&mut self, call: impl FnOnce(&mut Filter) -> Result<T, ohmstrain::Error>) -> Result<T, Failure> {
        if self.is_busy {
            return Err(Failure("the filter has failed within a step: free it, and start a new one".into()));
        }
        self.is_busy = true;
        let done = call(&mut self.filter);
        self.is_busy = false;
        Ok(done?)
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
) -> *mut Handle {
    returned(|| {
        // SAFETY: as this function's.
        let mut builder = unsafe { sensor.as_ref() }.ok_or_else(|| Failure::null("sensor"))?.filter();
        if !rest_resistance.is_nan() {
            builder = builder.rest_resistance(rest_resistance);
        }
        if !initial_strain.is_nan() {
            builder = builder.initial_strain(initial_strain);
        }
        Ok(Handle { filter: builder.build()?, is_busy: false })
    })
}

/// Frees a filter; null is nothing to free.
///
/// # Safety
/// `filter` is null or comes from this library, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_free(filter: *mut Handle) {
    // SAFETY: as this function's.
    unsafe { free(filter) }
}

/// Takes a reading, NaN for a missing one, at a time, s, after the last one. Returns 0, or 1 on failure.
///
/// # Safety
/// `filter` is null or a filter of this library that no other thread uses; `estimate` is null or has room for one, which may be
/// uninitialised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_step(
    filter: *mut Handle,
    time_s: f64,
    reading: f64,
    estimate: *mut Estimate,
) -> c_int {
    // SAFETY: as this function's.
    unsafe { estimated(filter, estimate, |filter| filter.step(time_s, reading)) }
}

/// Gives the strain at the last row, with a standard deviation. Returns 0, or 1 on failure.
///
/// # Safety
/// As for [`ohmc_filter_step`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_know(filter: *mut Handle, strain: f64, sd: f64, estimate: *mut Estimate) -> c_int {
    // SAFETY: as this function's.
    unsafe { estimated(filter, estimate, |filter| filter.know(strain, sd)) }
}

/// Runs a call that makes an estimate.
///
/// # Safety
/// As for [`ohmc_filter_step`].
unsafe fn estimated(
    filter: *mut Handle,
    estimate: *mut Estimate,
    call: impl FnOnce(&mut Filter) -> Result<ohmstrain::Estimate, ohmstrain::Error>,
) -> c_int {
    status(|| {
        not_null(estimate, "estimate")?;
        // SAFETY: as this function's.
        let filter = unsafe { filter.as_mut() }.ok_or_else(|| Failure::null("filter"))?;
        let row = filter.call(call)?;
        // SAFETY: as this function's; it is not null.
        unsafe { estimate.write(Estimate::from(&row)) };
        Ok(())
    })
}

/// Sets the reading of the rested sensor from now on. Returns 0, or 1 on failure.
///
/// # Safety
/// `filter` is null or a filter of this library that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ohmc_filter_rest_resistance(filter: *mut Handle, measured: f64) -> c_int {
    status(|| {
        // SAFETY: as this function's.
        let filter = unsafe { filter.as_mut() }.ok_or_else(|| Failure::null("filter"))?;
        filter.call(|filter| filter.rest_resistance(measured))
    })
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    /// A call that panics is an error with the panic's words, and the filter refuses all others.
    #[test]
    fn a_filter_that_panicked_refuses_further_use() {
        moved_to_a_thread::<Handle>();
        shared_by_threads::<Sensor>();
        let text = std::fs::read_to_string("../ohmstrain/examples/sensor.toml").unwrap();
        let filter = Sensor::from_toml(&text).unwrap().filter().build().unwrap();
        let mut handle = Handle { filter, is_busy: false };
        assert!(handle.call(|filter| filter.step(0.0, 1700.0)).is_ok());
        let panics = || status(|| handle.call::<()>(|_| panic!("on purpose")));
        assert_eq!(catch_unwind(AssertUnwindSafe(panics)).unwrap(), 1);
        // SAFETY: a text that ends with a zero.
        let message = unsafe { std::ffi::CStr::from_ptr(crate::ohmc_error()) }.to_str().unwrap();
        assert_eq!(message, "the library has a bug, please report it: on purpose");
        assert!(handle.call(|filter| filter.step(0.1, 1700.0)).is_err());
    }

    fn moved_to_a_thread<T: Send>() {}

    fn shared_by_threads<T: Sync>() {}
}
