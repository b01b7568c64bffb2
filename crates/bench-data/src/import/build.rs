use std::fmt::Write as _;

use ohmstrain_calib::{Lag, LagError, clock_lag};

use crate::Trace;
use crate::columns::Column;
use crate::counted::counted;
use crate::error::{Fault, TraceError, quote};
use crate::import::channel::{Channel, Values, name};
use crate::import::clock::Times;
use crate::import::digits::{DIGITS, rounded, told_apart};
use crate::import::error::ImportError;
use crate::import::plan::Plan;
use crate::import::questions::quoted;
use crate::import::recipe::Align;
use crate::import::roles::Role;
use crate::import::series::{Series, alternation, folded, spurious_zeros};
use crate::import::table::Table;
use crate::metadata::{Metadata, ResistanceUnit, StrainUnit};
use crate::rows::RowWriter;

/// Texts that stand for missing values and are named.
const MOST_TEXTS: usize = 8;

/// A trace out of files.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The trace.
    pub trace: Trace,
    /// What was left out, filled in or noticed, one line each.
    pub remarks: Vec<String>,
    /// Lag of the reference's clock that was taken out, where the motion told.
    pub lag: Option<Lag>,
    /// Rows left out because they had the time of the row before.
    pub duplicates: usize,
    /// By how much neighbouring readings alternated, relative to their size, if they did: the current's polarity flips.
    pub alternation: Option<f64>,
}

impl Plan {
    /// The trace, and what was done to get it.
    ///
    /// # Errors
    /// [`ImportError`] for cells that are no numbers, times that go back, and motion that does not tell the clocks apart.
    pub fn import(&self, tables: &[Table]) -> Result<Imported, ImportError> {
        build(self, tables)
    }
}

fn build(plan: &Plan, tables: &[Table]) -> Result<Imported, ImportError> {
    let mut work = Work { plan, tables, remarks: plan.remarks.clone(), lag: None, duplicates: 0, alternation: None };
    let (readings, zero) = work.readings()?;
    let reference = work.reference(&readings, zero.as_ref().map(|(zero, _)| *zero))?;
    let temperature = work.temperature(&readings)?;
    work.mention_unused();
    work.mention_passed_over();
    let metadata = work.metadata(zero.map(|(_, text)| text));
    let trace = work.trace(&metadata, &readings, reference.as_deref(), temperature.as_deref())?;
    let Work { remarks, lag, duplicates, alternation, .. } = work;
    Ok(Imported { trace, remarks, lag, duplicates, alternation })
}

struct Work<'a> {
    plan: &'a Plan,
    tables: &'a [Table],
    remarks: Vec<String>,
    lag: Option<Lag>,
    duplicates: usize,
    alternation: Option<f64>,
}

type Zero = Option<(i128, String)>;

