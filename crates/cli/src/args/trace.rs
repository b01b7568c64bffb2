use std::str::FromStr;

use clap::Args as ClapArgs;
use ohmstrain_bench_data::{FrontEndSpec, JointSpec, Metadata, ResistanceUnit, StrainUnit};

use super::positive;

/// Setup of a measurement: flags of commands that read files of a lab, or streams.
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

impl SetupArgs {
    /// Returns them as metadata that overrides the stream's, with the units of its columns.
    pub fn metadata(&self, units: &UnitArgs) -> Metadata {
        Metadata {
            gauge_length_mm: self.gauge_length_mm,
            front_end: self.front_end,
            joint: self.joint,
            ..units.metadata()
        }
    }
}

/// Permission to replace files.
#[derive(Clone, Copy, Debug, Default, ClapArgs)]
pub struct ReplaceArgs {
    /// Replace files that this program did not write, too
    #[arg(long)]
    pub force: bool,
}

/// Units that a trace's metadata lines omit, or state wrongly.
#[derive(Clone, Debug, Default, ClapArgs)]
pub struct UnitArgs {
    /// Unit of a column: strain=percent or strain=fraction, resistance=kohm or resistance=ohm; repeatable, the last one of a
    /// column counts
    #[arg(long = "unit", value_name = "COLUMN=UNIT", value_delimiter = ',')]
    pub units: Vec<ColumnUnit>,
}

impl UnitArgs {
    /// Returns them as metadata that overrides the file's.
    pub fn metadata(&self) -> Metadata {
        let mut metadata = Metadata::default();
        for unit in &self.units {
            match *unit {
                ColumnUnit::Strain(unit) => metadata.strain_unit = Some(unit),
                ColumnUnit::Resistance(unit) => metadata.resistance_unit = Some(unit),
            }
        }
        metadata
    }
}

/// The unit of a trace's column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnUnit {
    /// Unit of `strain`.
    Strain(StrainUnit),
    /// Unit of `resistance_ohm`.
    Resistance(ResistanceUnit),
}

impl FromStr for ColumnUnit {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (column, unit) = text.split_once('=').unwrap_or((text, ""));
        let found = match column.trim() {
            "strain" => StrainUnit::spelled(unit).map(Self::Strain),
            "resistance" | "resistance_ohm" => ResistanceUnit::spelled(unit).map(Self::Resistance),
            _ => None,
        };
        found.ok_or(
            "expected strain=fraction, strain=percent, resistance=ohm or resistance=kohm; `ohmstrain import` reads other units",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_spelled_as_import_takes_them() {
        let unit = |text: &str| text.parse::<ColumnUnit>().ok();
        let percent = Some(ColumnUnit::Strain(StrainUnit::Percent));
        assert_eq!(["strain=percent", "strain=%", "strain = Percent"].map(unit), [percent; 3]);
        let kohm = Some(ColumnUnit::Resistance(ResistanceUnit::Kohm));
        assert_eq!(["resistance=kohm", "resistance=kΩ", "resistance_ohm=k"].map(unit), [kohm; 3]);
        assert_eq!(unit("strain=fraction"), Some(ColumnUnit::Strain(StrainUnit::Fraction)));
        assert_eq!(unit("resistance=Ohm"), Some(ColumnUnit::Resistance(ResistanceUnit::Ohm)));
        for text in ["", "percent", "strain", "strain=", "strain=kohm", "strain=permille", "resistance=megohm", "adc=1"]
        {
            assert_eq!(unit(text), None, "{text}");
        }
    }

    #[test]
    fn the_last_unit_of_a_column_counts() {
        let units = ["strain=percent", "resistance=kohm", "strain=fraction"].map(|text| text.parse().unwrap());
        let metadata = UnitArgs { units: units.to_vec() }.metadata();
        let expected = (Some(StrainUnit::Fraction), Some(ResistanceUnit::Kohm));
        assert_eq!((metadata.strain_unit, metadata.resistance_unit), expected);
    }
}
