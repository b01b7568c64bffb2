use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{EstimateArgs, PortArgs, SetupArgs, positive};

/// Flags of `live`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = KEYS)]
pub struct LiveArgs {
    /// Port
    #[command(flatten)]
    pub port: PortArgs,
    /// Seconds that the plot shows
    #[arg(long, value_name = "S", default_value = "30", allow_negative_numbers = true, value_parser = positive)]
    pub window_s: f64,
    /// The key r records to PREFIX-1.csv, PREFIX-2.csv and so on; no file is replaced
    #[arg(long, value_name = "PREFIX", default_value = "live")]
    pub record: PathBuf,
    /// Estimation
    #[command(flatten)]
    pub estimate: EstimateArgs,
    /// Setup of the measurement
    #[command(flatten)]
    pub setup: SetupArgs,
}

/// Text of the long help after the flags.
const KEYS: &str = "\
Keys: z  the sensor is at rest, unstretched: what it reads now is R0, and the strain starts again at zero
      r  record the readings, or stop
      m  put a mark on the plot and into the record
      q  leave

Lines that are not trace rows are counted and skipped. A port that goes away is waited for, and a clock that starts \
again, after a reset of the device, starts the filter again.";
