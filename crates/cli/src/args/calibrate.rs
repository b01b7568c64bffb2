use std::path::PathBuf;

use clap::Args as ClapArgs;
use ohmstrain::{EstimatorKind, GaugeFamily};

use super::{Auto, Branches, Coefficients, ReplaceArgs, UnitArgs, finite};

/// Flags of `calibrate`.
#[derive(Debug, ClapArgs)]
pub struct CalibrateArgs {
    /// Recordings with a reference, of one channel, or with a column NAME_ohm or NAME_ratio for each of several
    #[arg(required = true)]
    pub traces: Vec<PathBuf>,
    /// File to write the sensor's parameters to; for several channels hand.toml, with the sensors beside it
    #[arg(short, long, value_name = "sensor.toml")]
    pub output: PathBuf,
    /// Calibrate on rows with time_s >= T only; the others test the sensor, and widen intervals that do not hold them
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub from: Option<f64>,
    /// Calibrate on rows with time_s < T only; the others test the sensor, and widen intervals that do not hold them
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub until: Option<f64>,
    /// Relaxing branches: auto (1 to 3, what the filter does best with) or 0 to 4
    #[arg(long, default_value = "auto")]
    pub branches: Auto<Branches>,
    /// Family of the gauge curve: auto (polynomial), polynomial, decaying-exponential or tunnelling
    #[arg(long, default_value = "auto")]
    pub gauge: Auto<GaugeFamily>,
    /// Estimator to calibrate and to make the default: auto (corrected, or static-cubic if that is better on held-out quarters), corrected
    /// (sign-split and what is learned about its error), ekf, ukf, imm, sign-split, hypotheses or static-cubic; ekf is calibrated in any
    /// case
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<EstimatorKind>,
    /// Prior learned from other sensors of the make (`fleet fit`): a short motion is enough then
    #[arg(long, value_name = "prior.toml", conflicts_with_all = ["branches", "gauge"])]
    pub prior: Option<PathBuf>,
    /// Effect of temperature, instead of fitting it, for recordings with temperature_c: relative changes per kelvin, with standard
    /// deviations, of R0 and, after a comma, of the change with strain
    #[arg(long, value_name = "A:SD[,B:SD]", allow_hyphen_values = true)]
    pub temperature: Option<Coefficients>,
    /// Marks in place of a reference, a file for each recording: columns time_s, strain (or angle_deg) and, if known, until_s (the body
    /// was held), strain_sd and time_sd_s. The motion between them is found with the law; a reference in the recording is not used
    #[arg(long, value_name = "marks.csv", conflicts_with = "align")]
    pub marks: Vec<PathBuf>,
    /// Move a reference that is early or late to where the readings say it belongs
    #[arg(long)]
    pub align: bool,
    /// Seed of --bootstrap; the calibration itself draws nothing
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print what the recordings say about the law's parameters, which structures explain them, and what to record next
    #[arg(long)]
    pub explain: bool,
    /// Print 95 % intervals of the law's parameters from N fits to blocks of the recordings drawn anew; 200 or more are reliable
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub bootstrap: Option<u32>,
    /// Print the result as JSON
    #[arg(long, conflicts_with_all = ["explain", "bootstrap"])]
    pub json: bool,
    /// Report and figures, of the first recording
    #[command(flatten)]
    pub report: ReportArgs,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Units of the recordings' columns
    #[command(flatten)]
    pub units: UnitArgs,
}

/// Pictures of a recording and its estimates.
#[derive(Debug, Default, ClapArgs)]
pub struct ReportArgs {
    /// Also write a report of the first recording
    #[arg(long, value_name = "report.html")]
    pub report: Option<PathBuf>,
    /// Also write every plot of that report as SVG, with what is drawn as CSV, to this folder
    #[arg(long, value_name = "DIR")]
    pub figures: Option<PathBuf>,
}
