use std::path::PathBuf;

use clap::Args as ClapArgs;

use super::{PortArgs, SetupArgs, UnitArgs};

/// Flags of `record`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = TEXT)]
pub struct RecordArgs {
    /// Port
    #[command(flatten)]
    pub port: PortArgs,
    /// Positions and steps, as `ohmstrain plan -o protocol.toml` writes them
    #[arg(long, value_name = "protocol.toml")]
    pub protocol: PathBuf,
    /// File to write; one that is there already is not replaced
    #[arg(short, long, value_name = "trace.csv")]
    pub output: PathBuf,
    /// Replace a file that is there already
    #[arg(long)]
    pub force: bool,
    /// Ring the terminal's bell when a move begins
    #[arg(long)]
    pub bell: bool,
    /// Seconds of readings that are drawn
    #[arg(long, value_name = "S", default_value = "30", allow_negative_numbers = true, value_parser = super::positive)]
    pub window_s: f64,
    /// Setup of the measurement
    #[command(flatten)]
    pub setup: SetupArgs,
    /// Units
    #[command(flatten)]
    pub units: UnitArgs,
}

/// Text of the long help after the flags.
const TEXT: &str = "\
Keys: b      the step is spoiled: back to where it began, and again
      space  pause, or go on
      1-9    the body is held at this position of the protocol from now on, until a key is pressed; the protocol waits
      q      leave; what was recorded stays

The trace has the strain where the body is held for certain, with its standard deviation, and none while it moves: \
`ohmstrain calibrate trace.csv -o sensor.toml` takes it as it is. Where stdout is no terminal, steps are lines.

protocol.toml:
  format = 1
  joints = [\"thumb\", \"index\"]      # of columns thumb_ohm, index_ohm, if each has values of its own
  repeat = 3
  [[positions]]
  name = \"flat\"
  angle_deg = 0                     # or strain; [0, 0] for each joint
  [[positions]]
  name = \"fist\"
  angle_deg = [50, 80]
  angle_sd = 3                      # without it 2 % of the span of all positions
  [[steps]]                         # without steps a person marks by hand
  to = \"flat\"
  hold_s = 20
  [[steps]]
  to = \"fist\"
  move_s = 2
  hold_s = 8";