impl Work<'_> {
    fn remark(&mut self, table: usize, text: &str) {
        self.remarks.push(format!("{}: {text}", self.tables[table].file));
    }

    fn readings(&mut self) -> Result<(Series, Zero), ImportError> {
        let channel = self.plan.readings;
        let times = Times::read(self.tables, &self.plan.time, &self.plan.recipe.missing)?;
        if times.wraps > 0 {
            self.remark(
                channel.table,
                &format!("the clock's 32-bit counter started again {}", counted(times.wraps, "time")),
            );
        }
        let values = self.values(&channel)?;
        let mut series = self.ordered(channel.table, &times.seconds, values)?;
        self.alternation = alternation(&series.value);
        if self.plan.recipe.fold_polarity {
            if channel.role == Role::Adc {
                let what = "--fold-polarity takes means of neighbours, and converter codes have none";
                return Err(ImportError::unreadable(&self.tables[channel.table].file, what));
            }
            series = folded(&series);
            self.remark(channel.table, "each reading is the mean of two neighbours of opposite polarity");
        } else if let Some(share) = self.alternation {
            let text =
                format!("neighbouring readings alternate by {:.1} %: --fold-polarity takes their means", 100.0 * share);
            self.remark(channel.table, &text);
        }
        Ok((series, times.zero))
    }

    /// A column's numbers as they are wanted: sizes instead of signs, zeros that are none left out.
    fn values(&mut self, channel: &Channel) -> Result<Vec<f64>, ImportError> {
        let (table, recipe) = (&self.tables[channel.table], &self.plan.recipe);
        let Values { mut values, missing } = Values::read(table, channel, &recipe.missing)?;
        let column = name(table, channel.column);
        if !missing.is_empty() {
            let texts: Vec<String> =
                missing.iter().take(MOST_TEXTS).map(|(text, count)| format!("{count} × {}", quote(text))).collect();
            let others = missing.len().saturating_sub(MOST_TEXTS);
            let others = if others > 0 { format!(" and {}", counted(others, "other text")) } else { String::new() };
            self.remark(channel.table, &format!("column {column}: missing values: {}{others}", texts.join(", ")));
        }
        if recipe.magnitude.contains(&channel.role) {
            values.iter_mut().for_each(|value| *value = value.abs());
        }
        if recipe.drop_zeros.contains(&channel.role) {
            let zeros = spurious_zeros(&values, Role::READINGS.contains(&channel.role));
            zeros.iter().for_each(|row| values[*row] = f64::NAN);
            if !zeros.is_empty() {
                self.remark(
                    channel.table,
                    &format!("column {column}: {} left out: no reading is zero there", counted(zeros.len(), "zero")),
                );
            }
        }
        if let Some((_, zero)) = recipe.zero.iter().rev().find(|(role, _)| *role == channel.role) {
            let zero = channel.convert(*zero);
            values.iter_mut().for_each(|value| *value -= zero);
        }
        match channel.role {
            Role::Resistance | Role::Ratio => self.positive(channel, values),
            _ => Ok(values),
        }
    }

    /// Refuses what is no resistance, with the flag that says what it is.
    fn positive(&self, channel: &Channel, values: Vec<f64>) -> Result<Vec<f64>, ImportError> {
        let table = &self.tables[channel.table];
        let Some(row) = values.iter().position(|value| *value <= 0.0) else { return Ok(values) };
        let cell = table.columns[channel.column].cells.get(row);
        let answers = if values[row] < 0.0 {
            vec![
                format!("--magnitude {} if signs are arbitrary", channel.role),
                format!("--missing {} if it means a missing value", quoted(cell)),
            ]
        } else {
            vec![format!("--drop-zeros {} if zeros are missing values", channel.role)]
        };
        let (column, found) = (name(table, channel.column), rounded(values[row], DIGITS));
        let what = format!("column {column}: expected a positive resistance, found {found}");
        let place = format!("{}:{}", table.file, table.lines[row]);
        Err(ImportError::question(&place, what, answers))
    }

    /// Rows in the order of time: those without a time and repeated ones are left out.
    fn ordered(&mut self, table: usize, time: &[f64], value: Vec<f64>) -> Result<Series, ImportError> {
        let of = &self.tables[table];
        let (mut series, mut untimed, mut repeated) = (Series::default(), 0_usize, 0_usize);
        for (row, (&time, value)) in time.iter().zip(value).enumerate() {
            match series.time.last() {
                _ if time.is_nan() => untimed += 1,
                Some(&last) if time == last => repeated += 1,
                Some(&last) if time < last => {
                    let (last, time) = told_apart(last, time);
                    let found = format!("{time} s; if another recording begins here, make two files of them");
                    let fault = Fault::new(format!("a time after {last} s"), found);
                    return Err(ImportError::content(&of.file, of.lines[row], fault));
                }
                _ => series.push(time, value, row),
            }
        }
        if series.time.is_empty() {
            return Err(ImportError::unreadable(&of.file, "expected rows with a time, found none"));
        }
        if repeated * 5 > of.len() {
            let what =
                format!("{repeated} of {} rows have the time of the row before: the clock is too coarse", of.len());
            return Err(ImportError::question(
                &of.file,
                what,
                ["--rate-hz HZ if the rows are evenly spaced".to_owned()],
            ));
        }
        if untimed > 0 {
            self.remark(table, &format!("{} without a time left out", counted(untimed, "row")));
        }
        if repeated > 0 {
            self.duplicates += repeated;
            self.remark(table, &format!("{} with the time of the row before left out", counted(repeated, "row")));
        }
        Ok(series)
    }

    /// The reference at the readings' times.
    fn reference(&mut self, readings: &Series, zero: Option<i128>) -> Result<Option<Vec<f64>>, ImportError> {
        let Some((channel, clock)) = &self.plan.reference else { return Ok(None) };
        let values = self.values(channel)?;
        let align = self.plan.recipe.align.unwrap_or(Align::None);
        if self.plan.is_one_clock() && align == Align::None && !self.plan.recipe.fold_polarity {
            return Ok(Some(readings.row.iter().map(|row| values[*row]).collect()));
        }
        let times = Times::read(self.tables, clock, &self.plan.recipe.missing)?;
        let apart = match (zero, &times.zero) {
            (Some(ours), Some((theirs, _))) => (theirs - ours) as f64 / 1e9,
            _ => 0.0,
        };
        let seconds: Vec<f64> = times.seconds.iter().map(|time| time + apart).collect();
        let mut series = self.ordered(clock.table(), &seconds, values)?;
        let shift = match align {
            Align::None => 0.0,
            Align::Seconds(seconds) => seconds,
            Align::Motion => self.by_motion(readings, &series)?,
        };
        series.time.iter_mut().for_each(|time| *time += shift);
        let values = series.at(&readings.time);
        let unknown = values.iter().filter(|value| value.is_nan()).count();
        if unknown > 0 {
            self.remark(channel.table, &format!("no reference within reach of {unknown} of {} readings", values.len()));
        }
        Ok(Some(values))
    }

    fn by_motion(&mut self, readings: &Series, reference: &Series) -> Result<f64, ImportError> {
        let files: Vec<&str> = self.tables.iter().map(|table| table.file.as_str()).collect();
        let files = files.join(", ");
        let found = clock_lag((&readings.time, &readings.value), (&reference.time, &reference.value));
        let lag = found.map_err(|error| {
            let answers = ["--align SECONDS, what to add to the reference's clock".to_owned()];
            ImportError::question(&files, format!("--align motion: {}", as_offset(error)), answers)
        })?;
        self.remarks.push(format!(
            "{files}: the reference's clock plus {:.3} ± {:.3} s is the readings', by the motion; a lag of the sensor itself is in it",
            -lag.lag_s, lag.sd_s
        ));
        self.lag = Some(lag);
        Ok(-lag.lag_s)
    }

    fn temperature(&mut self, readings: &Series) -> Result<Option<Vec<f64>>, ImportError> {
        let Some(channel) = self.plan.temperature else { return Ok(None) };
        let values = self.values(&channel)?;
        if !self.plan.recipe.fold_polarity {
            return Ok(Some(readings.row.iter().map(|row| values[*row]).collect()));
        }
        let times = Times::read(self.tables, &self.plan.time, &self.plan.recipe.missing)?;
        Ok(Some(self.ordered(channel.table, &times.seconds, values)?.at(&readings.time)))
    }

    /// Files from which nothing is taken.
    fn mention_unused(&mut self) {
        let of = |channel: &Channel| channel.table;
        let mut used = vec![of(&self.plan.readings)];
        used.extend(self.plan.reference.iter().map(|(channel, _)| of(channel)));
        for table in (0..self.tables.len()).filter(|table| !used.contains(table)).collect::<Vec<_>>() {
            self.remark(table, "nothing is taken from this file");
        }
    }

    /// Lines that are no rows, and rows that lack cells.
    fn mention_passed_over(&mut self) {
        for (index, table) in self.tables.iter().enumerate() {
            let layout = &table.layout;
            if let Some(line) = layout.first_text_line {
                let lines = counted(layout.text_lines, "line");
                let which = if layout.text_lines > 1 { "of which the first is" } else { "which is" };
                self.remark(index, &format!("{lines} among or behind the data passed over, {which} line {line}"));
            }
            if layout.short_lines > 0 {
                let rows = counted(layout.short_lines, "row");
                self.remark(
                    index,
                    &format!("{rows} with fewer cells than there are columns: the last ones are taken for missing"),
                );
            }
        }
    }

    fn metadata(&self, zero: Option<String>) -> Metadata {
        let mut metadata = self.tables[self.plan.readings.table].metadata.clone();
        if let Some((channel, _)) = &self.plan.reference {
            metadata.override_with(&self.tables[channel.table].metadata);
        }
        let recipe = &self.plan.recipe;
        let files: Vec<&str> = self.tables.iter().map(|table| table.file.as_str()).collect();
        let mut other = vec![("imported_from".to_owned(), files.join(", "))];
        other.extend(zero.map(|zero| ("time_zero".to_owned(), zero)));
        // The units are known now, and nobody has to ask for them again.
        let reference = self.plan.reference.as_ref().map(|(channel, _)| channel.role);
        let is_strain = matches!(reference, Some(Role::Strain | Role::Displacement));
        let mut metadata = Metadata { strain_unit: None, resistance_unit: None, ..metadata };
        metadata.override_with(&Metadata {
            gauge_length_mm: recipe.gauge_length_mm,
            front_end: recipe.front_end,
            joint: recipe.joint,
            strain_unit: is_strain.then_some(StrainUnit::Fraction),
            resistance_unit: (self.plan.readings.role == Role::Resistance).then_some(ResistanceUnit::Ohm),
            other,
            ..Metadata::default()
        });
        metadata
    }

    /// Writes the schema and reads it: every unit is converted, and every value judged, where traces are read.
    fn trace(
        &self,
        metadata: &Metadata,
        readings: &Series,
        reference: Option<&[f64]>,
        temperature: Option<&[f64]>,
    ) -> Result<Trace, ImportError> {
        let mut text = String::new();
        let _ = write!(text, "{metadata}");
        let mut rows = RowWriter::new(text.into_bytes());
        let reference_role = self.plan.reference.as_ref().map(|(channel, _)| channel.role);
        let of_values = [Some(self.plan.readings.role), reference_role, self.plan.temperature.map(|of| of.role)];
        let roles = [Role::Time].into_iter().chain(of_values.into_iter().flatten());
        roles.for_each(|role| rows.text(column(role).name()));
        let io = |error: std::io::Error| ImportError::unreadable("import", error.to_string());
        rows.end().map_err(io)?;
        for (row, (&time, &value)) in readings.time.iter().zip(&readings.value).enumerate() {
            rows.number(time);
            rows.number(value);
            for values in [reference, temperature].into_iter().flatten() {
                rows.number(values[row]);
            }
            rows.end().map_err(io)?;
        }
        let read = Trace::read(rows.into_inner().as_slice(), &self.tables[self.plan.readings.table].file);
        read.map_err(|error| match error {
            TraceError::Content(content) => {
                let place = content.column.map_or(String::new(), |column| format!("column `{column}`: "));
                let what = format!("{place}expected {}, found {}", content.expected, content.found);
                ImportError::unreadable(&content.file, what)
            }
            TraceError::Io { source, .. } => io(source),
        })
    }
}

/// The column of a trace that a role becomes.
const fn column(role: Role) -> Column {
    match role {
        Role::Time | Role::ReferenceTime => Column::TimeS,
        Role::Resistance => Column::ResistanceOhm,
        Role::Ratio => Column::ResistanceRatio,
        Role::Adc => Column::Adc,
        Role::Strain => Column::Strain,
        Role::Displacement => Column::DisplacementMm,
        Role::Angle => Column::AngleDeg,
        Role::Temperature => Column::TemperatureC,
    }
}

/// An error in terms of what is added to the reference's clock.
fn as_offset(error: LagError) -> LagError {
    match error {
        LagError::Repeats(best, other) => LagError::Repeats(-best, -other),
        LagError::AtEnd(end) => LagError::AtEnd(-end),
        other => other,
    }
}
