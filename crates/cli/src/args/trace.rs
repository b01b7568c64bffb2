use clap::Args as ClapArgs;
use ohmstrain_bench_data::{FrontEndSpec, JointSpec, Metadata, ResistanceUnit, StrainUnit};

use super::positive;

/// What was measured with.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct SetupArgs {
    /// Length of the unstretched sensor, mm: turns a displacement into strain
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = positive)]
    pub gauge_length_mm: Option<f64>,
    /// Electronics, which turn converter codes into ohms, as in `# front_end = …`:
    /// 'divider reference_ohm=10000 side=low bits=12 noise_codes=0.5'
    #[arg(long, value_name = "SPEC")]
    pub front_end: Option<FrontEndSpec>,
    /// Joint, which turns an angle into strain, as in `# joint = …`:
    /// 'prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30'
    #[arg(long, value_name = "SPEC")]
    pub joint: Option<JointSpec>,
}

/// What is replaced.
#[derive(Clone, Copy, Debug, Default, ClapArgs)]
pub struct ReplaceArgs {
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
}

/// What a trace's metadata lines leave unsaid, or say wrongly.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct TraceArgs {
    /// What was measured with
    #[command(flatten)]
    pub setup: SetupArgs,
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
            gauge_length_mm: self.setup.gauge_length_mm,
            front_end: self.setup.front_end,
            joint: self.setup.joint,
            strain_unit: self.strain_unit,
            resistance_unit: self.resistance_unit,
            ..Metadata::default()
        }
    }
}
