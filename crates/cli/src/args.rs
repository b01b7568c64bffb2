mod evaluate;
mod export;
mod files;
mod fit_law;
mod refine;
mod shell;
mod split;

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args as ClapArgs, CommandFactory, Parser, Subcommand, ValueEnum};
use ohmstrain_bench_data::simulate::{Material, Protocol};
use ohmstrain_bench_data::{FrontEndSpec, JointSpec, Metadata, ResistanceUnit, StrainUnit};
use ohmstrain_calib::{EstimatorKind, GaugeFamily};
use ohmstrain_ekf::Influence;

pub use evaluate::{Estimators, EvaluateArgs};
pub use export::{ExportArgs, ExportTarget};
pub use files::{ImportArgs, InspectArgs};
pub use fit_law::{FitLawArgs, SegmentChoice, phase_name};
pub use refine::RefineArgs;
pub use shell::{CompletionsArgs, ManArgs};
pub use split::Split;

use crate::verbosity::Verbosity;

/// From the resistance of a soft strain sensor to strain, with an honest error bar.
#[derive(Debug, Parser)]
#[command(name = "ohmstrain", version, about, propagate_version = true)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Say nothing on stderr but errors, and nothing at the end of a calibration
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say on stderr what is being done
    #[arg(short, long, global = true)]
    pub verbose: bool,
}

impl Args {
    /// How much is to be said.
    pub const fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (_, true) => Verbosity::Detailed,
            _ => Verbosity::Usual,
        }
    }
}

/// The example that a command's help leads with.
pub fn example(command: &str) -> Option<String> {
    let known = Args::command().find_subcommand(command)?.get_before_help()?.to_string();
    Some(known)
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a bench session, calibrate on its first half, filter, smooth and report; needs no input
    #[command(before_help = "Example: ohmstrain demo --out ohmstrain-demo")]
    Demo(DemoArgs),
    /// Say what stands in a lab's files, and how to import them
    #[command(before_help = "Example: ohmstrain inspect rig.csv --gauge-length-mm 40")]
    Inspect(InspectArgs),
    /// Make a trace of a lab's files
    #[command(before_help = "Example: ohmstrain import rig.csv --gauge-length-mm 40 -o trace.csv")]
    Import(ImportArgs),
    /// Simulate a recording of the bench
    #[command(before_help = "Example: ohmstrain simulate --protocol mixed --speed-mm-s 5 -o trace.csv")]
    Simulate(SimulateArgs),
    /// Fit law, noise and motion to recordings with a known strain
    #[command(before_help = "Example: ohmstrain calibrate bench.csv -o sensor.toml --report report.html")]
    Calibrate(CalibrateArgs),
    /// Fit the extended Kalman filter's noise to readings alone, where no strain was recorded
    #[command(before_help = "Example: ohmstrain refine readings.csv --sensor sensor.toml -o refined.toml")]
    Refine(RefineArgs),
    /// Fit the source paper's closed-form laws to stretches, holds and releases
    #[command(before_help = "Example: ohmstrain fit-law bench.csv --table")]
    FitLaw(FitLawArgs),
    /// Turn readings into strain, row by row
    #[command(before_help = "Example: ohmstrain filter readings.csv --sensor sensor.toml > estimates.csv")]
    Filter(FilterArgs),
    /// Turn a whole recording into strain, every estimate from all readings
    #[command(before_help = "Example: ohmstrain smooth readings.csv --sensor sensor.toml > smoothed.csv")]
    Smooth(SmoothArgs),
    /// Compare estimates with a known strain
    #[command(before_help = "Example: ohmstrain evaluate bench.csv --split 0.5 --report report.html")]
    Evaluate(EvaluateArgs),
    /// Write a calibrated sensor's filter as C or Rust source for a microcontroller
    #[command(before_help = "Example: ohmstrain export --sensor sensor.toml --target c --dt-s 0.02 -o firmware")]
    Export(ExportArgs),
    /// Print a shell's completions of commands and flags
    #[command(
        before_help = "Example: ohmstrain completions bash > ~/.local/share/bash-completion/completions/ohmstrain"
    )]
    Completions(CompletionsArgs),
    /// Write manual pages
    #[command(before_help = "Example: ohmstrain man -o ~/.local/share/man/man1")]
    Man(ManArgs),
}

/// Flags of `demo`.
#[derive(Debug, ClapArgs)]
pub struct DemoArgs {
    /// Folder for trace.csv, sensor.toml, estimates.csv, smoothed.csv and report.html
    #[arg(long, default_value = "ohmstrain-demo")]
    pub out: PathBuf,
    /// The simulated sensor: as wrong-headed as real ones, or three times so
    #[arg(long, value_enum, default_value_t = DemoMaterial::Representative)]
    pub material: DemoMaterial,
    /// Seed of the simulated bench
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
}

/// Sensors of `demo`, neither of the family of laws that is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DemoMaterial {
    /// Hysteresis, release peaks and drift as public recordings show them
    Representative,
    /// Release peaks and relaxation beyond those of any recording
    WorstCase,
}

