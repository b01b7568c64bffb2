//! All channels of files at once: a column of readings for each, with its reference.

use std::io::{self, Write};

use crate::columns::Column;
use crate::import::error::{ImportError, quoted};
use crate::import::roles::{ColumnName, FileColumn, Recipe, candidates, refer};
use crate::import::table::Table;
use crate::import::trace::{Imported, Plan};
use crate::import::words::{Role, names};
use crate::metadata::Metadata;
use crate::rows::RowWriter;

/// Import of several channels.
#[derive(Clone, Debug, PartialEq)]
pub struct EachPlan {
    channels: Vec<PlannedChannel>,
}

#[derive(Clone, Debug, PartialEq)]
struct PlannedChannel {
    /// Name in the columns of the recording, without a unit.
    name: String,
    plan: Plan,
}

/// A recording of several channels on one clock.
#[derive(Clone, Debug, PartialEq)]
pub struct EachTrace {
    /// Metadata of all of them.
    pub metadata: Metadata,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Their values, row by row; NaN is a missing one.
    pub values: Vec<Vec<f64>>,
    /// Remarks on what was left out, filled in or noticed, one line each.
    pub remarks: Vec<String>,
}

impl EachPlan {
    /// Decides which columns are readings: those that `given` names, or all that look like readings of one kind. Also decides on the
    /// reference of each: one of `pairs`, one whose name has the same stem (`Thumb angle` beside `Thumb`, `theta1` beside `R1`), or the
    /// only one.
    ///
    /// # Errors
    /// [`ImportError::Question`] for the first open question, and if there are fewer than two channels.
    pub fn new(tables: &[Table], given: &Recipe, pairs: &[(ColumnName, ColumnName)]) -> Result<Self, ImportError> {
        let readings = readings(tables, given);
        if readings.len() < 2 {
            let what = format!("expected two or more columns of readings for --each, found {}", readings.len());
            let file = tables.first().map_or("import", |table| &table.file);
            return Err(ImportError::question(file, what, ["--column resistance=COLUMN for each of them".to_owned()]));
        }
        let mut plans = Vec::with_capacity(readings.len());
        for (role, reading) in &readings {
            let is_reading = |(other, _): &&(Role, ColumnName)| !Role::READINGS.contains(other);
            let mut columns: Vec<(Role, ColumnName)> = given.columns.iter().filter(is_reading).cloned().collect();
            columns.push((*role, reading.clone()));
            if let Some((_, reference)) = pairs.iter().find(|(of, _)| of == reading) {
                columns.retain(|(other, _)| !Role::REFERENCES.contains(other));
                columns.push((reference_role(tables, reference)?, reference.clone()));
            }
            let plan = Plan::new(tables, &Recipe { columns, ..given.clone() });
            let plan = plan.map_err(|error| paired(error, reading))?;
            if plan.reference().is_none() {
                unreferenced(tables, given, reading)?;
            }
            plans.push(plan);
        }
        let named = names_of(tables, &plans).into_iter().zip(plans);
        Ok(Self { channels: named.map(|(name, plan)| PlannedChannel { name, plan }).collect() })
    }

    /// True if all channels have the same reference, or none has any.
    fn is_shared(&self) -> bool {
        let first = self.channels.first().and_then(|channel| channel.plan.reference());
        self.channels.iter().all(|channel| channel.plan.reference() == first)
    }

    /// True if each channel has its own reference, as with several joints.
    #[must_use]
    pub fn are_joints(&self) -> bool {
        let references: Vec<Option<FileColumn>> =
            self.channels.iter().map(|channel| channel.plan.reference()).collect();
        let is_own = |(place, one): (usize, &Option<FileColumn>)| one.is_some() && !references[..place].contains(one);
        references.iter().enumerate().all(is_own)
    }

    /// Returns the chosen columns by their names in messages: name, reading, reference.
    #[must_use]
    pub fn columns(&self, tables: &[Table]) -> Vec<(String, String, Option<String>)> {
        let heading = |place: FileColumn| tables[place.file].name(place.column);
        let of = |channel: &PlannedChannel| {
            let reference = channel.plan.reference().map(heading);
            (channel.name.clone(), heading(channel.plan.readings().place), reference)
        };
        self.channels.iter().map(of).collect()
    }

