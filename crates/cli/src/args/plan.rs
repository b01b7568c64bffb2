use std::path::PathBuf;
use std::str::FromStr;

use clap::Args as ClapArgs;
use ohmstrain_bench_data::JointSpec;
use ohmstrain_bench_data::simulate::Material;

use super::{ReplaceArgs, finite, positive};

/// Flags of `plan`.
#[derive(Debug, ClapArgs)]
pub struct PlanArgs {
    /// A calibrated sensor; without one, an illustrative sensor of --material
    #[arg(long, value_name = "sensor.toml")]
    pub sensor: Option<PathBuf>,
    /// Illustrative material: ecoflex-00-30, ecoflex-00-50, vytaflex-10 or representative
    #[arg(long, default_value = "representative", conflicts_with = "sensor")]
    pub material: Material,
    /// Joint, to tell the error of its angle, as in `# joint = …`: 'prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30'
    #[arg(long, value_name = "SPEC")]
    pub joint: Option<JointSpec>,
    /// Write a protocol for `record`: names and strains of positions in which the body can be held, the rest first:
    /// 'rest=0 half=0.1 full=0.2'
    #[arg(long, value_name = "POSITIONS", requires = "output", conflicts_with_all = ["sensor", "json", "joint"])]
    pub strains: Option<Positions>,
    /// The same with angles, degrees: 'flat=0 half=45 fist=90'
    #[arg(long, value_name = "POSITIONS", requires = "output", conflicts_with_all = ["strains", "sensor", "json", "joint"])]
    pub angles: Option<Positions>,
    /// Joints of the protocol, if a recording has a column of readings for each: thumb,index
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "output")]
    pub joints: Vec<String>,
    /// Duration of the protocol
    #[arg(long, value_name = "MINUTES", default_value = "4", value_parser = positive, requires = "output")]
    pub minutes: f64,
    /// File for the protocol
    #[arg(short, long, value_name = "protocol.toml")]
    pub output: Option<PathBuf>,
    /// Permission to replace files
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Positions with their values.
#[derive(Clone, Debug)]
pub struct Positions(pub Vec<(String, f64)>);

impl FromStr for Positions {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let pair = |word: &str| {
            let (name, value) = word.split_once('=').filter(|(name, _)| !name.is_empty())?;
            Some((name.to_owned(), finite(value).ok()?))
        };
        let found: Option<Vec<_>> = text.split_whitespace().map(pair).collect();
        let expected = "expected two or more positions with a number each, as in 'rest=0 half=0.1 full=0.2'";
        found.filter(|found| found.len() > 1).map(Self).ok_or_else(|| expected.into())
    }
}