/// Flags of `simulate`.
#[derive(Debug, ClapArgs)]
pub struct SimulateArgs {
    /// Illustrative material: ecoflex-00-30, ecoflex-00-50, vytaflex-10 or representative
    #[arg(long, default_value = "ecoflex-00-30")]
    pub material: Material,
    /// What the bench does: extend-retract, extend-hold, load-steps, long-holds or mixed
    #[arg(long, default_value = "extend-hold")]
    pub protocol: Protocol,
    /// Largest elongation of the 30 mm sensor, mm
    #[arg(long, default_value_t = 10.0)]
    pub elongation_mm: f64,
    /// Speed of stretching, mm/s
    #[arg(long, default_value_t = 1.0)]
    pub speed_mm_s: f64,
    /// Readings per second
    #[arg(long, default_value_t = 20.0)]
    pub sample_rate_hz: f64,
    /// A sensor outside the family of laws that calibration fits: release peaks, more branches, other nonlinearity
    #[arg(long)]
    pub mismatched: bool,
    /// Read through electronics: the trace then holds `adc` codes
    #[arg(long, value_name = "SPEC")]
    pub front_end: Option<FrontEndSpec>,
    /// Seed of noise, drift and random protocols
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// File to write instead of stdout
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
}

/// What a trace's metadata lines leave unsaid, or say wrongly.
#[derive(Debug, Default, ClapArgs)]
pub struct TraceArgs {
    /// Length of the unstretched sensor, mm
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub gauge_length_mm: Option<f64>,
    /// Electronics, as in `# front_end = …`
    #[arg(long, value_name = "SPEC")]
    pub front_end: Option<FrontEndSpec>,
    /// Joint, as in `# joint = …`
    #[arg(long, value_name = "SPEC")]
    pub joint: Option<JointSpec>,
    /// Unit of the column `strain`: fraction or percent
    #[arg(long, value_name = "UNIT")]
    pub strain_unit: Option<StrainUnit>,
    /// Unit of the column `resistance_ohm`: ohm or kohm
    #[arg(long, value_name = "UNIT")]
    pub resistance_unit: Option<ResistanceUnit>,
}

impl TraceArgs {
    /// As metadata that overrides the file's.
    pub fn metadata(&self) -> Metadata {
        Metadata {
            gauge_length_mm: self.gauge_length_mm,
            front_end: self.front_end,
            joint: self.joint,
            strain_unit: self.strain_unit,
            resistance_unit: self.resistance_unit,
            ..Metadata::default()
        }
    }
}

/// Flags of `calibrate`.
#[derive(Debug, ClapArgs)]
pub struct CalibrateArgs {
    /// Recordings with a reference
    #[arg(required = true)]
    pub traces: Vec<PathBuf>,
    /// Where to write the sensor's parameters
    #[arg(short, long, value_name = "sensor.toml")]
    pub output: PathBuf,
    /// Use rows with time_s >= T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub from: Option<f64>,
    /// Use rows with time_s < T only
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub until: Option<f64>,
    /// Relaxing branches: auto (1 to 3, what the filter does best with) or 0 to 4
    #[arg(long, default_value = "auto")]
    pub branches: Auto<Branches>,
    /// Family of the gauge curve: auto (polynomial), polynomial, decaying-exponential or tunnelling
    #[arg(long, default_value = "auto")]
    pub gauge: Auto<Gauge>,
    /// Estimator to calibrate and to make the default: auto (corrected: sign-split and what is learned about its error), corrected, ekf, ukf, imm, sign-split,
    /// hypotheses or particles; ekf is calibrated in any case
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<Estimator>,
    /// Move a reference that is early or late to where the readings say it belongs
    #[arg(long)]
    pub align: bool,
    /// Seed of --bootstrap; the calibration itself draws nothing
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print what the recordings say about the law's parameters, which structures explain them, and what to record next
    #[arg(long)]
    pub explain: bool,
    /// Print 95 % intervals of the law's parameters from N fits to blocks of the recordings drawn anew
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub bootstrap: Option<u32>,
    /// Print what the calibration came to as JSON
    #[arg(long, conflicts_with_all = ["explain", "bootstrap"])]
    pub json: bool,
    /// Report and figures, of the first recording
    #[command(flatten)]
    pub report: ReportArgs,
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
    /// Overrides of the recordings' metadata
    #[command(flatten)]
    pub trace: TraceArgs,
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

/// Flags that `filter` and `smooth` share.
#[derive(Debug, ClapArgs)]
pub struct EstimateArgs {
    /// The sensor's parameters
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: PathBuf,
    /// Estimator: auto (the sensor file's choice), corrected, ekf, ukf, imm, sign-split, hypotheses or
    /// particles, which smooth with sign-split
    #[arg(long, default_value = "auto")]
    pub estimator: Auto<Estimator>,
    /// Do without the learned correction of the strain, to compare
    #[arg(long)]
    pub no_correction: bool,
    /// Strain (or angle) at the first row, if it is known; the body is at rest there
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = finite)]
    pub initial_strain: Option<f64>,
    /// What the rested, unstretched sensor reads now, in place of what it read in calibration: a number in the readings'
    /// unit, or first:N for the median of the first N readings
    #[arg(long, value_name = "OHM|first:N")]
    pub rest_resistance: Option<RestResistance>,
    /// Turn down readings whose normalised innovation squared (column nis) is above X, ten in a row at most
    #[arg(long, value_name = "X", value_parser = positive)]
    pub gate: Option<f64>,
    /// Bound the influence of surprising readings: huber:K (in standard deviations) or student-t:DOF
    #[arg(long, value_name = "huber:K|student-t:DOF")]
    pub influence: Option<BoundedInfluence>,
    /// Columns to write, separated by commas; all by default
    #[arg(long, value_delimiter = ',')]
    pub columns: Vec<String>,
    /// Overrides of the recording's metadata
    #[command(flatten)]
    pub trace: TraceArgs,
}

