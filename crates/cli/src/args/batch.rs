use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use super::Format;

/// Flags of `batch`.
#[derive(Debug, ClapArgs)]
#[command(after_long_help = DETAILS)]
pub struct BatchArgs {
    /// Command to run on each recording
    #[arg(value_enum)]
    pub command: BatchCommand,
    /// Recordings
    #[arg(required_unless_present_any = ["glob", "manifest"])]
    pub files: Vec<PathBuf>,
    /// Recordings by pattern, as in 'data/**/*.csv'; may be given several times
    #[arg(long, value_name = "PATTERN")]
    pub glob: Vec<String>,
    /// Recordings in a CSV with the columns file, sensor, output and flags of COMMAND by their names
    #[arg(long, value_name = "manifest.csv")]
    pub manifest: Option<PathBuf>,
    /// Folder for what comes of the recordings, and for the summary
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// The sensor, or the hand.toml, of recordings for which the manifest names none
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: Option<PathBuf>,
    /// Recordings at a time; by default as many as the machine has cores
    #[arg(short, long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Form of the estimates
    #[arg(long, value_enum, default_value_t = Format::Csv)]
    pub format: Format,
    /// Form of the summary
    #[arg(long, value_enum, default_value_t = SummaryForm::Csv)]
    pub summary: SummaryForm,
    /// Do again what an earlier run has finished
    #[arg(long)]
    pub again: bool,
    /// Replace files that no earlier run wrote, too
    #[arg(long)]
    pub force: bool,
    /// Flags of COMMAND
    #[arg(last = true)]
    pub flags: Vec<String>,
}

/// Commands that are done for each recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BatchCommand {
    /// Estimates, each from the readings up to it
    Filter,
    /// Estimates, each from all readings
    Smooth,
    /// Angles of all joints of the hand.toml that --sensor names
    Hand,
    /// Scores, as JSON
    Evaluate,
    /// A sensor of each recording of one channel, or of those that the manifest gives the same name in its column sensor
    Calibrate,
}

/// Form of a summary; its name is what the file's name ends in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SummaryForm {
    /// A line per recording
    Csv,
    /// An array of objects
    Json,
    /// Apache Parquet
    Parquet,
}

/// Text of the long help after the flags.
const DETAILS: &str = "\
Of every recording comes what COMMAND prints and writes: one that cannot be read is reported and leaves the others alone. \
Exit code 5 says that there were such. Outputs lie in DIR as the recordings lie below the folder that all of them share.

DIR/summary.csv has a row per recording: state, messages and warnings, scores, SHA-256 of recording, \
sensor, prior and output, flags and version. DIR/batch.jsonl grows by a line with each recording \
that is done. Another run with the same DIR does what is not there yet, or has changed: recording, \
sensor, prior, marks, flags, version or output.

Paths in a manifest start at its folder. An empty cell is a flag that is not given; `true` gives one without a value.";
