use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, ValueEnum};
use ohmstrain_sensor::EstimatorKind;

use super::{ReplaceArgs, ReportArgs, RestResistance, Split, UnitArgs, finite, positive};

/// Flags of `evaluate`.
#[derive(Debug, ClapArgs)]
pub struct EvaluateArgs {
    /// Recordings with a reference
    #[arg(required_unless_present = "test", conflicts_with = "test")]
    pub traces: Vec<PathBuf>,
    /// Source of the calibration
    #[command(flatten)]
    pub calibration: CalibrationSource,
    /// Test on this recording what was calibrated with --train; may be given several times
    #[arg(long, value_name = "TRACE", requires = "train", conflicts_with_all = ["sensor", "split"])]
    pub test: Vec<PathBuf>,
    /// Estimator: auto (the sensor file's choice, or the one that calibrate would choose), corrected, ekf, ukf, imm,
    /// sign-split, hypotheses, static-cubic, or all
    #[arg(long, default_value = "auto")]
    pub estimator: Estimators,
    /// Do without the learned correction of the strain. Without this flag, calibrations are scored with and without it
    #[arg(long, value_enum, value_name = "WHAT")]
    pub without: Option<ScoredWithout>,
    /// Score rows with time_s >= T only; the filter still starts at the first row
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite, conflicts_with = "split")]
    pub from: Option<f64>,
    /// Reading of the rested, unstretched sensor: a number in the readings' unit, first:N for the median of each
    /// recording's first N readings, or calibrated; the baselines have their readings scaled alike. Without this flag
    /// R₀ follows the readings, as in filter
    #[arg(long, value_name = "OHM|first:N|calibrated", allow_negative_numbers = true)]
    pub rest_resistance: Option<RestResistance>,
    /// Also score with known strains, taken from the reference: one
    /// every S seconds, and one near each end of the range, at the start
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = positive)]
    pub known_every: Option<f64>,
    /// Exit with code 3 unless every recording is estimated better than by the static cubic and its 95 % interval covers
    /// 80 % or more
    #[arg(long)]
    pub check: bool,
    /// Report and figures, of the first recording and the first estimator; the rows that are scored are marked
    #[command(flatten)]
    pub report: ReportArgs,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Units of the recordings' columns
    #[command(flatten)]
    pub units: UnitArgs,
}

/// Part that a score can leave out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ScoredWithout {
    /// The learned correction of the strain
    Correction,
}

impl EvaluateArgs {
    /// True if estimates have the learned correction.
    pub fn with_correction(&self) -> bool {
        self.without != Some(ScoredWithout::Correction)
    }

    /// True if this recording is to be drawn: the first one, if any.
    pub fn draws(&self, name: &str) -> bool {
        let first = self.traces.first().or(self.test.first());
        let is_first = first.is_some_and(|first| first.display().to_string() == name);
        is_first && (self.report.report.is_some() || self.report.figures.is_some())
    }
}

/// Source of the calibration for `evaluate`: exactly one of these.
#[derive(Debug, ClapArgs)]
#[group(required = true, multiple = false)]
pub struct CalibrationSource {
    /// The sensor's parameters, or a hand.toml for recordings of several channels
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: Option<PathBuf>,
    /// Calibrate on this share of the rows of each recording, the first ones, and score the rest; SHARE:reversed calibrates
    /// on the last ones and scores those before, reversed stands for 0.5:reversed. The filter still starts at the first
    /// row. Several, separated by commas, are done one after another and summed up
    #[arg(long, visible_alias = "splits", value_name = "SHARE", value_delimiter = ',')]
    pub split: Vec<Split>,
    /// Calibrate on this recording; may be given several times
    #[arg(long, value_name = "TRACE", requires = "test")]
    pub train: Vec<PathBuf>,
    /// Score each recording with what was calibrated on all others, and sum up: what another day's recording may bring
    #[arg(long)]
    pub leave_one_out: bool,
}

/// The estimators to evaluate.
#[derive(Clone, Copy, Debug)]
pub enum Estimators {
    /// The one that calibration chooses.
    Auto,
    /// All estimators; for a sensor file, all that it has parameters for.
    All,
    /// A given estimator.
    One(EstimatorKind),
}

impl FromStr for Estimators {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "all" => Ok(Self::All),
            name => name.parse().map(Self::One).map_err(|expected| expected + " or all"),
        }
    }
}
