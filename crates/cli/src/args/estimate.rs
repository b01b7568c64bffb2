use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, ValueEnum};
use ohmstrain::{EstimatorKind, Influence, Known, influence};

use super::{Auto, ReplaceArgs, SetupArgs, UnitArgs, finite, name_of, positive};

/// Flags that `filter`, `smooth` and `live` share.
#[derive(Debug, ClapArgs)]
pub struct EstimateArgs {
    /// The sensor's parameters; `smooth` and `live` accept a hand.toml, too
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Estimator: auto (the sensor file's choice), corrected, ekf, ukf, imm, sign-split, hypotheses
    /// or static-cubic
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<EstimatorKind>,
    /// Strain (or angle) at the first row, if it is known; the body is at rest there
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = finite)]
    pub initial_strain: Option<f64>,
    /// The strain (or angle) is known to be X at the first row from T seconds on, with standard deviation SD (default: 0.5 % of the range); repeatable.
    /// Estimates from there on follow (those of smooth before it, too): for seconds, and as far as known strains show an
    /// offset or another gain for an hour
    #[arg(long, value_name = "T:X[:SD]", allow_negative_numbers = true, value_parser = known)]
    pub known: Vec<Known>,
    /// Reading of the rested, unstretched sensor now: a number in the readings' unit, first:N for the median of the
    /// first N readings, or calibrated for its reading in calibration. Without this flag R₀ starts there too, but
    /// follows readings that stay beyond those of the calibration; for a sensor that was calibrated on several
    /// recordings it starts at the value that the first reading suggests
    #[arg(long, value_name = "OHM|first:N|calibrated", allow_negative_numbers = true)]
    pub rest_resistance: Option<RestResistance>,
    /// Turn down readings whose normalised innovation squared (column nis) is above X, two in a row at most; 10.8
    /// is one in a thousand by chance
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = positive)]
    pub gate: Option<f64>,
    /// Influence of surprising readings: redescending:K, the less the farther beyond K standard deviations, huber:K,
    /// student-t:DOF, or none, as they are [default: redescending:3]
    #[arg(long, value_name = "redescending:K|huber:K|student-t:DOF|none", value_parser = influence)]
    pub influence: Option<Influence<f64>>,
    /// Parts to leave out, separated by commas, to compare; may be given several times
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub without: Vec<Without>,
    /// Units of the recording's columns
    #[command(flatten)]
    pub units: UnitArgs,
}

impl EstimateArgs {
    /// True if this is to be left out.
    pub fn is_without(&self, what: Without) -> bool {
        self.without.contains(&what)
    }
}

/// Part that an estimate can leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Without {
    /// The learned correction of the strain
    Correction,
    /// Rejection of implausible and stuck readings
    Plausibility,
    /// The second hypothesis after a jump of the readings, restarted from the prior,
    /// and the way back to the state before a jump if readings jump back (smoothers never do)
    SecondLook,
    /// Wider intervals at a start, after a fault, and outside of the calibration
    Doubts,
}

/// Form of a table of rows; its name is what file names end in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text, a line per row
    Csv,
    /// Apache Parquet: the same numbers in a quarter of the space, complete with the last row only
    Parquet,
}

/// Form and file of the estimates.
#[derive(Debug, ClapArgs)]
pub struct WrittenArgs {
    /// File to write instead of stdout, which is - too; a name that ends in .parquet is written as Parquet
    #[arg(short, long, value_name = "estimates.csv")]
    pub output: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Form of the estimates
    #[arg(long, value_enum, default_value_t = Format::Csv)]
    pub format: Format,
    /// Columns to write, separated by commas; all by default
    #[arg(long, value_delimiter = ',')]
    pub columns: Vec<String>,
}

impl WrittenArgs {
    /// The form that flag or name ask for.
    pub fn format(&self) -> Format {
        let named = self.output.as_deref().and_then(|path| path.extension());
        let is_parquet = named.is_some_and(|ending| ending == name_of(Format::Parquet).as_str());
        if is_parquet { Format::Parquet } else { self.format }
    }
}

/// Flags of `filter`.
#[derive(Debug, ClapArgs)]
pub struct FilterArgs {
    /// Recording, or - for stdin
    #[arg(default_value = "-")]
    pub trace_file: PathBuf,
    /// Estimate every row from the readings up to S seconds after it, 0.5 for instance; rows come out that much later
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub lag_s: Option<f64>,
    /// Skip lines that are not trace rows, such as a boot loader's, before the header too; they are counted on stderr.
    /// Where the device starts again (another header, or three rows in order behind times before theirs) so does the filter
    #[arg(long)]
    pub skip_bad: bool,
    /// Names of the columns of a stream that has no header line, or was joined after it: time_us,adc for instance
    #[arg(long, value_name = "COLUMNS")]
    pub header: Option<String>,
    /// Write the filter's state when the stream has ended, for --resume; rows that wait for --lag-s go there with it
    #[arg(long, value_name = "state.toml")]
    pub save_state: Option<PathBuf>,
    /// Go on from the state that --save-state wrote, with the same sensor file and options: the same estimates, to the last
    /// digit, as if the stream had not ended. It may be the file that --save-state writes
    #[arg(long, value_name = "state.toml", conflicts_with = "initial_strain")]
    pub resume: Option<PathBuf>,
    /// Output
    #[command(flatten)]
    pub written: WrittenArgs,
    /// Estimation
    #[command(flatten)]
    pub estimate: EstimateArgs,
    /// Setup of the measurement
    #[command(flatten)]
    pub setup: SetupArgs,
}

/// Flags of `smooth`.
#[derive(Debug, ClapArgs)]
pub struct SmoothArgs {
    /// Recording, or - for stdin
    pub trace_file: PathBuf,
    /// Output
    #[command(flatten)]
    pub written: WrittenArgs,
    /// Estimation
    #[command(flatten)]
    pub estimate: EstimateArgs,
}

/// A strain that is known at a time, T:X or T:X:SD.
fn known(text: &str) -> Result<Known, String> {
    let expected =
        || "expected T:X or T:X:SD, a time in seconds, a strain and its deviation, e.g. 12.5:0.10".to_string();
    let mut parts = text.split(':');
    let mut number = || parts.next().map(|part| finite(part).map_err(|_| expected())).transpose();
    let (time_s, strain, sd) = (number()?, number()?, number()?);
    match (time_s, strain, parts.next()) {
        (Some(time_s), Some(strain), None) if sd.is_none_or(|sd| sd > 0.0) => Ok(Known { time_s, strain, sd }),
        _ => Err(expected()),
    }
}

/// Source of R₀.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RestResistance {
    /// Given.
    Value(f64),
    /// Median of the first readings.
    First(usize),
    /// R₀ of the calibration, whatever is read.
    Calibrated,
}

impl FromStr for RestResistance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected a positive number, first:N or calibrated".to_string();
        if text == "calibrated" {
            return Ok(Self::Calibrated);
        }
        if let Some(count) = text.strip_prefix("first:") {
            return match count.parse() {
                Ok(count @ 1..) => Ok(Self::First(count)),
                _ => Err(expected()),
            };
        }
        positive(text).map(Self::Value).map_err(|_| expected())
    }
}
