use std::fmt;
use std::str::FromStr;

use crate::import::number::number;
use crate::import::recipe::{ColumnName, Recipe};
use crate::import::roles::Role;
use crate::import::table::Table;

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

    /// As flags name it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ElectromechStretcher => "electromech-stretcher",
        }
    }

    /// The preset, if there is one, that a table without names looks like.
    #[must_use]
    pub fn that_fits(table: &Table) -> Option<Self> {
        let times = [2, 4, 6];
        let fits = !table.has_names()
            && table.columns.len() == 7
            && table.len() > 2
            && times.iter().all(|column| increases(table, *column))
            && [0, 1].iter().all(|column| !increases(table, *column));
        fits.then_some(Self::ElectromechStretcher)
    }

    /// A recipe with what the preset knows where the recipe says nothing.
    pub(crate) fn complete(self, recipe: &Recipe) -> Recipe {
        let mut out = recipe.clone();
        let number = |number: usize| ColumnName { file: None, column: number.to_string() };
        let references = Role::REFERENCES.iter().any(|role| recipe.column(*role).is_some());
        let columns: &[(Role, usize, &str)] = &[
            (Role::Time, 3, "s"),
            (Role::Resistance, 2, "ohm"),
            (Role::Displacement, 4, "mm"),
            (Role::ReferenceTime, 5, "s"),
        ];
        for &(role, column, unit) in columns {
            if recipe.column(role).is_none() && !(role == Role::Displacement && references) {
                out.columns.push((role, number(column)));
            }
            if recipe.unit(role).is_none() {
                out.units.push((role, unit.to_owned()));
            }
        }
        for role in [Role::Resistance, Role::Displacement] {
            out.magnitude.push(role);
        }
        out.drop_zeros.push(Role::Displacement);
        out.fold_polarity = true;
        out.gauge_length_mm = recipe.gauge_length_mm.or(Some(40.0));
        out
    }
}

/// Whether the numbers of a column increase from row to row, all but a few.
pub(crate) fn increases(table: &Table, column: usize) -> bool {
    let decimal = table.layout.decimal;
    let cells = table.columns[column].cells.iter();
    let known: Vec<f64> = cells.filter_map(|cell| number(cell.trim(), decimal, 0)).collect();
    let steps = known.len().saturating_sub(1);
    let upward = known.windows(2).filter(|pair| pair[1] > pair[0]).count();
    known.len() * 10 > table.len() * 9 && steps > 0 && upward * 100 >= steps * 98
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
