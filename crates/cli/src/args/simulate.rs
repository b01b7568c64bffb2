use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use ohmstrain_bench_data::FrontEndSpec;
use ohmstrain_bench_data::simulate::{Chamber, Material, Person, Protocol};

use super::ReplaceArgs;

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
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
}

/// Flags of `example`.
#[derive(Debug, ClapArgs)]
pub struct ExampleArgs {
    /// File to write instead of stdout
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
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
    /// Movements of the bench: extend-retract, extend-hold, load-steps, long-holds or mixed
    #[arg(long, default_value = "extend-hold")]
    pub protocol: Protocol,
    /// A person who follows this protocol, in place of the bench: late, unevenly, and off the positions
    #[arg(long, value_name = "protocol.toml", conflicts_with_all = ["protocol", "speed_mm_s"])]
    pub follow: Option<PathBuf>,
    /// The person's faults: standard deviation of positions, as a share of their span, and shares of steps not made and of
    /// holds that end early
    #[arg(long, value_name = "SPEC", default_value = "mark_sd=0.02 missed=0 cut_short=0", requires = "follow")]
    pub person: Person,
    /// Joint of the protocol that the sensor sits on, if it has several
    #[arg(long, value_name = "NAME", requires = "follow")]
    pub joint: Option<String>,
    /// Length of the protocol `mixed`, s; default 400
    #[arg(long, value_name = "S", conflicts_with = "follow")]
    pub duration_s: Option<f64>,
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
    /// A climate chamber whose temperature rises and falls, and is recorded: low_c, high_c, period_s, and the effect on R₀ and on
    /// the change with strain, rest_per_k and gain_per_k
    #[arg(long, value_name = "SPEC")]
    pub chamber: Option<Chamber>,
    /// Read through electronics: the trace then holds `adc` codes
    #[arg(long, value_name = "SPEC")]
    pub front_end: Option<FrontEndSpec>,
    /// Seed of noise, drift and random protocols
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Another sensor of the same make, drawn with this seed
    #[arg(long, value_name = "SEED")]
    pub individual: Option<u64>,
    /// File to write instead of stdout
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
}
