use std::path::{Path, PathBuf};

use ohmstrain_bench_data::simulate::{Followed, Protocol, SimulationSettings, simulate};

use crate::args::{ExampleArgs, ReplaceArgs, SimulateArgs};
use crate::error::CliError;
use crate::output::{Kind, Outputs, SIMULATE};
use crate::protocol_file;
use ohmstrain::MADE_BY;

/// Simulates a recording and writes it.
pub fn run(args: &SimulateArgs) -> Result<(), CliError> {
    let settings = SimulationSettings {
        elongation_mm: args.elongation_mm,
        speed_mm_s: args.speed_mm_s,
        sample_rate_hz: args.sample_rate_hz,
        mismatched: args.mismatched,
        chamber: args.chamber,
        front_end: args.front_end,
        seed: args.seed,
        individual: args.individual,
        followed: followed(args)?,
        ..SimulationSettings::new(args.material, protocol(args)?)
    };
    write(&settings, args.output.as_deref(), &args.replace, args.follow.as_ref())
}

/// Returns the bench's protocol, of the length that was asked for.
fn protocol(args: &SimulateArgs) -> Result<Protocol, CliError> {
    match (args.protocol, args.duration_s) {
        (Protocol::Mixed { .. }, Some(duration_s)) => Ok(Protocol::Mixed { duration_s }),
        (protocol, None) => Ok(protocol),
        (other, Some(_)) => {
            Err(CliError::Arguments(format!("--duration-s: expected --protocol mixed, found {}", other.name())))
        }
    }
}

/// Returns the protocol that the simulated person follows, if there is one.
fn followed(args: &SimulateArgs) -> Result<Option<Followed>, CliError> {
    let Some(path) = &args.follow else { return Ok(None) };
    let pacing = protocol_file::read(path)?;
    if pacing.steps.is_empty() {
        return Err(CliError::Input(format!("{}: expected steps to follow, found none", path.display())));
    }
    let joint = match &args.joint {
        None => 0,
        Some(name) => pacing.joints.iter().position(|joint| joint == name).ok_or_else(|| {
            let joints = pacing.joints.join(", ");
            CliError::Arguments(format!("--joint: expected a joint of {}, found `{name}` ({joints})", path.display()))
        })?,
    };
    Ok(Some(Followed { pacing, joint, person: args.person }))
}

/// Writes the recording of the demo.
pub fn example(args: &ExampleArgs) -> Result<(), CliError> {
    write(&SimulationSettings::example(), args.output.as_deref(), &args.replace, None)
}

/// Simulates and writes a recording, to stdout if no file is given. The file is claimed first, so that a foreign one is refused
/// before any work.
fn write(
    settings: &SimulationSettings,
    file: Option<&Path>,
    replace: &ReplaceArgs,
    input: Option<&PathBuf>,
) -> Result<(), CliError> {
    let mut outputs = Outputs::new(replace.force, input);
    let output = outputs.claim_or_stdout(file, Kind::Simulation)?;
    let bytes = bytes(settings).map_err(CliError::Arguments)?;
    outputs.publish_or_print(output, bytes)
}

/// Returns a simulated recording as text, marked as simulated, so that another may replace it.
pub fn bytes(settings: &SimulationSettings) -> Result<Vec<u8>, String> {
    let trace = simulate(settings).map_err(|error| error.to_string())?;
    trace.marked(&format!("{MADE_BY} {SIMULATE}")).map_err(|error| error.to_string())
}
