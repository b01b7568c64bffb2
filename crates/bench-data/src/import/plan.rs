use std::collections::BTreeSet;

use crate::error::Fault;
use crate::import::candidates::{candidates, choose, find, refer};
use crate::import::channel::{Channel, name};
use crate::import::clock::Clock;
use crate::import::error::ImportError;
use crate::import::names;
use crate::import::plan_clock::{clock, no_readings};
use crate::import::plan_units::channel;
use crate::import::preset::Preset;
use crate::import::questions::quoted;
use crate::import::recipe::{Align, PerFile, Recipe};
use crate::import::records::SEPARATOR;
use crate::import::roles::Role;
use crate::import::series::alternation;
use crate::import::table::Table;
use crate::import::units::{SCALED, scale_of_a_reference};

/// Signs are arbitrary where a larger share of the readings than this is negative.
const FEW_SIGNS: f64 = 0.1;

/// An import with nothing left open.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub(crate) recipe: Recipe,
    pub(crate) given: Recipe,
    pub(crate) readings: Channel,
    pub(crate) time: Clock,
    pub(crate) reference: Option<(Channel, Clock)>,
    pub(crate) temperature: Option<Channel>,
    /// What follows from names or numbers, and is not said by a flag.
    pub remarks: Vec<String>,
}

impl Plan {
    /// Decides all that the recipe leaves open, by names, units and numbers.
    ///
    /// # Errors
    /// [`ImportError::Question`] for the first thing that nothing decides.
    pub fn new(tables: &[Table], given: &Recipe) -> Result<Self, ImportError> {
        let recipe = given.completed();
        check_decimal(tables)?;
        let mut remarks = Vec::new();
        let readings = choose(tables, &recipe, &Role::READINGS, "the readings")?.ok_or_else(|| no_readings(tables))?;
        let time = clock(tables, &recipe, (Role::Time, readings.1, readings.2), &mut remarks)?;
        let readings = channel(tables, &recipe, readings, &mut remarks)?;
        let reference = match choose(tables, &recipe, &Role::REFERENCES, "the reference")? {
            None => {
                remarks.extend(no_reference(tables, &recipe));
                None
            }
            Some(place) => {
                let (_, table, column) = place;
                // The readings' clock is in other hands where there is a column beside the reference or another file.
                let own = clock(tables, &recipe, (Role::ReferenceTime, table, column), &mut remarks)?;
                Some((channel(tables, &recipe, place, &mut remarks)?, own))
            }
        };
        let temperature = temperature(tables, &recipe, readings.table, &mut remarks)?;
        // What two columns, or two roles of one, share is said once.
        let mut said = BTreeSet::new();
        remarks.retain(|remark: &String| said.insert(remark.clone()));
        let plan = Self { recipe, given: given.clone(), readings, time, reference, temperature, remarks };
        plan.channels().iter().try_for_each(|channel| check_records(&tables[channel.table], channel.column))?;
        plan.check(tables)?;
        Ok(plan)
    }

    /// The plan for what `inspect` proposes: beside what [`new`](Self::new) decides, a preset that fits, signs that are
    /// arbitrary, polarity that flips, and clocks of two files that the motion brings together.
    ///
    /// # Errors
    /// [`ImportError::Question`] for the first thing that nothing decides.
    pub fn propose(tables: &[Table], given: &Recipe) -> Result<Self, ImportError> {
        let mut recipe = given.clone();
        if recipe.preset.is_none() && recipe.columns.is_empty() && tables.len() == 1 {
            recipe.preset = Preset::that_fits(&tables[0]);
        }
        if recipe.preset.is_some() {
            return Self::new(tables, &recipe);
        }
        if tables.len() > 1 && recipe.align.is_none() {
            recipe.align = Some(Align::Motion);
        }
        let mut plan = Self::new(tables, &recipe)?;
        let values =
            crate::import::channel::Values::read(&tables[plan.readings.table], &plan.readings, &recipe.missing)?;
        let known = values.values.iter().filter(|value| !value.is_nan()).count();
        let negative = values.values.iter().filter(|value| **value < 0.0).count();
        // A few, such as -999, mean something else: a question.
        if plan.readings.role == Role::Resistance
            && negative as f64 > FEW_SIGNS * known as f64
            && !recipe.magnitude.contains(&Role::Resistance)
        {
            recipe.magnitude.push(Role::Resistance);
            plan = Self::new(tables, &recipe)?;
        }
        if alternation(&values.values.iter().map(|value| value.abs()).collect::<Vec<_>>()).is_some()
            && !recipe.fold_polarity
        {
            recipe.fold_polarity = true;
            plan = Self::new(tables, &recipe)?;
        }
        Ok(plan)
    }

