use std::path::PathBuf;
use std::str::FromStr;

use clap::Args as ClapArgs;
use ohmstrain_calib::likelihood::NoiseParameter;
use ohmstrain_sensor::EstimatorKind;

use super::{Auto, ReplaceArgs, RestResistance, UnitArgs, finite};

/// Flags of `refine`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = TRUST)]
pub struct RefineArgs {
    /// Recording; a reference in it is not used
    pub trace_file: PathBuf,
    /// The sensor's parameters: its law stays, its noise and motion are where the search starts
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// File to write the refined parameters to
    #[arg(short, long, value_name = "refined.toml")]
    pub output: PathBuf,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Use rows with time_s >= T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub from: Option<f64>,
    /// Use rows with time_s < T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub until: Option<f64>,
    /// Estimator to refine: auto (ekf) or ekf, the only one whose likelihood has exact derivatives
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<EstimatorKind>,
    /// Parameters to move, separated by commas; all by default: reading_sd, branch_sd, baseline_sd, baseline_time_s,
    /// rate_sd_per_s, rate_time_s
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub parameters: Vec<Moved>,
    /// Resistance at rest instead of the sensor file's: a number in the readings' unit, or first:N for the median of
    /// the recording's first N readings; it is not written
    #[arg(long, value_name = "OHM|first:N", allow_negative_numbers = true)]
    pub rest_resistance: Option<RestResistance>,
    /// Units of the recording's columns
    #[command(flatten)]
    pub units: UnitArgs,
}

/// A parameter to move.
#[derive(Clone, Copy, Debug)]
pub struct Moved(pub NoiseParameter);

impl FromStr for Moved {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = || NoiseParameter::ALL.map(NoiseParameter::name).join(", ");
        let found = NoiseParameter::ALL.into_iter().find(|parameter| parameter.name() == text);
        found.map(Self).ok_or_else(|| format!("expected some of {}", names()))
    }
}

/// Text of the long help after the flags.
const TRUST: &str = "\
Finds the noise and motion of the extended Kalman filter that make the readings most likely, where no strain was recorded. \
The likelihood sees how well each reading is predicted from those before it, and trusts the law for the rest. A law that \
is wrong by more than its noise makes errors of strain that readings do not show: intervals fitted this way are then too \
narrow. Where a reference exists, use calibrate.

The standard error is that of the parameter's logarithm, 0.1 is 10 %; the interval is the profile likelihood's. A parameter \
that is zero in the sensor file stays zero. Moving the motion alone, --parameters rate_sd_per_s,rate_time_s, keeps what \
calibrate knows of the law's error. More than 3000 rows are thinned to every k-th. Law, R0, limits, the factor \
strain_sd_scale and the other estimators stay as they are in the sensor file.";
