use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{EstimateArgs, SetupArgs, positive};

/// Flags of `live`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = KEYS)]
pub struct LiveArgs {
    /// Serial port, pipe, or a recording to play back; - for stdin
    #[arg(long, value_name = "DEV|-")]
    pub port: PathBuf,
    /// Bits per second of a serial port
    #[arg(long, value_name = "BPS", default_value_t = 115_200)]
    pub baud: u32,
    /// Names of the columns of a stream that has no header line, or was joined after it: time_us,adc for instance;
    /// without a time column rows have the time at which they arrive
    #[arg(long, value_name = "COLUMNS")]
    pub header: Option<String>,
    /// Play a recording back X times as fast as it was recorded
    #[arg(long, value_name = "X", default_value = "1", allow_negative_numbers = true, value_parser = positive)]
    pub speed: f64,
    /// Seconds that the plot shows
    #[arg(long, value_name = "S", default_value = "30", allow_negative_numbers = true, value_parser = positive)]
    pub window_s: f64,
    /// The key r records to PREFIX-1.csv, PREFIX-2.csv and so on; no file is replaced
    #[arg(long, value_name = "PREFIX", default_value = "live")]
    pub record: PathBuf,
    /// How to estimate
    #[command(flatten)]
    pub estimate: EstimateArgs,
    /// What was measured with
    #[command(flatten)]
    pub setup: SetupArgs,
}

/// What the long help says after the flags.
const KEYS: &str = "\
Keys: z  the sensor is at rest, unstretched: what it reads now is R0, and the strain starts again at zero
      r  record the readings, or stop
      m  put a mark on the plot and into the record
      q  leave

Lines that are none of a trace are counted and passed over. A port that goes away is waited for, and a clock that starts \
again, after a reset of the device, starts the filter again.";
