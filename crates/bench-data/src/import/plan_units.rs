use crate::error::quote;
use crate::import::channel::{Channel, name};
use crate::import::error::ImportError;
use crate::import::names::doubtful_unit;
use crate::import::number::{number, ohms};
use crate::import::questions::quoted;
use crate::import::recipe::Recipe;
use crate::import::roles::Role;
use crate::import::stamp::{Order, has_points, orders};
use crate::import::table::Table;
use crate::import::units::{self, Scale, Unit};
use crate::order::median;

/// Steps of times with fractions are taken for seconds up to this, s: slower than that, they may be milliseconds.
const LONGEST_STEP_S: f64 = 2.0;
/// Shorter steps are no seconds: days, perhaps.
const SHORTEST_STEP_S: f64 = 1e-5;
/// A resistance without a unit is taken for ohms from this on.
const LEAST_OHM: f64 = 10.0;

/// The channel of a column, its unit found or asked. What follows from the numbers is remarked.
pub(crate) fn channel(
    tables: &[Table],
    recipe: &Recipe,
    (role, table, column): (Role, usize, usize),
    remarks: &mut Vec<String>,
) -> Result<Channel, ImportError> {
    let unit = Asked { table: &tables[table], column, role }.unit(recipe, remarks)?;
    Ok(Channel { role, table, column, unit })
}

struct Asked<'a> {
    table: &'a Table,
    column: usize,
    role: Role,
}