    /// The recipe that says all of this plan by flags.
    #[must_use]
    pub fn recipe(&self, tables: &[Table]) -> Recipe {
        if self.given.preset.is_some() {
            return self.given.clone();
        }
        let mut out = Recipe { columns: Vec::new(), units: Vec::new(), ..self.given.clone() };
        for channel in &self.channels() {
            out.columns.push((channel.role, refer(tables, (channel.table, channel.column))));
            out.units.push((channel.role, self.unit_text(channel).to_owned()));
        }
        // What is to be left out stays so.
        out.columns.extend(self.given.columns.iter().filter(|(_, name)| name.is_none()).cloned());
        for (index, table) in tables.iter().enumerate() {
            let file = (tables.len() > 1).then_some(index + 1);
            let (layout, options) = (&table.layout, self.given.read_options(index));
            let says_mark = layout.decimal != crate::import::number::DecimalMark::Point || layout.has_groups;
            if options.decimal.is_none() && says_mark {
                out.decimal.push(PerFile { file, value: layout.decimal });
            }
            if options.skip.is_none() && layout.skip > 0 {
                out.skip.push(PerFile { file, value: layout.skip });
            }
        }
        out
    }

    /// Whether readings and reference stand in the same rows with the same times.
    pub(crate) fn is_one_clock(&self) -> bool {
        let same = |own: &Clock| match (own, &self.time) {
            (Clock::Column(a), Clock::Column(b)) => (a.table, a.column) == (b.table, b.column),
            (a, b) => a == b,
        };
        self.reference.as_ref().is_none_or(|(_, own)| same(own))
    }

    /// The columns that something is taken from.
    fn channels(&self) -> Vec<Channel> {
        let column = |clock: &Clock| match clock {
            Clock::Column(channel) => Some(*channel),
            Clock::Rate { .. } => None,
        };
        let mut all: Vec<Channel> = column(&self.time).into_iter().chain([self.readings]).collect();
        if let Some((reference, own)) = &self.reference {
            let own = column(own).filter(|_| !self.is_one_clock());
            all.extend(own.map(|own| Channel { role: Role::ReferenceTime, ..own }));
            all.push(*reference);
        }
        all.extend(self.temperature);
        all
    }

    /// The column that a role was given, as messages call it, with its file and unit.
    #[must_use]
    pub fn columns(&self, tables: &[Table]) -> Vec<(Role, usize, usize, String, &str)> {
        let describe =
            |of: &Channel| (of.role, of.table, of.column, name(&tables[of.table], of.column), self.unit_text(of));
        self.channels().iter().map(describe).collect()
    }

    /// The unit as flags have it.
    fn unit_text(&self, channel: &Channel) -> &str {
        match channel.unit.name {
            SCALED => self.recipe.unit(channel.role).unwrap_or(SCALED),
            name => name,
        }
    }

    fn check(&self, tables: &[Table]) -> Result<(), ImportError> {
        let files = || tables.iter().map(|table| table.file.as_str()).collect::<Vec<_>>().join(", ");
        let Some((reference, own)) = &self.reference else {
            return self.check_front_end(tables);
        };
        if own.table() != self.time.table() && self.recipe.align.is_none() {
            let what = "two files with two clocks";
            let answers = ["motion", "none", "SECONDS"].map(|align| format!("--align {align}"));
            return Err(ImportError::question(&files(), what, answers));
        }
        let gauge = self.recipe.gauge_length_mm.or(tables[reference.table].metadata.gauge_length_mm);
        if reference.role == Role::Displacement && gauge.is_none() {
            let what = "a displacement becomes strain by the length of the unstretched sensor";
            let answer = "--gauge-length-mm MM".to_owned();
            return Err(ImportError::question(&tables[reference.table].file, what, [answer]));
        }
        self.check_front_end(tables)
    }

