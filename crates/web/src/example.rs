//! A recording of the simulator.

use ohmstrain::MADE_BY;
use ohmstrain_bench_data::simulate::{SimulationSettings, simulate};
use wasm_bindgen::prelude::*;

use crate::json::refused;
use crate::recording::Recording;

/// Simulates the bench session of `ohmstrain demo` with this seed.
#[wasm_bindgen]
pub fn example(seed: u32) -> Result<Recording, JsError> {
    let settings = SimulationSettings { seed: seed.into(), ..SimulationSettings::example() };
    let trace = simulate(&settings).map_err(refused)?;
    let bytes = trace.marked(&format!("{MADE_BY} simulate")).map_err(refused)?;
    Recording::of_trace("example.csv", bytes).map_err(refused)
}
