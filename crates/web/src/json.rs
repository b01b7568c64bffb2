//! Conversion of structures for JavaScript, and from it.

use js_sys::JSON;
use serde::Serialize;
use serde::de::DeserializeOwned;
use wasm_bindgen::prelude::*;

/// Converts a value to JavaScript. Numbers that are not finite become null.
pub fn json(value: &impl Serialize) -> Result<JsValue, JsError> {
    let text = serde_json::to_string(value)?;
    JSON::parse(&text).map_err(|_| JsError::new("cannot hand over a structure"))
}

/// Parses an object, whose name in messages is `what`; undefined gives the defaults.
pub fn parsed<T: Default + DeserializeOwned>(value: &JsValue, what: &str) -> Result<T, String> {
    if value.is_undefined() || value.is_null() {
        return Ok(T::default());
    }
    let text = JSON::stringify(value).map_err(|_| format!("expected {what} as an object"))?;
    serde_json::from_str(&String::from(text)).map_err(|error| error.to_string())
}

/// Creates an error in the words of the command line.
pub fn refused(text: impl ToString) -> JsError {
    JsError::new(&text.to_string())
}