    fn check_front_end(&self, tables: &[Table]) -> Result<(), ImportError> {
        let table = &tables[self.readings.table];
        if self.readings.role == Role::Adc && self.recipe.front_end.or(table.metadata.front_end).is_none() {
            let spec = quoted("divider reference_ohm=10000 side=low bits=12 noise_codes=0.5");
            let what = "converter codes become ohms by the electronics";
            return Err(ImportError::question(&table.file, what, [format!("--front-end {spec} (or what is there)")]));
        }
        Ok(())
    }
}

/// Refuses a label that is not in every other record of its file: what the records are has not been understood.
fn check_records(table: &Table, column: usize) -> Result<(), ImportError> {
    let cells = &table.columns[column].cells;
    let missing = cells.iter().filter(|cell| cell.is_empty()).count();
    if table.layout.separator != Some(SEPARATOR) || missing * 2 < table.len() {
        return Ok(());
    }
    let first = cells.iter().position(str::is_empty).map_or(1, |row| table.lines[row]);
    let expected = format!("{} in every record, which ends where one of its labels comes again", name(table, column));
    let found = format!("none in {missing} of {}: print all values of a moment together", table.len());
    Err(ImportError::content(&table.file, first, Fault::new(expected, found)))
}

/// What there is to say where no column is the reference, and nobody has said that none is.
fn no_reference(tables: &[Table], recipe: &Recipe) -> Option<String> {
    if Role::REFERENCES.iter().any(|role| recipe.column(*role).is_some()) {
        return None;
    }
    let weak = candidates(tables).into_iter().find(|found| Role::REFERENCES.contains(&found.role));
    let weak = weak.map(|found| (found.role, (found.table, found.column), None));
    let (role, column, scale) = weak
        .or_else(|| in_another_unit(tables))
        .map_or((Role::Strain, "NAME".to_owned(), None), |(role, place, scale)| {
            (role, refer(tables, place).to_string(), scale)
        });
    let scale = scale.map_or_else(String::new, |scale| format!(" --unit {role}={scale} with its scale"));
    let answer = quoted(&format!("{role}={column}")) + &scale;
    let files: Vec<&str> = tables.iter().map(|table| table.file.as_str()).collect();
    Some(format!(
        "{}: no column is taken for strain, displacement or angle, without which nothing can be calibrated; if one is, say \
         --column {answer}",
        files.join(", ")
    ))
}

/// A column that is called as a reference is, but has the unit of something else: `Position (V)`.
fn in_another_unit(tables: &[Table]) -> Option<(Role, (usize, usize), Option<&'static str>)> {
    let places = tables.iter().enumerate().flat_map(|(table, of)| (0..of.columns.len()).map(move |at| (table, at)));
    places.into_iter().find_map(|(table, at)| {
        let column = &tables[table].columns[at];
        let (role, _) = names::role(&column.name, None).filter(|_| column.unit.is_some())?;
        scale_of_a_reference(role).map(|scale| (role, (table, at), Some(scale)))
    })
}

/// Point or comma?
fn check_decimal(tables: &[Table]) -> Result<(), ImportError> {
    let open = tables.iter().enumerate().find(|(_, table)| table.layout.decimal_is_open);
    let Some((index, table)) = open else { return Ok(()) };
    let file = if tables.len() > 1 { format!("{}:", index + 1) } else { String::new() };
    let what = "commas may be decimal marks or group thousands";
    Err(ImportError::question(&table.file, what, [",", "."].map(|mark| format!("--decimal {file}{mark}"))))
}

/// A temperature counts if it stands in the readings' file.
fn temperature(
    tables: &[Table],
    recipe: &Recipe,
    table: usize,
    remarks: &mut Vec<String>,
) -> Result<Option<Channel>, ImportError> {
    let place = match recipe.column(Role::Temperature) {
        Some(None) => None,
        Some(Some(wanted)) => Some(find(tables, Role::Temperature, wanted)?),
        None => {
            let mut found = candidates(tables);
            found.retain(|found| found.role == Role::Temperature && found.table == table && found.is_named);
            match found[..] {
                [one] if tables[table].columns[one.column].unit.is_some() => Some((table, one.column)),
                _ => None,
            }
        }
    };
    let Some((found, column)) = place else { return Ok(None) };
    if found != table {
        let what = "a temperature is taken from the file of the readings";
        return Err(ImportError::question(&tables[found].file, what, ["--column temperature=none".to_owned()]));
    }
    channel(tables, recipe, (Role::Temperature, found, column), remarks).map(Some)
}
