use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{Auto, positive};
use ohmstrain_export::{Board, Budget, ExportTarget, Prefix};
use ohmstrain_sensor::EstimatorKind;

/// A language that sensors are exported to.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum Target {
    /// C99 with an Arduino sketch and a self-test.
    C,
    /// A module of constants for a `no_std` crate.
    Rust,
}

impl From<Target> for ExportTarget {
    fn from(target: Target) -> Self {
        match target {
            Target::C => Self::C,
            Target::Rust => Self::Rust,
        }
    }
}

/// Flags of `export`.
#[derive(Debug, ClapArgs)]
pub struct ExportArgs {
    /// The sensor's parameters, or a hand.toml: all its joints, in C
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Language to export to
    #[arg(long)]
    pub target: Target,
    /// Folder to write into; files of an earlier export are replaced
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Replace files that this program did not write, too, and export what scores worse than a static cubic
    #[arg(long)]
    pub force: bool,
    /// Usual time between two readings on the microcontroller, s [default: that of the calibration's recordings]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub dt_s: Option<f64>,
    /// Estimator to export: auto (the sensor's default), corrected, sign-split, hypotheses, ekf or static-cubic
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<EstimatorKind>,
    #[arg(long, value_name = "BUDGET", conflicts_with = "estimator", help = budget_help())]
    pub budget: Option<Budget>,
    /// Prefix of names in C: two sensors in one program need names of their own
    #[arg(long, value_name = "NAME", default_value = "ohmstrain")]
    pub prefix: Prefix,
    /// Recording with a reference: what is exported runs over it first, and its error is printed beside what was promised.
    /// What is worse than a static cubic is not exported without --force
    #[arg(long, value_name = "TRACE")]
    pub score: Option<PathBuf>,
    /// Score the rows from this time on only, s
    #[arg(long, value_name = "S", requires = "score")]
    pub from: Option<f64>,
}

/// Help text of `--budget`, with the names of all boards.
fn budget_help() -> String {
    format!(
        "The best that fits a chip, fewer hypotheses and rows of the correction if need be: board=NAME ({}: half of its time between two \
         readings, three quarters of its flash and RAM), lean (15 000 instructions a step on a Cortex-M4F), or some of \
         instructions=N,flash=BYTES,ram=BYTES. With --score the best on that recording, else by a table",
        Board::names()
    )
}
