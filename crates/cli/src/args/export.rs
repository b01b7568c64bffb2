use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use super::{Auto, Estimator, positive};

/// Flags of `export`.
#[derive(Debug, ClapArgs)]
pub struct ExportArgs {
    /// The sensor's parameters
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Language to export to
    #[arg(long)]
    pub target: ExportTarget,
    /// Folder to write into; files of an earlier export are replaced
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
    /// Time between two readings on the microcontroller, s
    #[arg(long, value_name = "S", value_parser = positive)]
    pub dt_s: f64,
    /// Estimator to export: auto (ekf) or ekf, the only one that has such a form
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<Estimator>,
}

/// A language that sensors are exported to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportTarget {
    /// C99 with an Arduino sketch and a self-test.
    C,
    /// A module of constants for a `no_std` crate.
    Rust,
}
