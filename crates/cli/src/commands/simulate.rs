use ohmstrain_bench_data::simulate::{SimulationSettings, simulate};

use crate::args::SimulateArgs;
use crate::error::CliError;
use crate::output::write_to;

/// Simulates a recording and writes it.
pub fn run(args: &SimulateArgs) -> Result<(), CliError> {
    let settings = SimulationSettings {
        elongation_mm: args.elongation_mm,
        speed_mm_s: args.speed_mm_s,
        sample_rate_hz: args.sample_rate_hz,
        mismatched: args.mismatched,
        front_end: args.front_end,
        seed: args.seed,
        ..SimulationSettings::new(args.material, args.protocol)
    };
    let trace = simulate(&settings).map_err(|error| CliError::Arguments(error.to_string()))?;
    write_to(args.output.as_deref(), |mut out| Ok(trace.write(&mut out)?))
}
