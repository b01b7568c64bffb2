use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{Auto, Estimator, RestResistance, TraceArgs, finite};

/// Flags of `refine`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = TRUST)]
pub struct RefineArgs {
    /// Recording; a reference in it is not used
    pub trace_file: PathBuf,
    /// The sensor's parameters: its law stays, its noise and motion are where the search starts
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Where to write the refined parameters
    #[arg(short, long, value_name = "refined.toml")]
    pub output: PathBuf,
    /// Use rows with time_s >= T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub from: Option<f64>,
    /// Use rows with time_s < T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub until: Option<f64>,
    /// Estimator to refine: auto (ekf) or ekf, the only one whose likelihood has exact derivatives
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<Estimator>,
    /// Resistance at rest instead of the sensor file's: a number in the readings' unit, or first:N for the median of
    /// the recording's first N readings; it is not written
    #[arg(long, value_name = "OHM|first:N")]
    pub rest_resistance: Option<RestResistance>,
    /// Overrides of the recording's metadata
    #[command(flatten)]
    pub trace: TraceArgs,
}

/// What the long help says after the flags.
const TRUST: &str = "\
Finds the noise and motion of the extended Kalman filter that make the readings most likely, where no strain was recorded.
The likelihood sees how well each reading is predicted from those before it, and trusts the law for the rest. A law that
is wrong by more than its noise makes errors of strain that readings do not show: intervals fitted this way are then too
narrow. Where a reference exists, use calibrate.

The standard error is that of the parameter's logarithm, 0.1 is 10 %; the interval is the profile likelihood's. A parameter
that is zero in the sensor file stays zero. More than 3000 rows are thinned to every k-th. Law, R0, limits, the factor
strain_sd_scale and the other estimators stay as they are in the sensor file.";
