use crate::import::error::{ImportError, quoted};
use crate::import::roles::decision::{Channel, Taken};
use crate::import::roles::facts::{Dates, Facts, Found};
use crate::import::roles::recipe::Recipe;
use crate::import::table::{Column, Table};
use crate::import::words::Role;
use crate::import::words::names::doubtful_unit;
use crate::import::words::stamp::Order;
use crate::import::words::units::{self, Scale, Unit};

/// Steps of times with fractions are taken for seconds up to this, s: slower than that, they may be milliseconds.
const LONGEST_STEP_S: f64 = 2.0;
/// Shorter steps are no seconds: days, perhaps.
const SHORTEST_STEP_S: f64 = 1e-5;
/// A resistance without a unit is taken for ohms from this on.
const LEAST_OHM: f64 = 10.0;

/// The channel of a column, its unit found or asked. What follows from the numbers is remarked.
pub(crate) fn channel(
    found: &Found,
    answers: &Recipe,
    Taken { role, place }: Taken,
    remarks: &mut Vec<String>,
) -> Result<Channel, ImportError> {
    let (table, column) = (found.table(place), found.column(place));
    let name = format!("column {}", found.name(place));
    let unit = Asked { table, column, facts: &|| found.facts(place), role, name }.unit(answers, remarks)?;
    Ok(Channel { role, place, unit })
}

/// A column whose unit is asked.
struct Asked<'a> {
    table: &'a Table,
    column: &'a Column,
    facts: &'a dyn Fn() -> &'a Facts,
    role: Role,
    /// How messages call it.
    name: String,
}

impl Asked<'_> {
    fn unit(&self, answers: &Recipe, remarks: &mut Vec<String>) -> Result<Unit, ImportError> {
        if let Some(text) = answers.unit(self.role) {
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
            && let Some(unit) = self.dates()?
        {
            return Ok(unit);
        }
        if let Some(unit) = self.by_metadata() {
            return Ok(unit);
        }
        if let Some(text) = &self.column.unit {
            return units::unit(self.role, text).ok_or_else(|| {
                if Role::READINGS.contains(&self.role) && matches!(text.to_lowercase().as_str(), "v" | "mv") {
                    let what = "volts are not read: make a column of ohms of them first (of a divider, with the sensor at \
                                ground: R_ref·V/(V_supply − V)), or take the converter's codes, --column adc=NAME";
                    return ImportError::unreadable(&self.table.file, format!("{}: {what}", self.name));
                }
                let convert = if units::scale_of_a_reference(self.role).is_some() { "" } else { ": convert it first" };
                let what = format!("{}: the unit `{text}` is none of {}{convert}", self.name, self.role);
                self.question(what, &units::names(self.role))
            });
        }
        self.by_numbers(remarks)
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
    fn dates(&self) -> Result<Option<Unit>, ImportError> {
        match (self.facts)().dates {
            Dates::None => Ok(None),
            Dates::In(order) => Ok(units::unit(Role::Time, order.unit())),
            Dates::Open => {
                let what = format!("{}: day and month cannot be told apart", self.name);
                Err(self.question(what, &[Order::Dmy, Order::Mdy].map(Order::unit)))
            }
        }
    }

    /// A unit that names or numbers leave no doubt of; otherwise a question.
    fn by_numbers(&self, remarks: &mut Vec<String>) -> Result<Unit, ImportError> {
        let known = |name| units::unit(self.role, name);
        if let Some(end) = doubtful_unit(self.role, &self.column.heading) {
            let what = format!("{} ({}): `{end}` may be a unit or a part of the name", self.name, self.role);
            return Err(self.question(what, &self.numeric_units()));
        }
        let numbers = &(self.facts)().numbers;
        let (unit, why) = match self.role {
            Role::Time | Role::ReferenceTime => {
                // `millis` and `micros` name the unit.
                let is_counted = |unit: &Unit| unit.scale != Scale::Stamp && self.column.name.len() > 1;
                if let Some(unit) = known(&self.column.name).filter(is_counted) {
                    return Ok(unit);
                }
                let seconds = numbers.has_fractions && (SHORTEST_STEP_S..=LONGEST_STEP_S).contains(&numbers.step);
                (seconds.then_some("s"), format!("steps of {:.3}", numbers.step))
            }
            // What has a unit in each cell has it there.
            Role::Resistance if let Some(cell) = &(self.facts)().prefixed => {
                (Some("ohm"), format!("cells such as {cell} have"))
            }
            Role::Resistance => ((numbers.size >= LEAST_OHM).then_some("ohm"), format!("about {:.0}", numbers.size)),
            Role::Strain => ((numbers.largest <= 1.0).then_some("1"), format!("up to {:.3}", numbers.largest)),
            Role::Ratio => {
                let is_ratio = (0.5..20.0).contains(&numbers.median) && self.is_ratio();
                (is_ratio.then_some("1"), format!("about {:.3}", numbers.median))
            }
            Role::Adc => return known("1").ok_or_else(|| self.question(self.name.clone(), &["1"])),
            Role::Displacement | Role::Angle | Role::Temperature => (None, String::new()),
        };
        let Some(unit) = unit.and_then(known) else {
            let what = format!("{} ({}): its unit is not known", self.name, self.role);
            return Err(self.question(what, &self.numeric_units()));
        };
        remarks.push(format!("{}: {} has no unit; {why}: taken for `{}`", self.table.file, self.name, unit.name));
        Ok(unit)
    }

    /// Units of numbers.
    fn numeric_units(&self) -> Vec<&'static str> {
        let mut names = units::names(self.role);
        names.retain(|name| units::unit(self.role, name).is_some_and(|unit| unit.scale != Scale::Stamp));
        names
    }

    /// `R/R0` is a ratio; `dR/R0` is a change.
    fn is_ratio(&self) -> bool {
        let name = self.column.name.to_lowercase();
        !name.starts_with(['d', 'δ']) && !name.contains("change")
    }
}
