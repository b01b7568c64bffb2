use std::path::PathBuf;

use clap::{Args as ClapArgs, Subcommand};

use super::ReplaceArgs;

/// Flags of `fleet`.
#[derive(Debug, ClapArgs)]
pub struct FleetArgs {
    /// Command for the sensors.
    #[command(subcommand)]
    pub command: FleetCommand,
}

/// Commands for sensors of one make.
#[derive(Debug, Subcommand)]
pub enum FleetCommand {
    /// Learn what calibrated sensors of one make have in common, for `calibrate --prior`
    #[command(before_help = "Example: ohmstrain fleet fit sensors/*.toml -o prior.toml")]
    Fit(FleetFitArgs),
}

/// Flags of `fleet fit`.
#[derive(Debug, ClapArgs)]
pub struct FleetFitArgs {
    /// Calibrated sensors of one make, at least three
    #[arg(required = true, value_name = "sensor.toml")]
    pub sensors: Vec<PathBuf>,
    /// File to write the prior to
    #[arg(short, long, value_name = "prior.toml")]
    pub output: PathBuf,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
}