impl Asked<'_> {
    fn unit(&self, recipe: &Recipe, remarks: &mut Vec<String>) -> Result<Unit, ImportError> {
        if let Some(text) = recipe.unit(self.role) {
            return units::unit_or_scale(self.role, text).ok_or_else(|| {
                let what = format!(
                    "--unit {}: there is no such unit of {}",
                    quoted(&format!("{}={text}", self.role)),
                    self.role
                );
                self.question(what, &units::names(self.role))
            });
        }
        if self.role.quantity() == Role::Time
            && let Some(unit) = self.stamp()?
        {
            return Ok(unit);
        }
        if let Some(unit) = self.by_metadata() {
            return Ok(unit);
        }
        if let Some(text) = &self.table.columns[self.column].unit {
            return units::unit(self.role, text).ok_or_else(|| {
                if Role::READINGS.contains(&self.role) && matches!(text.to_lowercase().as_str(), "v" | "mv") {
                    let what = "volts are not read: make a column of ohms of them first (of a divider, with the sensor at \
                                ground: R_ref·V/(V_supply − V)), or take the converter's codes, --column adc=NAME";
                    return ImportError::unreadable(&self.table.file, format!("{}: {what}", self.name()));
                }
                let convert = if units::scale_of_a_reference(self.role).is_some() { "" } else { ": convert it first" };
                let what = format!("{}: the unit `{text}` is none of {}{convert}", self.name(), self.role);
                self.question(what, &units::names(self.role))
            });
        }
        self.by_numbers(remarks)
    }

    fn name(&self) -> String {
        format!("column {}", name(self.table, self.column))
    }

    fn question(&self, what: String, names: &[&str]) -> ImportError {
        let scale = units::scale_of_a_reference(self.role);
        let answers = names.iter().map(|unit| format!("--unit {}={unit}", self.role));
        let of_scale = scale.map(|scale| format!("--unit {}={scale} if 1 V is that much", self.role));
        ImportError::question(&self.table.file, what, of_scale.into_iter().chain(answers))
    }

    /// What a line `# strain_unit = …` or `# resistance_unit = …` says, whatever the column is called.
    fn by_metadata(&self) -> Option<Unit> {
        let metadata = &self.table.metadata;
        let name = match self.role {
            Role::Strain => metadata.strain_unit?.name(),
            Role::Resistance => metadata.resistance_unit?.name(),
            _ => return None,
        };
        units::unit(self.role, name)
    }

    /// Dates and times of day.
    fn stamp(&self) -> Result<Option<Unit>, ImportError> {
        let cells = &self.table.columns[self.column].cells;
        let missing = |cell: &&str| !crate::import::number::is_missing(cell, &[]);
        let filled: Vec<&str> = cells.iter().filter(missing).collect();
        let orders = orders(filled.iter().copied());
        let order = match orders[..] {
            [] => return Ok(None),
            [order @ Order::Iso, ..] | [order] => order,
            _ if filled.iter().all(|cell| has_points(cell)) => Order::Dmy,
            // On one day it does not matter which number is the month.
            _ if one_day(&filled) => Order::Dmy,
            _ => {
                let what = format!("{}: day and month cannot be told apart", self.name());
                return Err(self.question(what, &[Order::Dmy, Order::Mdy].map(Order::unit)));
            }
        };
        Ok(units::unit(Role::Time, order.unit()))
    }

    /// A unit that names or numbers leave no doubt of; otherwise a question.
    fn by_numbers(&self, remarks: &mut Vec<String>) -> Result<Unit, ImportError> {
        let known = |name| units::unit(self.role, name);
        let column = &self.table.columns[self.column];
        if let Some(end) = doubtful_unit(self.role, &column.heading) {
            let what = format!("{} ({}): `{end}` may be a unit or a part of the name", self.name(), self.role);
            return Err(self.question(what, &self.numeric_units()));
        }
        let numbers: Vec<f64> =
            column.cells.iter().filter_map(|cell| number(cell.trim(), self.table.layout.decimal, 0)).collect();
        let (unit, why) = match self.role {
            Role::Time | Role::ReferenceTime => {
                // `millis` and `micros` name the unit.
                let is_counted = |unit: &Unit| unit.scale != Scale::Stamp && column.name.len() > 1;
                if let Some(unit) = known(&column.name).filter(is_counted) {
                    return Ok(unit);
                }
                let step = median(numbers.windows(2).map(|pair| pair[1] - pair[0]).collect()).unwrap_or(f64::NAN);
                let has_fractions = numbers.iter().any(|number| number.fract() != 0.0);
                let seconds = has_fractions && (SHORTEST_STEP_S..=LONGEST_STEP_S).contains(&step);
                (seconds.then_some("s"), format!("steps of {step:.3}"))
            }
            // What has a unit in each cell has it there.
            Role::Resistance if let Some(cell) = self.prefixed() => (Some("ohm"), format!("cells such as {cell} have")),
            Role::Resistance => {
                let middle = median(numbers.iter().map(|number| number.abs()).collect()).unwrap_or(f64::NAN);
                ((middle >= LEAST_OHM).then_some("ohm"), format!("about {middle:.0}"))
            }
            Role::Strain => {
                let largest = numbers.iter().fold(0.0, |largest: f64, number| largest.max(number.abs()));
                ((largest <= 1.0).then_some("1"), format!("up to {largest:.3}"))
            }
            Role::Ratio => {
                let middle = median(numbers).unwrap_or(f64::NAN);
                let unit = if (0.5..20.0).contains(&middle) && self.is_ratio() { Some("1") } else { None };
                (unit, format!("about {middle:.3}"))
            }
            Role::Adc => return known("1").ok_or_else(|| self.question(self.name(), &["1"])),
            Role::Displacement | Role::Angle | Role::Temperature => (None, String::new()),
        };
        let Some(unit) = unit.and_then(known) else {
            let what = format!("{} ({}): its unit is not known", self.name(), self.role);
            return Err(self.question(what, &self.numeric_units()));
        };
        remarks.push(format!("{}: {} has no unit; {why}: taken for `{}`", self.table.file, self.name(), unit.name));
        Ok(unit)
    }

    /// Units of numbers.
    fn numeric_units(&self) -> Vec<&'static str> {
        let mut names = units::names(self.role);
        names.retain(|name| units::unit(self.role, name).is_some_and(|unit| unit.scale != Scale::Stamp));
        names
    }

    /// A cell with a unit of its own.
    fn prefixed(&self) -> Option<String> {
        let decimal = self.table.layout.decimal;
        let mut cells = self.table.columns[self.column].cells.iter();
        cells.find(|cell| ohms(cell.trim(), decimal).is_some()).map(quote)
    }

    /// `R/R0` is a ratio; `dR/R0` is a change.
    fn is_ratio(&self) -> bool {
        let name = self.table.columns[self.column].name.to_lowercase();
        !name.starts_with(['d', 'δ']) && !name.contains("change")
    }
}

/// Whether all dates are the same text.
fn one_day(stamps: &[&str]) -> bool {
    fn date(stamp: &str) -> &str {
        stamp.trim().split(['T', ' ']).next().unwrap_or_default()
    }
    stamps.windows(2).all(|pair| date(pair[0]) == date(pair[1]))
}
