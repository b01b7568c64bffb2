use clap::Args as ClapArgs;
use ohmstrain_bench_data::{FrontEndSpec, JointSpec, Metadata, ResistanceUnit, StrainUnit};

use super::positive;

/// What a trace's metadata lines leave unsaid, or say wrongly.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct TraceArgs {
    /// Length of the unstretched sensor, mm
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = positive)]
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