    /// Splits a file into its recordings, as [`Plan::recordings`] does.
    ///
    /// # Errors
    /// As there.
    pub fn recordings(&self, tables: &[Table]) -> Result<Vec<Vec<Table>>, ImportError> {
        self.channels.first().map_or_else(|| Ok(vec![tables.to_vec()]), |first| first.plan.recordings(tables))
    }

    /// Makes the recording, with remarks on the conversion.
    ///
    /// # Errors
    /// As [`Plan::import`], and if the channels do not share their rows.
    pub fn import(&self, tables: &[Table]) -> Result<EachTrace, ImportError> {
        let mut imported = Vec::with_capacity(self.channels.len());
        for channel in &self.channels {
            imported.push(channel.plan.import(tables)?);
        }
        let time_s = imported[0].trace.time_s.clone();
        if let Some(other) = imported.iter().position(|other| other.trace.time_s != time_s) {
            let (one, other) = (&self.channels[0].name, &self.channels[other].name);
            let what = format!("`{one}` and `{other}` have rows of their own: import each by itself, with --column");
            return Err(ImportError::unreadable(&tables[0].file, what));
        }
        let mut remarks: Vec<String> = Vec::new();
        let mut metadata = imported[0].trace.metadata.clone();
        // Zeros that were taken from columns differ between the channels.
        metadata.other.retain(|(key, _)| key != "made_by" && !key.ends_with("_zero"));
        let (mut columns, mut values) = (vec!["time_s".to_owned()], vec![time_s]);
        for (channel, Imported { trace, remarks: own, .. }) in self.channels.iter().zip(&imported) {
            // A resistance is `_ohm` or `_ratio`, a code `_adc`.
            let unit = trace.readings.column().name().trim_start_matches("resistance_");
            columns.push(format!("{}_{unit}", channel.name));
            values.push((0..trace.len()).map(|row| trace.readings.written(row)).collect());
            remarks.extend(own.iter().filter(|remark| !remarks.contains(remark)).cloned().collect::<Vec<_>>());
        }
        let temperature_c = imported[0].trace.temperature_c.take();
        for (channel, Imported { trace, .. }) in self.channels.iter().zip(imported) {
            let Some(reference) = trace.reference else { continue };
            let quantity = Column::of_reference(reference.quantity).name();
            columns.push(if self.is_shared() { quantity.to_owned() } else { format!("{}_{quantity}", channel.name) });
            values.push(reference.values);
            if self.is_shared() {
                break;
            }
        }
        if let Some(temperature_c) = temperature_c {
            columns.push(Column::TemperatureC.name().to_owned());
            values.push(temperature_c);
        }
        Ok(EachTrace { metadata, columns, values, remarks })
    }
}

impl EachTrace {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values[0].len()
    }

    /// True if there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Writes metadata lines, header and rows.
    ///
    /// # Errors
    /// The error of `out`.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write!(out, "{}", self.metadata)?;
        let mut rows = RowWriter::new(io::BufWriter::new(out));
        self.columns.iter().for_each(|name| rows.text(name));
        rows.end()?;
        for row in 0..self.len() {
            self.values.iter().for_each(|values| rows.number(values[row]));
            rows.end()?;
        }
        rows.flush()
    }
}

/// Returns the columns of readings: those that the recipe names, or those that look like readings of the first one's kind, by name if at
/// least two do.
fn readings(tables: &[Table], given: &Recipe) -> Vec<(Role, ColumnName)> {
    let named = given.columns.iter().filter(|(role, name)| Role::READINGS.contains(role) && !name.is_none());
    let named: Vec<(Role, ColumnName)> = named.cloned().collect();
    if !named.is_empty() {
        return named;
    }
    let found: Vec<_> = candidates(tables).into_iter().filter(|one| Role::READINGS.contains(&one.role)).collect();
    let by_name = found.iter().filter(|one| one.is_named).count() > 1;
    let fitting = || found.iter().filter(|one| one.is_named || !by_name);
    let Some(role) = fitting().next().map(|one| one.role) else { return Vec::new() };
    fitting().filter(|one| one.role == role).map(|one| (role, refer(tables, one.place()))).collect()
}

