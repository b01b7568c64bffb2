//! ohmstrain in WebAssembly: the facade, the importer, the report and the firmware export, for pages and Node.
//!
//! # Policy
//! - No mathematics: all results are computed by the crates of the command line, in the same order, so that files and numbers
//!   equal those of the command line to the last digit.
//! - Errors are JavaScript's, in the words of the command line. An error leaves the object as it was.
//! - No access to files or servers. Bytes come in, bytes and numbers go out.
//! - A panic ends the instance; its text is kept for [`last_panic`].

mod answers;
mod calibration;
mod doubts;
mod estimates;
mod estimator;
mod example;
mod files;
mod firmware;
mod inspection;
mod json;
mod live;
mod recording;
mod report;
mod sensor;
mod stream;
mod stream_lines;
mod types;

use std::cell::RefCell;
use std::panic;

use wasm_bindgen::prelude::*;

thread_local! {
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Installs a hook that keeps the text of a panic, which would be lost otherwise.
#[wasm_bindgen(start)]
pub fn start() {
    panic::set_hook(Box::new(|info| PANIC.with(|text| *text.borrow_mut() = info.to_string())));
}

/// Returns the text of the last panic; empty if there was none.
#[wasm_bindgen(js_name = lastPanic)]
pub fn last_panic() -> String {
    PANIC.with(|text| text.borrow().clone())
}

/// Returns name and version of the program, as written into files.
#[wasm_bindgen(js_name = madeBy)]
pub fn made_by() -> String {
    ohmstrain::MADE_BY.to_owned()
}