/// Flags of `filter`.
#[derive(Debug, ClapArgs)]
pub struct FilterArgs {
    /// Recording, or - for stdin
    #[arg(default_value = "-")]
    pub trace_file: PathBuf,
    /// Estimate every row from the readings up to S seconds after it; rows come out that much later
    #[arg(long, value_name = "S", value_parser = positive)]
    pub lag_s: Option<f64>,
    /// How to estimate
    #[command(flatten)]
    pub estimate: EstimateArgs,
}

/// Flags of `smooth`.
#[derive(Debug, ClapArgs)]
pub struct SmoothArgs {
    /// Recording, or - for stdin
    pub trace_file: PathBuf,
    /// How to estimate
    #[command(flatten)]
    pub estimate: EstimateArgs,
}

/// A number that is neither NaN nor infinite.
fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| "expected a finite number".into())
}

/// A finite number above zero.
fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or_else(|| "expected a positive number".into())
}

/// `auto`, or a value.
#[derive(Clone, Copy, Debug)]
pub enum Auto<T> {
    /// Let the program choose.
    Auto,
    /// Chosen.
    Chosen(T),
}

impl<T> Auto<T> {
    /// The choice, if one was made.
    pub fn chosen(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Chosen(value) => Some(value),
        }
    }
}

impl<T: FromStr<Err = String>> FromStr for Auto<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Chosen) }
    }
}

/// A number of branches.
#[derive(Clone, Copy, Debug)]
pub struct Branches(pub usize);

impl FromStr for Branches {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(count @ 0..=4) => Ok(Self(count)),
            _ => Err("expected auto or 0 to 4".into()),
        }
    }
}

/// A family of gauge curves.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Gauge {
    /// Cubic polynomial.
    Polynomial,
    /// Rises to a peak and falls.
    DecayingExponential,
    /// Tunnelling between particles.
    Tunnelling,
}

impl FromStr for Gauge {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        <Self as ValueEnum>::from_str(text, false)
            .map_err(|_| "expected auto, polynomial, decaying-exponential or tunnelling".into())
    }
}

impl From<Gauge> for GaugeFamily {
    fn from(gauge: Gauge) -> Self {
        match gauge {
            Gauge::Polynomial => Self::Polynomial,
            Gauge::DecayingExponential => Self::DecayingExponential,
            Gauge::Tunnelling => Self::Tunnelling,
        }
    }
}

/// An estimator.
#[derive(Clone, Copy, Debug)]
pub struct Estimator(pub EstimatorKind);

impl FromStr for Estimator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<&str> = EstimatorKind::ALL.iter().map(|kind| kind.name()).collect();
        EstimatorKind::ALL
            .into_iter()
            .find(|kind| kind.name() == text)
            .map(Self)
            .ok_or_else(|| format!("expected auto or {}", names.join(", ")))
    }
}

/// How the influence of a surprising reading is bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundedInfluence(pub Influence<f64>);

impl FromStr for BoundedInfluence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected huber:K or student-t:DOF with a positive number".to_string();
        let (kind, number) = text.split_once(':').ok_or_else(expected)?;
        let number = positive(number).map_err(|_| expected())?;
        match kind {
            "huber" => Ok(Self(Influence::Huber { threshold: number })),
            "student-t" => Ok(Self(Influence::StudentT { degrees_of_freedom: number })),
            _ => Err(expected()),
        }
    }
}

/// Where R₀ comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RestResistance {
    /// Given.
    Value(f64),
    /// Median of the first readings.
    First(usize),
}

impl FromStr for RestResistance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected a positive number or first:N".to_string();
        if let Some(count) = text.strip_prefix("first:") {
            return match count.parse() {
                Ok(count @ 1..) => Ok(Self::First(count)),
                _ => Err(expected()),
            };
        }
        positive(text).map(Self::Value).map_err(|_| expected())
    }
}
