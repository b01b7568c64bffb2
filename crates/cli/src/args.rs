mod batch;
mod calibrate;
mod choice;
mod estimate;
mod evaluate;
mod export;
mod files;
mod fit_law;
mod fleet;
mod hand;
mod live;
mod plan;
mod port;
mod record;
mod refine;
mod serial_check;
mod serve;
mod shell;
mod simulate;
mod split;
mod trace;

use clap::{CommandFactory, Parser, Subcommand, ValueEnum};

pub use batch::{BatchArgs, BatchCommand, SummaryForm};
pub use calibrate::{CalibrateArgs, ReportArgs};
pub use choice::{Auto, Branches, Coefficients};
pub use estimate::{EstimateArgs, FilterArgs, Format, RestResistance, SmoothArgs, Without, WrittenArgs};
pub use evaluate::{Estimators, EvaluateArgs};
pub use export::ExportArgs;
pub use files::{ImportArgs, InspectArgs};
pub use fit_law::{FitLawArgs, SegmentChoice, TableFormat, phase_name};
pub use fleet::{FleetArgs, FleetCommand};
pub use hand::HandArgs;
pub use live::LiveArgs;
pub use plan::PlanArgs;
pub use port::PortArgs;
pub use record::RecordArgs;
pub use refine::RefineArgs;
pub use serial_check::SerialCheckArgs;
pub use serve::ServeArgs;
pub use shell::{CompletionsArgs, ManArgs};
pub use simulate::{DemoArgs, DemoMaterial, ExampleArgs, SimulateArgs};
pub use split::Split;
pub use trace::{ReplaceArgs, SetupArgs, UnitArgs};

use crate::messages::Verbosity;

/// From the resistance of a soft strain sensor to strain, with an honest error bar.
#[derive(Debug, Parser)]
#[command(
    name = "ohmstrain",
    version,
    propagate_version = true,
    max_term_width = 100,
    after_help = "`ohmstrain inspect FILE` says how to begin with a file of yours; `ohmstrain demo` needs none."
)]
pub struct Args {
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
    /// Say nothing on stderr but errors, and nothing at the end of a calibration
    #[arg(short, long, global = true, conflicts_with = "verbose", display_order = 900)]
    pub quiet: bool,
    /// Say on stderr what is being done
    #[arg(short, long, global = true, display_order = 900)]
    pub verbose: bool,
}

impl Args {
    /// Returns the amount of messages.
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
    Some(Args::command().find_subcommand(command)?.get_before_help()?.to_string())
}

/// The name of a choice on the command line.
pub fn name_of(choice: impl ValueEnum) -> String {
    choice.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a bench session, calibrate on its first half, filter, smooth and report; needs no input
    #[command(before_help = "Example: ohmstrain demo --out ohmstrain-demo")]
    Demo(DemoArgs),
    /// Write a recording to try the other commands on: that of the demo
    #[command(
        before_help = "Example: ohmstrain example -o trace.csv",
        after_help = "Then: ohmstrain calibrate trace.csv --until 200 -o sensor.toml\n      ohmstrain smooth trace.csv --sensor sensor.toml -o strain.csv"
    )]
    Example(ExampleArgs),
    /// Show the page for a browser, from this computer to this computer
    #[command(before_help = "Example: ohmstrain serve --port 8476")]
    Serve(ServeArgs),
    /// Describe a lab's files, and how to import them
    #[command(before_help = "Example: ohmstrain inspect rig.csv --gauge-length-mm 40")]
    Inspect(InspectArgs),
    /// Make a trace of a lab's files
    #[command(before_help = "Example: ohmstrain import rig.csv --gauge-length-mm 40 -o trace.csv")]
    Import(ImportArgs),
    /// Say what a recording should contain, and what sampling and converter will be worth
    #[command(before_help = "Example: ohmstrain plan --material representative")]
    Plan(PlanArgs),
    /// Pace a person through a protocol while readings are recorded: the strain is known where the body is held
    #[command(
        before_help = "Example: ohmstrain record --port /dev/ttyACM0 --protocol protocol.toml -o trace.csv",
        after_help = "Before: ohmstrain plan --angles 'flat=0 half=45 fist=90' -o protocol.toml\nThen: ohmstrain calibrate trace.csv -o sensor.toml"
    )]
    Record(RecordArgs),
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
    #[command(before_help = "Example: ohmstrain filter readings.csv --sensor sensor.toml -o estimates.csv")]
    Filter(FilterArgs),
    /// Watch strain in the terminal while readings arrive from a serial port, or play a recording back
    #[command(before_help = "Example: ohmstrain live --port /dev/ttyACM0 --sensor sensor.toml")]
    Live(LiveArgs),
    /// Turn readings of several joints into all their angles
    #[command(before_help = "Example: ohmstrain hand hand.toml readings.csv -o angles.csv")]
    Hand(HandArgs),
    /// Turn a whole recording into strain, every estimate from all readings
    #[command(before_help = "Example: ohmstrain smooth readings.csv --sensor sensor.toml -o smoothed.csv")]
    Smooth(SmoothArgs),
    /// Compare estimates with a known strain
    #[command(before_help = "Example: ohmstrain evaluate bench.csv --split 0.5 --report report.html")]
    Evaluate(EvaluateArgs),
    /// Filter, smooth, evaluate or calibrate many recordings, also of several joints, in parallel; bad ones are reported and the others go on
    #[command(before_help = "Example: ohmstrain batch smooth recordings/*.csv --sensor sensor.toml -o smoothed")]
    Batch(BatchArgs),
    /// Learn from calibrated sensors of one make, so that a short motion calibrates the next one
    #[command(before_help = "Example: ohmstrain fleet fit sensors/*.toml -o prior.toml")]
    Fleet(FleetArgs),
    /// Write a calibrated sensor's filter as C or Rust source for a microcontroller
    #[command(before_help = "Example: ohmstrain export --sensor sensor.toml --target c --dt-s 0.02 -o firmware")]
    Export(ExportArgs),
    /// Say whether a board with the exported sketch computes what this computer does
    #[command(before_help = "Example: ohmstrain serial-check --sensor sensor.toml --dt-s 0.02 --port /dev/ttyACM0")]
    SerialCheck(SerialCheckArgs),
    /// Print a shell's completions of commands and flags
    #[command(
        before_help = "Example: ohmstrain completions bash > ~/.local/share/bash-completion/completions/ohmstrain"
    )]
    Completions(CompletionsArgs),
    /// Write manual pages
    #[command(before_help = "Example: ohmstrain man -o ~/.local/share/man/man1")]
    Man(ManArgs),
}

/// A number that is neither NaN nor infinite.
fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(|| "expected a finite number".into())
}

/// A finite number above zero.
fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or_else(|| "expected a positive number".into())
}
