use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{Auto, positive};
use ohmstrain_export::Budget;
use ohmstrain_sensor::EstimatorKind;

/// Flags of `serial-check`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = SKETCH)]
pub struct SerialCheckArgs {
    /// The sensor whose filter was exported
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Time between two readings that it was exported for, s [default: that of the calibration's recordings]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub dt_s: Option<f64>,
    /// Estimator that was exported
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<EstimatorKind>,
    /// Budget that it was exported for, if it was not scored
    #[arg(long, value_name = "BUDGET", conflicts_with = "estimator")]
    pub budget: Option<Budget>,
    /// Serial port, or a file with what the board printed; - for stdin
    #[arg(long, value_name = "DEV|FILE|-")]
    pub port: PathBuf,
    /// Bits per second of a serial port
    #[arg(long, value_name = "BPS", default_value_t = 115_200)]
    pub baud: u32,
    /// Steps to compare [default: 600 from a port, all of a file]
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,
}

/// Text of the long help after the flags.
const SKETCH: &str = "\
The exported sketch prints what is compared where OHMSTRAIN_CHECK is 1: set it in the sketch, or as a build flag. Lines of \
anything else are passed over. A board that starts again is compared from there; reset it if it has been running.";
