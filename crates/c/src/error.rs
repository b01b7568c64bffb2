use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

thread_local! {
    /// Message of the last call of this thread that failed.
    static LAST: RefCell<CString> = RefCell::default();
}

/// Reason why a call failed.
pub struct Failure(pub String);

impl Failure {
    /// Describes a pointer that must not be null.
    pub fn null(name: &str) -> Self {
        Self(format!("{name}: expected a pointer, found NULL"))
    }
}

impl From<ohmstrain::Error> for Failure {
    fn from(error: ohmstrain::Error) -> Self {
        Self(error.to_string())
    }
}

/// Refuses a null pointer.
pub fn not_null<T>(pointer: *const T, name: &str) -> Result<(), Failure> {
    if pointer.is_null() { Err(Failure::null(name)) } else { Ok(()) }
}

/// Returns the message of the last call of this thread that failed, "" if none has. It is valid until the next failure.
#[unsafe(no_mangle)]
pub extern "C" fn ohmc_error() -> *const c_char {
    // A thread that ends has no messages any more.
    LAST.try_with(|message| message.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

/// Runs a call, and keeps the message of its failure.
fn run<T>(call: impl FnOnce() -> Result<T, Failure>) -> Option<T> {
    let done = catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| Err(Failure(described(&*panic))));
    done.inspect_err(|failure| {
        let message = CString::new(failure.0.replace('\0', " ")).unwrap_or_default();
        let _ = LAST.try_with(|last| last.replace(message));
    })
    .ok()
}

fn described(panic: &(dyn Any + Send)) -> String {
    let words = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("the library has a bug, please report it: {}", words.unwrap_or("a panic"))
}

/// Runs a call that makes something, which then belongs to the caller; null on failure.
pub fn returned<T>(call: impl FnOnce() -> Result<T, Failure>) -> *mut T {
    run(call).map_or(ptr::null_mut(), |made| Box::into_raw(Box::new(made)))
}

/// Frees what [`returned`] made; null is nothing to free.
///
/// # Safety
/// `made` is null or comes from [`returned`], and is not used afterwards.
pub unsafe fn free<T>(made: *mut T) {
    if !made.is_null() {
        // SAFETY: it was made by `Box::into_raw`, and belongs to the caller.
        drop(unsafe { Box::from_raw(made) });
    }
}

/// Runs a call; 0, or 1 on failure.
pub fn status(call: impl FnOnce() -> Result<(), Failure>) -> c_int {
    c_int::from(run(call).is_none())
}
