use std::fmt;
use std::str::FromStr;

use crate::import::table::Table;
use crate::import::words::Role;

/// A layout of a known rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preset {
    /// The public rig `electromech-stretcher`: no header, seven columns `Ro, Ri, tR, P, tP, F, tF` (outer and inner
    /// resistance, Ω, their time, s, position, mm, its time, force, N, its time). The current's polarity flips with every
    /// reading, `P` drops to 0 now and then, signs of `Ri` and `P` are arbitrary, the sensor is 40 mm long.
    ElectromechStretcher,
}

impl Preset {
    /// All of them.
    pub const ALL: [Self; 1] = [Self::ElectromechStretcher];

    /// Returns its name in flags.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ElectromechStretcher => "electromech-stretcher",
        }
    }

    /// Returns the preset, if any, whose layout a table without names matches.
    #[must_use]
    pub fn that_fits(table: &Table) -> Option<Self> {
        let rises = |column: usize| table.increases(column);
        let fits = !table.has_names()
            && table.columns.len() == 7
            && table.len() > 2
            && [2, 4, 6].into_iter().all(rises)
            && ![0, 1].into_iter().any(rises);
        fits.then_some(Self::ElectromechStretcher)
    }

    /// Returns the roles of its columns, counted from 1, and their units.
    pub(crate) const fn columns(self) -> [(Role, usize, &'static str); 4] {
        match self {
            Self::ElectromechStretcher => [
                (Role::Time, 3, "s"),
                (Role::Resistance, 2, "ohm"),
                (Role::Displacement, 4, "mm"),
                (Role::ReferenceTime, 5, "s"),
            ],
        }
    }

    /// Returns the length of its sensors, mm.
    pub(crate) const fn gauge_length_mm(self) -> f64 {
        match self {
            Self::ElectromechStretcher => 40.0,
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

impl FromStr for Preset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<&str> = Self::ALL.iter().map(|preset| preset.name()).collect();
        let found = Self::ALL.into_iter().find(|preset| preset.name() == text);
        found.ok_or_else(|| format!("expected {}", names.join(" or ")))
    }
}
