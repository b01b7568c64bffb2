use crate::import::error::{ImportError, quoted};
use crate::import::roles::decision::{Channel, Taken};
use crate::import::roles::facts::{Dates, Facts, Found};
use crate::import::roles::recipe::Recipe;
use crate::import::table::{Column, Table};
use crate::import::words::Role;
use crate::import::words::kinds::{self, is_change, is_conductance, is_difference};
use crate::import::words::names::{doubtful_unit, unit_within};
use crate::import::words::stamp::Order;
use crate::import::words::units::{self, Scale, Unit};

/// Longest step, s, at which times with fractions count as seconds; with longer steps, they may be milliseconds.
const LONGEST_STEP_S: f64 = 2.0;
/// Shortest step, s, at which times count as seconds; with shorter steps, they may be days.
const SHORTEST_STEP_S: f64 = 1e-5;
/// Least median, Ω, at which a resistance without a unit counts as ohms.
const LEAST_OHM: f64 = 10.0;

/// Finds the channel of a column; its unit is inferred, or becomes a question. Conclusions from the numbers become
/// remarks.
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

/// Column whose unit is in question.
struct Asked<'a> {
    table: &'a Table,
    column: &'a Column,
    facts: &'a dyn Fn() -> &'a Facts,
    role: Role,
    /// Name in messages.
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
                self.question(what, &self.role.units())
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
        if self.role == Role::Resistance && is_difference(&self.column.name) {
            let what = "a change of resistance is not read: add the resistance at rest first, or take R or R/R0";
            return Err(ImportError::unreadable(&self.table.file, format!("{}: {what}", self.name)));
        }
        let own = self.column.unit.clone().filter(|unit| !self.is_pin(unit));
        if let Some(text) = &own.or_else(|| unit_within(self.role, &self.column.heading)) {
            self.refuse_large_ratio(text)?;
            self.refuse_formatted_percent(text)?;
            return units::unit(self.role, text).ok_or_else(|| {
                if Role::READINGS.contains(&self.role) && matches!(text.to_lowercase().as_str(), "v" | "mv") {
                    let what = "volts are not read: make a column of ohms of them first (of a divider, with the sensor at \
                                ground: R_ref·V/(V_supply − V)), or take the converter's codes, --column adc=NAME";
                    return ImportError::unreadable(&self.table.file, format!("{}: {what}", self.name));
                }
                let convert = if units::scale_of_a_reference(self.role).is_some() { "" } else { ": convert it first" };
                let what = format!("{}: the unit `{text}` is none of {}{convert}", self.name, self.role);
                self.question(what, &self.role.units())
            });
        }
        self.by_numbers(remarks)
    }

    /// True if the brackets after the name of codes contain their pin: `analogRead(A0)`.
    fn is_pin(&self, unit: &str) -> bool {
        self.role == Role::Adc && !units::is_unit(unit)
    }

    /// Refuses `R/R0 (%)` with a large median: it may be percent of the resistance at rest, or of its change.
    fn refuse_large_ratio(&self, unit: &str) -> Result<(), ImportError> {
        const LARGE: f64 = 50.0;
        let is_percent = units::unit(self.role, unit).is_some_and(|unit| unit.name == "change-percent");
        if self.role != Role::Ratio
            || !is_percent
            || is_change(&self.column.name)
            || (self.facts)().numbers.median < LARGE
        {
            return Ok(());
        }
        let what = format!("{}: percent of the resistance at rest, or of its change", self.name);
        Err(self.question(what, &["percent", "change-percent"]))
    }

    /// Refuses percent in a workbook whose numbers are at most one: cells that are formatted as percent contain fractions.
    fn refuse_formatted_percent(&self, unit: &str) -> Result<(), ImportError> {
        let is_percent =
            self.role == Role::Strain && units::unit(self.role, unit).is_some_and(|unit| unit.name == "percent");
        let largest = (self.facts)().numbers.largest;
        if !is_percent || !self.table.layout.format.contains("workbook") || largest > 1.0 {
            return Ok(());
        }
        let what = format!(
            "{}: up to {largest:.3}, which may be percent, or fractions that the workbook shows as percent",
            self.name
        );
        Err(self.question(what, &["percent", "1"]))
    }

    fn question(&self, what: String, names: &[&str]) -> ImportError {
        let scale = units::scale_of_a_reference(self.role);
        let answers = names.iter().map(|unit| format!("--unit {}={unit}", self.role));
        let of_scale = scale.map(|scale| format!("--unit {}={scale} if 1 V is that much", self.role));
        ImportError::question(&self.table.file, what, of_scale.into_iter().chain(answers))
    }

    /// Returns the unit of a line `# strain_unit = …` or `# resistance_unit = …`, whatever the column's name.
    fn by_metadata(&self) -> Option<Unit> {
        let metadata = &self.table.metadata;
        let name = match self.role {
            Role::Strain => metadata.strain_unit?.name(),
            Role::Resistance => metadata.resistance_unit?.name(),
            _ => return None,
        };
        units::unit(self.role, name)
    }

    /// Returns the unit of a column of dates or times of day.
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

    /// Returns the unit if names or numbers leave no doubt; otherwise a question.
    fn by_numbers(&self, remarks: &mut Vec<String>) -> Result<Unit, ImportError> {
        let known = |name| units::unit(self.role, name);
        if let Some(end) = doubtful_unit(self.role, &self.column.heading) {
            let what = format!("{} ({}): `{end}` may be a unit or a part of the name", self.name, self.role);
            return Err(self.question(what, &self.numeric_units()));
        }
        if self.role == Role::Resistance && is_conductance(&self.column.name) {
            let what = format!("{} ({}): its unit is not known, and R = 1/G", self.name, self.role);
            return Err(self.question(what, &["S", "mS", "uS", "nS"]));
        }
        let numbers = &(self.facts)().numbers;
        let (unit, why) = match self.role {
            Role::Time | Role::ReferenceTime => {
                // `millis` and `micros` state the unit.
                let is_counted = |unit: &Unit| unit.scale != Scale::Stamp && self.column.name.len() > 1;
                if let Some(unit) = known(&self.column.name).filter(is_counted) {
                    return Ok(unit);
                }
                let seconds = numbers.has_fractions && (SHORTEST_STEP_S..=LONGEST_STEP_S).contains(&numbers.step);
                match units::epoch_unit(numbers.median, numbers.step).filter(|_| !seconds) {
                    Some(unit) => (Some(unit), format!("about {:.0}, a time since 1970", numbers.median)),
                    None => (seconds.then_some("s"), format!("steps of {:.3}", numbers.step)),
                }
            }
            Role::Resistance => match &(self.facts)().prefixed {
                // Cells with units of their own determine it.
                Some(cell) => (Some("ohm"), format!("cells such as {cell} have")),
                None => ((numbers.size >= LEAST_OHM).then_some("ohm"), format!("about {:.0}", numbers.size)),
            },
            Role::Strain if is_stretch_ratio(self.column, (self.facts)()) => {
                (Some("1"), format!("about {:.3}, a stretch ratio", numbers.median))
            }
            Role::Strain => ((numbers.largest <= 1.0).then_some("1"), format!("up to {:.3}", numbers.largest)),
            Role::Ratio => {
                let is_ratio = (0.5..20.0).contains(&numbers.median) && !is_change(&self.column.name);
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

    /// Returns the units that numbers of this role may have.
    fn numeric_units(&self) -> Vec<&'static str> {
        let mut names = self.role.units();
        names.retain(|name| units::unit(self.role, name).is_some_and(|unit| unit.scale != Scale::Stamp));
        names
    }
}

/// True if a column contains lengths relative to that at rest: by its name, and by numbers around one.
pub(crate) fn is_stretch_ratio(column: &Column, facts: &Facts) -> bool {
    const USUAL: std::ops::Range<f64> = 0.8..20.0;
    kinds::is_stretch_ratio(&column.name) && USUAL.contains(&facts.numbers.median) && facts.numbers.least > 0.0
}