/// Returns the role of a reference that a pair names.
fn reference_role(tables: &[Table], name: &ColumnName) -> Result<Role, ImportError> {
    let found = candidates(tables);
    let is_it = |place: FileColumn| {
        let column = &tables[place.file].columns[place.column];
        refer(tables, place) == *name || column.heading == name.column || column.name == name.column
    };
    let role = found.iter().find(|one| Role::REFERENCES.contains(&one.role) && is_it(one.place())).map(|one| one.role);
    role.ok_or_else(|| {
        let known = found.iter().filter(|one| Role::REFERENCES.contains(&one.role));
        let names = known.map(|one| quoted(&refer(tables, one.place()).to_string())).collect::<Vec<_>>();
        let what = format!("--pair: `{name}` is no column of a reference");
        ImportError::question(&tables[0].file, what, [format!("one of {}", names.join(", "))])
    })
}

/// Asks for the reference of a channel without one, if a column could be it and the user has not excluded that.
fn unreferenced(tables: &[Table], given: &Recipe, reading: &ColumnName) -> Result<(), ImportError> {
    let is_open = |role: Role| Role::REFERENCES.contains(&role) && given.column(role).is_none();
    let open: Vec<_> = candidates(tables).into_iter().filter(|one| is_open(one.role)).collect();
    if open.is_empty() {
        return Ok(());
    }
    let pair = |name: String| format!("--pair {}", quoted(&format!("{reading}={name}")));
    let mut answers: Vec<String> = open.iter().map(|one| pair(refer(tables, one.place()).to_string())).collect();
    let mut roles: Vec<Role> = open.iter().map(|one| one.role).collect();
    roles.dedup();
    answers.extend(roles.iter().map(|role| format!("--column {role}=none")));
    Err(ImportError::question(&tables[0].file, format!("nothing tells the reference of `{reading}`"), answers))
}

/// Converts the answers of a question about a reference to those for one channel of several.
fn paired(error: ImportError, reading: &ColumnName) -> ImportError {
    let ImportError::Question { file, what, answers } = error else { return error };
    let is_of = |answer: &String, role: &Role| answer.contains(&format!("{}=", role.name()));
    let is_reference = |answer: &String| Role::REFERENCES.iter().any(|role| is_of(answer, role));
    if !answers.iter().all(|answer| answer.starts_with("--column") && is_reference(answer)) {
        return ImportError::Question { file, what, answers };
    }
    let pair = |answer: String| {
        let column = answer.trim_matches('\'').split_once('=').map_or("", |(_, column)| column).to_owned();
        format!("--pair {}", quoted(&format!("{reading}={column}")))
    };
    let what = format!("{what} of `{reading}`");
    ImportError::Question { file, what, answers: answers.into_iter().map(pair).collect() }
}

/// Returns names of channels: the distinguishing part of their headings, or else the heading.
fn names_of(tables: &[Table], plans: &[Plan]) -> Vec<String> {
    let plain = |text: &str| -> String {
        let kept = text.trim().chars().map(|c| if c.is_alphanumeric() { c } else { '_' });
        kept.collect::<String>().trim_matches('_').to_lowercase()
    };
    let named = |plan: &Plan| {
        let place = plan.readings().place;
        let column = &tables[place.file].columns[place.column];
        let stem = names::stem(&column.name).join("_");
        let stem = if stem.chars().any(char::is_alphabetic) { stem } else { plain(&column.name) };
        if stem.is_empty() { format!("channel{}", place.column + 1) } else { stem }
    };
    let found: Vec<String> = plans.iter().map(named).collect();
    let own = |(place, name): (usize, &String)| {
        let is_double = found.iter().filter(|other| *other == name).count() > 1;
        if is_double { format!("{name}_{}", place + 1) } else { name.clone() }
    };
    found.iter().enumerate().map(own).collect()
}
