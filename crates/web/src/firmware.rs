//! A sensor's filter as source code for a microcontroller, and what it costs there.

use comfy_table::{Table, presets};
use ohmstrain::SensorParams;
use ohmstrain_export::{self as export, Budget, ChipFilter, Cost, ExportError, ExportTarget, Plan, Prefix, SourceFile};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::json;

/// Source code of a filter.
#[wasm_bindgen]
pub struct Firmware {
    files: Vec<SourceFile>,
    lines: Vec<String>,
    words: String,
    cost: Cost,
}

#[derive(Serialize)]
struct Costs {
    instructions: usize,
    flash: usize,
    ram: usize,
    stack: usize,
}

#[wasm_bindgen]
impl Firmware {
    /// Paths and contents of its files, one after the other.
    pub fn files(&self) -> Vec<String> {
        self.files.iter().flat_map(|file| [file.path.clone(), file.content.clone()]).collect()
    }

    /// The table that `ohmstrain export` prints: what was promised, and what it costs.
    pub fn lines(&self) -> Vec<String> {
        self.lines.clone()
    }

    /// Describes the part of the filter that is exported, in words.
    #[wasm_bindgen(getter)]
    pub fn words(&self) -> String {
        self.words.clone()
    }

    /// Instructions a step of a Cortex-M4F; flash, RAM, and of it stack, bytes. All are estimated.
    #[wasm_bindgen(unchecked_return_type = "Cost")]
    pub fn cost(&self) -> Result<JsValue, JsError> {
        let Cost { instructions, flash, stack, .. } = self.cost;
        json(&Costs { instructions, flash, stack, ram: self.cost.ram() })
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
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(format!("--dt-s: expected a positive number, found {dt_s}"));
    }
    let target = match target {
        "c" => ExportTarget::C,
        "rust" => ExportTarget::Rust,
        other => return Err(format!("--target: expected c or rust, found `{other}`")),
    };
    let prefix: Prefix = prefix.unwrap_or("ohmstrain").parse().map_err(|error| format!("--prefix: {error}"))?;
    let plan = match budget {
        None => Plan::default(),
        Some(text) => {
            let budget: Budget = text.parse().map_err(|error| format!("--budget: {error}"))?;
            let fitting = export::fitting(params, &budget, dt_s).map_err(|error| named(&error))?;
            // Without a recording to compare them on, the first is the best.
            *fitting.first().ok_or("--budget: nothing fits")?
        }
    };
    let chip = ChipFilter::new(params, &plan).map_err(|error| named(&error))?;
    let cost = export::cost(params, &plan, dt_s).map_err(|error| named(&error))?;
    let lines = promise(params, &plan, &chip, &cost);
    let files = export::files(params, &plan, target, dt_s, &prefix, &lines).map_err(|error| named(&error))?;
    Ok(Firmware { files, lines, words: chip.words(), cost })
}

/// A refusal with the flag or the file that it is about.
fn named(error: &ExportError) -> String {
    match error {
        ExportError::Unsupported { .. } | ExportError::Parameter(_) => format!("sensor.toml: {error}"),
        ExportError::Interval(_) => format!("--dt-s: {error}"),
        ExportError::Budget { .. } => format!("--budget: {error}"),
        ExportError::Template(_) => error.to_string(),
    }
}

/// A table of what was promised and what it costs, for the header of the code, too.
fn promise(params: &SensorParams, plan: &Plan, chip: &ChipFilter, cost: &Cost) -> Vec<String> {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["estimate", "%FS", "50/90/95 %", "instructions", "flash, B", "RAM, B", "of it stack, B"]);
    let is_default = plan.kind.is_none_or(|kind| kind == params.default_estimator) && !chip.is_smaller();
    let whose = if is_default { "" } else { " of the default" };
    let of_95 = |percent: f64| format!("-/-/{percent:.0}");
    let mut add = |name: String, error: f64, coverage: String| {
        table.add_row([name, format!("{error:.2}"), coverage]);
    };
    if let Some(summary) = &params.summary {
        let promised = of_95(summary.coverage_95_percent);
        add(format!("promised{whose}: left out"), summary.left_out_percent_fs, promised);
        add("static cubic: left out".into(), summary.static_cubic_percent_fs, String::new());
    }
    if let Some(tested) = &params.tested {
        let name = format!("tested{whose}: rows kept from calibration");
        add(name, tested.filter_percent_fs, of_95(tested.coverage_95_percent));
        add("static cubic: these rows".into(), tested.static_cubic_percent_fs, String::new());
    }
    let costs = [cost.instructions, cost.flash, cost.ram(), cost.stack].map(|number| number.to_string());
    table.add_row(["exported".into(), String::new(), String::new()].into_iter().chain(costs));
    table.lines().collect()
}
