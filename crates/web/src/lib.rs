//! ohmstrain in WebAssembly: the facade, the importer, the report and the firmware export, for pages and Node.
//!
//! # Policy
//! - No mathematics: all results are computed by the crates that the command line is made of, in the same order, so that
//!   files and numbers are those of the command line to the last digit.
//! - Errors are JavaScript's, in the words of the command line. After one, what was called is as it was before.
//! - Nothing here opens files or asks a server. Bytes come in, bytes and numbers go out.
//! - A panic ends the instance; its text is kept for [`last_panic`].

mod calibration;
mod doubts;
mod estimates;
mod example;
mod files;
mod firmware;
mod inspection;
mod json;
mod live;
mod recording;
mod report;
mod said;
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

/// Keeps the text of a panic, which would be lost.
#[wasm_bindgen(start)]
pub fn start() {
    panic::set_hook(Box::new(|info| PANIC.with(|text| *text.borrow_mut() = info.to_string())));
}

/// The text of the last panic; empty if there was none.
#[wasm_bindgen(js_name = lastPanic)]
pub fn last_panic() -> String {
    PANIC.with(|text| text.borrow().clone())
}

/// Program and version, as written into files.
#[wasm_bindgen(js_name = madeBy)]
pub fn made_by() -> String {
    ohmstrain::MADE_BY.to_owned()
}
