//! A sensor's filter as source code for a microcontroller, and its cost there.

use ohmstrain::SensorParams;
use ohmstrain_export::{Budget, Cost, ExportError, ExportTarget, Prefix};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::json;

/// Source code of a filter.
#[wasm_bindgen]
pub struct Firmware(ohmstrain_export::Firmware);

#[derive(Serialize)]
struct Costs {
    instructions: usize,
    flash: usize,
    ram: usize,
    stack: usize,
}

#[wasm_bindgen]
impl Firmware {
    /// Returns paths and contents of its files, alternating.
    pub fn files(&self) -> Vec<String> {
        self.0.files.iter().flat_map(|file| [file.path.clone(), file.content.clone()]).collect()
    }

    /// Returns the table that `ohmstrain export` prints: promise and cost.
    pub fn lines(&self) -> Vec<String> {
        self.0.promise.lines.clone()
    }

    /// Describes the part of the filter that is exported, in words.
    #[wasm_bindgen(getter)]
    pub fn words(&self) -> String {
        self.0.promise.words.clone()
    }

    /// Returns the estimated cost: instructions per step of a Cortex-M4F; flash, RAM and the stack's part of it, bytes.
    #[wasm_bindgen(unchecked_return_type = "Cost")]
    pub fn cost(&self) -> Result<JsValue, JsError> {
        let cost = self.0.promise.cost;
        let Cost { instructions, flash, stack, .. } = cost;
        json(&Costs { instructions, flash, stack, ram: cost.ram() })
    }
}

/// Exports as `ohmstrain export` does.
pub fn of(
    params: &SensorParams,
    target: &str,
    dt_s: f64,
    budget: Option<&str>,
    prefix: Option<&str>,
) -> Result<Firmware, String> {
    let target: ExportTarget = target.parse().map_err(|error| format!("--target: {error}"))?;
    let budget: Option<Budget> =
        budget.map(str::parse).transpose().map_err(|error: String| format!("--budget: {error}"))?;
    let prefix: Prefix = prefix.unwrap_or("ohmstrain").parse().map_err(|error| format!("--prefix: {error}"))?;
    let made = ohmstrain_export::Firmware::new(params, target, dt_s, budget.as_ref(), &prefix);
    made.map(Firmware).map_err(|error| named(&error))
}

/// Adds to a refusal the flag or the file that it concerns.
fn named(error: &ExportError) -> String {
    match error {
        ExportError::Unsupported { .. } | ExportError::Parameter(_) => format!("sensor.toml: {error}"),
        ExportError::Interval(_) => format!("--dt-s: {error}"),
        ExportError::Budget { .. } => format!("--budget: {error}"),
        ExportError::Template(_) => error.to_string(),
    }
}
