use std::path::PathBuf;

use clap::Args as ClapArgs;
use ohmstrain_bench_data::JointSpec;
use ohmstrain_bench_data::simulate::Material;

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
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
