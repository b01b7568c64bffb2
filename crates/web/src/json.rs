//! Conversion of structures for JavaScript.

use js_sys::JSON;
use serde::Serialize;
use wasm_bindgen::prelude::*;

/// Converts a value to JavaScript. Numbers that are not finite become null.
pub fn json(value: &impl Serialize) -> Result<JsValue, JsError> {
    let text = serde_json::to_string(value)?;
    JSON::parse(&text).map_err(|_| JsError::new("cannot hand over a structure"))
}

/// Creates an error in the words of the command line.
pub fn refused(text: impl ToString) -> JsError {
    JsError::new(&text.to_string())
}
