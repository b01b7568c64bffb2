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
    /// A pointer that must not be null.
    pub fn null(name: &str) -> Self {
        Self(format!("{name}: expected a pointer, found NULL"))
    }
}

impl From<ohmstrain::Error> for Failure {
    fn from(error: ohmstrain::Error) -> Self {
        Self(error.to_string())
    }
}

/// Returns the message of the last call of this thread that failed, "" if none has.
#[unsafe(no_mangle)]
pub extern "C" fn ohmc_error() -> *const c_char {
    LAST.with_borrow(|message| message.as_ptr())
}

/// Runs a call, and keeps the message of its failure.
fn run<T>(call: impl FnOnce() -> Result<T, Failure>) -> Option<T> {
    let done = catch_unwind(AssertUnwindSafe(call))
        .unwrap_or_else(|_| Err(Failure("the library has a bug: please report it".into())));
    done.inspect_err(|failure| {
        // A message has no zeros of its own but those of foreign text.
        LAST.set(CString::new(failure.0.replace('\0', " ")).unwrap_or_default());
    })
    .ok()
}

/// Runs a call that makes something, which then belongs to the caller; null on failure.
pub fn returned<T>(call: impl FnOnce() -> Result<T, Failure>) -> *mut T {
    run(call).map_or(ptr::null_mut(), |made| Box::into_raw(Box::new(made)))
}

/// Runs a call; 0, or 1 on failure.
pub fn status(call: impl FnOnce() -> Result<(), Failure>) -> c_int {
    c_int::from(run(call).is_none())
}
