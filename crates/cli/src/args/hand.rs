use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::ReplaceArgs;

/// Flags of `hand`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = FORMAT)]
pub struct HandArgs {
    /// The joints and their sensors
    #[arg(value_name = "hand.toml")]
    pub hand: PathBuf,
    /// Recording with a column of readings per joint, or - for stdin
    #[arg(default_value = "-")]
    pub trace_file: PathBuf,
    /// Skip lines that are not trace rows; they are counted on stderr. Where the device starts again so do the filters
    #[arg(long)]
    pub skip_bad: bool,
    /// File to write instead of stdout
    #[arg(short, long, value_name = "angles.csv")]
    pub output: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
}

/// Text of the long help after the flags.
const FORMAT: &str = "\
hand.toml:
  format = 1
  [[joints]]
  name = \"index\"                  # of its columns in the output
  column = \"index_ohm\"            # of its readings in the recording
  sensor = \"index.toml\"           # as calibrate wrote it; the path goes from hand.toml
  # unless the sensor knows its joint, or an angle:
  joint = \"prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30\"
  rest_resistance = 1612.0        # R0 of today, if it is not the calibration's
  # if the column has converter codes:
  front_end = \"divider reference_ohm=10000 side=low bits=12 noise_codes=0.5\"
  [[joints]]                      # of several channels that see one strain, as calibrate wrote it
  name = \"knee\"
  fusion = \"knee-fusion.toml\"
  [[joints.channels]]             # each with column, sensor, rest_resistance, front_end
  column = \"knit1_ratio\"
  sensor = \"knee-knit1.toml\"";
